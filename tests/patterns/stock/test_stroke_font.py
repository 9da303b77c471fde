"""Characters are single strokes on the grid of their font; texts run to the right and scale."""

import string

import numpy as np
import pytest

from cqblend.errors import InputError
from cqblend.patterns.stock.stroke_font import GLYPHS, make_text_strokes, measure_text_width


def test_every_character_is_open_strokes_on_its_grid():
    assert set(string.digits + string.ascii_uppercase + ".-/+ ") <= set(GLYPHS)
    drawn = set()
    for letter, glyph in GLYPHS.items():
        paths = make_text_strokes(letter, 6.0)
        assert len(paths) == len(glyph.split())
        for path in paths:
            assert not path.bulges.any()
            assert path.chords.min() > 0
            assert path.points.min() >= 0
            assert path.points[:, 0].max() <= 4
            assert path.points[:, 1].max() <= 6
        drawn.add(glyph)
    assert len(drawn) == len(GLYPHS)
    for letter in string.digits + string.ascii_uppercase:
        points = np.concatenate([path.points for path in make_text_strokes(letter, 6.0)])
        assert points[:, 1].min() == 0
        assert points[:, 1].max() == 6
        assert points[:, 0].min() == 0


def test_text_runs_to_the_right_and_scales():
    small, large = make_text_strokes("S12.4-B/7+A", 1.5), make_text_strokes("S12.4-B/7+A", 3.0)
    for a, b in zip(small, large, strict=True):
        np.testing.assert_allclose(2 * a.points, b.points)
    width = max(path.points[:, 0].max() for path in large)
    assert width == pytest.approx(measure_text_width("S12.4-B/7+A", 3.0))
    assert [p.points.tolist() for p in make_text_strokes("ab", 2.0)] == [
        p.points.tolist() for p in make_text_strokes("AB", 2.0)
    ]
    with pytest.raises(InputError, match=r"'É' in the label 'né'"):
        make_text_strokes("né", 2.0)
