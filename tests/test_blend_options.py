"""Every option is checked at the door: by type, by range, and against what is built."""

import math
import re
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import cqblend
from cqblend.blend_numbers import OPTION_LIMITS
from cqblend.blend_options import BlendOptions
from cqblend.errors import InputError, SizeError, UnsupportedError
from cqblend.sizes.size_law import SizeLaw


def checked(radius=None, **options):
    return BlendOptions(radius, **options).to_request()


def test_defaults():
    request = checked(2)
    assert (request.radius, request.width) == (2.0, None)
    assert request.continuity == ("G1", "G1")
    assert request.tangents == ("perpendicular", "perpendicular")
    assert (request.section, request.form) == ("auto", "auto")
    assert (request.tolerance, request.angular_tolerance) == (1e-7, 1e-5)
    assert request.bulge == (1.0, 1.0)
    assert math.degrees(request.steer) == pytest.approx(20)


@pytest.mark.parametrize("size", [2, 2.0, Fraction(4, 2), np.float32(2), np.int64(2)])
def test_every_real_number_is_a_number(size):
    assert checked(size).radius == 2.0
    assert type(checked(size).radius) is float
    assert checked(width=size).width == (2.0, 2.0)


def test_width_may_differ_by_side():
    assert checked(width=(1, 3)).width == (1.0, 3.0)


@pytest.mark.parametrize("value", ["2", b"2", True, 2j, [2], (2, 2), {}, object(), Decimal(2), np.array([2.0])])
def test_what_is_no_number(value):
    with pytest.raises(InputError, match=r"^radius must be a number, not "):
        checked(value)
    with pytest.raises(InputError, match=r"^tolerance must be a number, not "):
        checked(2, tolerance=value)
    with pytest.raises(InputError, match=r"^bulge\[1\] must be a number, not "):
        checked(2, bulge=(1, value))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400])
@pytest.mark.parametrize("name", ["bulge", "tolerance", "angular_tolerance"])
def test_what_is_not_finite(name, value):
    with pytest.raises(InputError, match=rf"^{name} must be finite, not "):
        checked(2, **{name: value})
    with pytest.raises(InputError, match=r"^radius must be finite, not "):
        checked(value)


@pytest.mark.parametrize("value", [0, -0.0, -1, -1e-300])
def test_what_is_not_positive(value):
    with pytest.raises(InputError, match=f"^radius must be above 0, not {value:g}$"):
        checked(value)
    with pytest.raises(InputError, match=r"^width\[1\] must be above 0"):
        checked(width=(1, value))


def test_the_range_of_sizes():
    assert checked(OPTION_LIMITS.min_size).radius == OPTION_LIMITS.min_size
    assert checked(OPTION_LIMITS.max_size).radius == OPTION_LIMITS.max_size
    with pytest.raises(SizeError, match="radius 9e-07 mm is below 1e-06 mm"):
        checked(9e-7)
    with pytest.raises(InputError, match=r"width\[0\] 1e\+12 mm is above 1e\+09 mm"):
        checked(width=(1e12, 1))


@pytest.mark.parametrize("value", [5e-324, 9e-13, 1.1e6, 1e300])
def test_the_range_of_bulges(value):
    for good in (OPTION_LIMITS.min_bulge, OPTION_LIMITS.max_bulge):
        assert checked(2, bulge=good).bulge == (good, good)
    with pytest.raises(InputError, match=r"^bulge\[1\] must be from 1e-12 to 1e\+06, not "):
        checked(2, bulge=(1, value))


@pytest.mark.parametrize(("options", "given"), [({}, "neither"), ({"radius": 1, "width": 1}, "both")])
def test_exactly_one_of_radius_and_width(options, given):
    with pytest.raises(InputError, match=f"exactly one of radius and width, not {given}"):
        checked(**options)


@pytest.mark.parametrize("width", [(), (1,), (1, 2, 3), [1, 2, 3]])
def test_a_pair_has_two_values(width):
    with pytest.raises(InputError, match=f"one value or a pair, one for each side, not {len(width)} values"):
        checked(width=width)


@pytest.mark.parametrize(
    "options",
    [
        *({"radius": 1, "tangents": name} for name in ("guide", "combination", ("chord", "guide"))),
    ],
)
def test_what_is_not_built_yet_raises(options):
    with pytest.raises(UnsupportedError, match="not built yet"):
        checked(**options)


def test_sizes_that_vary_become_laws():
    request = checked(width=(1, lambda t: 1 + t))
    assert request.width[0] == 1.0
    assert isinstance(request.width[1], SizeLaw)
    assert request.width[1](np.array([0.25])) == 1.25


def test_functions_that_are_constant_become_numbers():
    assert type(checked(lambda t: 0 * t + 0.3).radius) is float
    assert checked(lambda _: 0.3) == checked(0.3)
    assert checked(width=(cqblend.linear(2, 2), 3)).width == (2.0, 3.0)


