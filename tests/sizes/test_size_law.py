"""Laws of sizes: scaled, shared out, closed, and continued past their ends."""

import numpy as np
import pytest

import cqblend
from cqblend.errors import InputError
from cqblend.sizes.law_checks import check_law
from cqblend.sizes.size_law import SizeLaw

T = np.linspace(0, 1, 33)
SINE = check_law("radius", lambda t: 2 + np.sin(2 * np.pi * t))


def test_it_is_the_function():
    assert np.array_equal(SINE(T), 2 + np.sin(2 * np.pi * T))
    assert (SINE.smallest, SINE.largest) == (1.0, 3.0)
    assert SINE.vanishes == (False, False)


def test_scaled():
    assert np.array_equal(SINE.scale(1.5)(T), 1.5 * SINE(T))


def test_a_share_of_it_and_it_backwards():
    part, backward = SINE.restrict(0.25, 0.75), SINE.restrict(1.0, 0.0)
    assert np.allclose(part(T), SINE(0.25 + 0.5 * T), rtol=0, atol=1e-14)
    assert np.array_equal(backward(T), SINE(1 - T))
    assert (part.smallest, part.largest) == (1.0, 3.0)


def test_a_share_that_is_one_number_becomes_it():
    law = check_law("radius", cqblend.table([(0, 1), (0.5, 1), (1, 3)]))
    assert law.restrict(0.1, 0.5) == 1.0
    assert isinstance(law.restrict(0.1, 0.6), SizeLaw)


@pytest.mark.parametrize(
    "law", [cqblend.linear(1, 3), cqblend.table([(0, 1), (0.4, 2), (1, 5)]), np.exp, lambda t: 3 - t**2]
)
def test_past_its_ends_it_goes_on_with_its_slope(law):
    found = check_law("radius", law)
    for end, sign in ((0.0, -1.0), (1.0, 1.0)):
        step = 1e-5
        inside, at, outside = found(np.array([end - sign * step, end, end + sign * step]))
        assert (outside - at) / step == pytest.approx((at - inside) / step, rel=1e-3, abs=1e-3)


def test_past_its_ends_a_linear_one_is_linear():
    assert check_law("radius", cqblend.linear(1, 3))(np.array([-0.2, 1.3])).tolist() == pytest.approx(
        [0.6, 3.6], abs=1e-15
    )


def test_past_its_ends_it_never_falls_to_0():
    values = check_law("radius", cqblend.linear(1, 3))(np.linspace(0, -3, 50))
    assert (np.diff(values) < 0).all()
    assert values.min() > 0


def test_the_ends_at_which_it_goes_to_0():
    law = check_law("radius", lambda t: np.sin(np.pi * t))
    assert law.vanishes == (True, True)
    for end in (0, 1):
        limit = law.find_vanishing_limit(end)
        assert law(np.array([limit]))[0] == pytest.approx(1e-3, rel=1e-6)
        assert abs(limit - end) < 0.01
    assert law.restrict(0.0, 0.5).vanishes == (True, False)


@pytest.mark.parametrize("span", [(0.0, 1.0), (0.3, 1.3), (0.2, -0.8)])
def test_around_a_closed_edge(span):
    around = check_law("radius", lambda t: 2 + np.sin(2 * np.pi * t)).close().restrict(*span)
    expected = 2 + np.sin(2 * np.pi * (span[0] + (span[1] - span[0]) * T))
    assert np.abs(around(T) - expected).max() < 1e-14


def test_a_table_around_a_closed_edge_is_smooth_where_it_closes():
    law = check_law("radius", cqblend.table([(0, 2), (0.3, 3), (0.8, 1), (1, 2)])).close()
    step = 1e-6
    before, at, after = law(np.array([-step, 0.0, step]))
    assert (at - before) / step == pytest.approx((after - at) / step, rel=1e-4)
    assert law.locate_corners((0.5, 1.5)).tolist() == pytest.approx([0.8, 1.0, 1.3])


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (cqblend.linear(1, 2), "radius is 1 mm at t = 0 and 2 mm at t = 1, which are one place"),
        (lambda t: 2 + np.sin(np.pi * t), "radius has a corner at t = 0, where its slope jumps from -3.142 to 3.142"),
        (lambda t: np.sin(np.pi * t) ** 2, "radius is 0 at an end: that can only be on an open edge"),
    ],
)
def test_what_cannot_go_around_a_closed_edge(law, message):
    with pytest.raises(InputError, match=message):
        check_law("radius", law).close()


def test_where_it_is_no_more_than_c1():
    law = check_law("radius", cqblend.table([(0, 1), (0.4, 2), (1, 5)]))
    assert law.locate_corners((-0.1, 1.1)).tolist() == pytest.approx([0.0, 0.4, 1.0])
    assert law.restrict(1.0, 0.0).locate_corners((0.0, 1.0)).tolist() == pytest.approx([0.6])
    assert len(check_law("radius", cqblend.linear(1, 2)).locate_corners((-1, 2))) == 0
