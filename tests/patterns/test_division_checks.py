"""Faults of divisions: borders that are too short in space."""

import numpy as np
import pytest

from cqblend.errors import CqblendError
from cqblend.patterns.division_checks import find_border_mismatch, measure_borders
from cqblend.patterns.flattening.face_division import divide_patches
from cqblend.patterns.flattening.sampled_edges import SampledEdges
from cqblend.patterns.trimming.surface_shell import make_surface_shell
from cqblend.splines import Surface
from cqblend.unroll_options import UnrollOptions

RADIUS, LENGTH = 10.0, 30.0


def gutter():
    """A quarter of a cylinder, v around it."""
    arc = RADIUS * np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    poles = [[(x, *point) for point in arc] for x in (0.0, LENGTH)]
    knots = [0, 0, 1, 1], [0, 0, 0, 1, 1, 1]
    return Surface.from_bspline((1, 2), knots, poles, np.tile([1, np.sqrt(0.5), 1], (2, 1)))


def divided(tolerance):
    """The gutter with its rulings along v, as chords of the arc."""
    shell, options = make_surface_shell(gutter()), UnrollOptions(tolerance, direction="v")
    (face,) = divide_patches(shell.patches, options, lambda _: None)
    assert not isinstance(face, CqblendError)
    return face, SampledEdges(shell, [face], options)


@pytest.mark.parametrize("tolerance", [2.0, 0.1])
def test_borders_of_strips_are_as_long_as_their_chords(tolerance):
    face, edges = divided(tolerance)
    lengths = measure_borders(face, edges)
    spans = [face.strips[0].span[0], *(strip.span[1] for strip in face.strips)]
    chords = np.linalg.norm(np.diff(face.strips[0].surface(0.0, spans), axis=0), axis=1).sum()
    assert sorted(lengths.values()) == pytest.approx(sorted([chords, chords, LENGTH, LENGTH]), rel=1e-9)


def test_an_arc_in_place_of_which_there_is_one_chord_is_too_long():
    error, mismatch = find_border_mismatch(*divided(4.0))
    assert "longer than the strips that end there" in str(error)
    assert mismatch == pytest.approx((np.pi / (2 * np.sqrt(2)) - 1) / 0.02, rel=1e-6)
    assert find_border_mismatch(*divided(0.1)) is None