def test_a_rail_can_be_held_with_a_constant_function_but_with_none_that_varies():
    assert checked(lambda _: 0.3, hold=["edge"]).radius == 0.3
    with pytest.raises(InputError, match="with hold, radius is a number"):
        checked(cqblend.linear(1, 2), hold=["edge"])


@pytest.mark.parametrize("law", [lambda t: 1e-7 + 1e-9 * t, cqblend.linear(1e-8, 1e-7)])
def test_sizes_that_vary_have_the_same_range(law):
    with pytest.raises(SizeError, match="below 1e-06 mm"):
        checked(law)


def test_a_pair_of_radii_is_refused_and_told_what_to_do():
    with pytest.raises(InputError, match=r"a ball touches both with one.*width=\(1, 3\).*cqblend\.linear\(1, 3\)"):
        checked((1, 3))


def test_sizes_by_edge():
    request = checked({"edge 1": 2, "edge 2": cqblend.linear(1, 2)}, taper=3)
    assert (request.radius, request.width, request.taper) == (None, None, 3.0)
    assert [one.edge for one in request.edge_sizes] == ["edge 1", "edge 2"]
    assert request.edge_sizes[0].sizes == (2.0,)
    assert checked(width={"edge 1": (2, 3)}).edge_sizes[0].sizes == (2.0, 3.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radius": {}}, "radius must be a number, not {}: as a mapping, it has a size for each edge"),
        ({"radius": {"edge 1": (1, 2)}}, "a ball touches both with one"),
        ({"radius": {"edge 1": {}}}, "radius must be a number, not {}"),
        ({"width": {"edge 1": (1, 2, 3)}}, "one for each side, not 3 values"),
        ({"radius": 1, "taper": 2}, "taper has no effect unless radius is a mapping"),
        ({"radius": {"edge 1": 1}, "taper": 0}, "taper must be above 0"),
        ({"section": "potential", "a": 1, "taper": 2}, "taper is no option of section='potential'"),
        ({"section": "potential", "a": lambda t: t}, "a must be a number"),
    ],
)
def test_sizes_by_edge_that_are_none(options, message):
    with pytest.raises(InputError, match=re.escape(message)):
        checked(**options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radius": 1, "a": 1}, "radius is no option of section='potential': a and b set how far it reaches"),
        ({"width": (1, 2), "a": 1}, "width is no option of section='potential'"),
        ({"a": 1, "tangents": "chord"}, "tangents is no option of section='potential'"),
        ({"a": 1, "bulge": 2}, "bulge is no option"),
        ({"a": 1, "steer": 0}, "steer is no option"),
        ({"a": 1, "order": 4}, "order is an option of section=\"pde\", not of 'potential'"),
        ({"a": 1, "continuity": "G2"}, "a potential blend is G1 on both sides"),
        ({}, "takes a and b"),
        ({"lam": -1}, "takes a and b"),
        ({"a": -1}, "a must be above 0"),
        ({"a": 1, "b": math.nan}, "b must be finite"),
        ({"a": 2, "b": 3, "lam": 6}, "lam must be below a b = 6, not 6"),
        ({"a": 2, "lam": "0"}, "lam must be a finite number"),
    ],
)
def test_potential_sections_take_their_own_options(options, message):
    with pytest.raises(InputError, match=re.escape(message)):
        checked(**{"section": "potential", **options})


@pytest.mark.parametrize("section", ["hermite", "pde"])
@pytest.mark.parametrize("name", ["a", "b", "lam"])
def test_other_sections_do_not_take_those_of_potential_ones(section, name):
    with pytest.raises(InputError, match=f'{name} is an option of section="potential", not of {section!r}'):
        checked(1, section=section, **{name: 1})


def test_one_of_a_and_b_is_both():
    request = checked(section="potential", b=3, lam=-2)
    assert (request.relation.a, request.relation.b, request.relation.lam) == (3, 3, -2)
    assert (request.radius, request.width, request.continuity) == (None, None, ("G1", "G1"))


@pytest.mark.parametrize("name", ["continuity", "tangents", "section", "form"])
@pytest.mark.parametrize("value", ["g1", "", "G4", 1, (), ("G1", "G4"), ["nope", 2], b"G1", math.nan])
def test_unknown_options_name_the_known_ones(name, value):
    with pytest.raises(InputError, match=rf"^{name}(\[[01]\])? must be '|^{name} must be one value or a pair"):
        checked(1, **{name: value})


def test_what_goes_by_side_comes_as_a_pair():
    request = checked(1, continuity=("G2", "G0"), tangents="chord", bulge=[1, 1.5])
    assert request.continuity == ("G2", "G0")
    assert request.tangents == ("chord", "chord")
    assert request.bulge == (1.0, 1.5)
    assert checked(1).continuity == ("G1", "G1")
    assert checked(1, steer=0).steer == 0
