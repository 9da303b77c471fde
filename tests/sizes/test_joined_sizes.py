"""Sizes of single edges, joined: they agree where edges meet, or change gradually over a length."""

import numpy as np
import pytest

import cqblend
from cqblend.errors import InputError
from cqblend.sizes.joined_sizes import join_sizes
from cqblend.sizes.law_checks import check_law

STOPS = [0.25, 0.5, 1.0]


def joined(sizes, taper=None, *, closed=False, stops=STOPS):
    laws = [check_law("radius", size) if callable(size) else size for size in sizes]
    return join_sizes("radius", laws, stops, taper, lambda k: f"vertex {k}", closed=closed)


def test_equal_sizes_are_one_number():
    assert joined([2.0, 2.0, 2.0]) == 2.0


def test_sizes_that_differ_are_refused_where_they_meet():
    with pytest.raises(InputError, match=r"radius is 2 mm before vertex 1 and 3 mm after it: .*taper="):
        joined([2.0, 2.0, 3.0])
    with pytest.raises(InputError, match="radius is 3 mm before vertex 1 and 2 mm after it"):
        joined([2.0, lambda t: 1 + 2 * t], closed=True, stops=[0.5, 1.0])


def test_a_taper_changes_the_size_over_its_length_and_nowhere_else():
    law, t = joined([1.0, 2.0, 4.0], 0.2), np.linspace(0, 1, 1001)
    values = law(t)
    assert (values[t <= 0.15 - 1e-9] == 1).all()
    assert (values[(t >= 0.35 + 1e-9) & (t <= 0.4 - 1e-9)] == 2).all()
    assert (values[t >= 0.6 + 1e-9] == 4).all()
    assert (np.diff(values) >= 0).all()
    assert law(np.array([0.25, 0.5])).tolist() == pytest.approx([1.5, 3.0])
    second = np.diff(values, 2) / np.diff(t)[0] ** 2
    assert np.abs(np.diff(second)).max() < 0.05 * np.abs(second).max()  # C2


def test_a_taper_on_a_closed_chain_goes_over_its_start():
    law = joined([1.0, 1.0, 2.0], 0.2, closed=True).close()
    assert law(np.array([0.0, 1.0, 0.05, 0.95])).tolist() == pytest.approx([1.5, 1.5, 1.103515625, 1.896484375])
    assert law(np.array([0.1, 0.4, 0.6, 0.9])).tolist() == pytest.approx([1, 1, 2, 2])


@pytest.mark.parametrize(
    ("sizes", "closed"), [([1.0, 2.0, 4.0], False), ([1.0, 2.0, 1.0], True), ([2.0, 1.0, 1.0], False)]
)
def test_a_taper_needs_room(sizes, closed):
    with pytest.raises(InputError, match=r"taper is too long: at vertex \d, there is no room for it"):
        joined(sizes, 0.51, closed=closed)


def test_laws_go_on_where_they_agree():
    line = check_law("radius", cqblend.linear(1, 2))
    law = join_sizes("radius", [line, line, 2.0], STOPS, 0.3, lambda k: f"vertex {k}", closed=False)
    t = np.array([0.0, 0.2, 0.3, 0.35, 0.65, 1.0])
    assert law(t).tolist() == pytest.approx([1.0, 1.2, 1.3, 1.35, 2.0, 2.0])


def test_corners_where_sizes_agree_are_refused():
    with pytest.raises(InputError, match=r"radius has a corner at t = 0\.5"):
        joined([lambda t: 1 + 2 * t, lambda t: 1 + 2 * t, 2.0])


def test_along_a_part_without_a_size_it_changes_from_one_neighbour_to_the_other():
    law, t = joined([1.0, None, 3.0]), np.linspace(0, 1, 1001)
    values = law(t)
    assert (values[t <= 0.25] == 1).all()
    assert (values[t >= 0.5] == 3).all()
    assert (np.diff(values) >= 0).all()
    assert law(np.array([0.375])) == pytest.approx([2.0])
    second = np.diff(values, 2) / np.diff(t)[0] ** 2
    assert np.abs(np.diff(second)).max() < 0.1 * np.abs(second).max()  # C2


def test_several_such_parts_are_one_change():
    law = joined([1.0, None, None, 3.0], stops=[0.2, 0.3, 0.6, 1.0])
    assert law(np.array([0.2, 0.4, 0.6])) == pytest.approx([1.0, 2.0, 3.0])


def test_a_closed_chain_may_end_in_such_a_part():
    law = joined([1.0, None, 3.0, None], closed=True, stops=[0.25, 0.5, 0.75, 1.0]).close()
    assert law(np.array([0.1, 0.375, 0.6, 0.875, 1.0])) == pytest.approx([1.0, 2.0, 3.0, 2.0, 1.0])


def test_a_change_may_be_short():
    law = joined([1.0, None, 3.0, None], closed=True, stops=[0.25, 0.254, 0.997, 1.0]).close()
    assert law(np.array([0.1, 0.252, 0.6, 0.9985, 1.0])) == pytest.approx([1.0, 2.0, 3.0, 2.0, 1.0])
    assert [law.measure_slope(end) for end in (0.0, 1.0)] == [0.0, 0.0]
