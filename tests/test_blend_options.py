"""Every option is checked at the door: by type, by range, and against what is built."""

import inspect
import math
import re
from dataclasses import fields
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import cqblend
from cqblend import __main__ as cli
from cqblend import cadquery_plugin
from cqblend.blend_options import BLEND_DEFAULTS, CONTINUITIES, ENDS, FORMS, OPTION_LIMITS, BlendOptions
from cqblend.errors import InputError, SizeError, UnsupportedError


def checked(radius=None, **options):
    return BlendOptions(radius, **options).to_request()


def test_defaults():
    request = checked(2)
    assert (request.radius, request.width) == (2.0, None)
    assert request.continuity == ("G1", "G1")
    assert request.tangents == ("perpendicular", "perpendicular")
    assert (request.section, request.form) == ("hermite", "auto")
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
        {"radius": lambda t: 1 + t},
        {"width": lambda t: 1 + t},
        {"width": (1, lambda t: 1 + t)},
        *({"radius": 1, "tangents": name} for name in ("guide", "combination", ("chord", "guide"))),
    ],
)
def test_what_is_not_built_yet_raises(options):
    with pytest.raises(UnsupportedError, match="not built yet"):
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


# one record for the function, the method and the command line


def keywords(function):
    """Return the keyword arguments of a function that are options of a blend, with their defaults."""
    given = inspect.signature(function).parameters.values()
    return {one.name: one.default for one in given if one.name not in ("self", "shape", "edges", "report")}


RECORD = {option.name: getattr(BLEND_DEFAULTS, option.name) for option in fields(BlendOptions)}
NOT_IN_THE_COMMAND = {"tangents", "bulge", "parameters", "terms", "tolerance", "angular_tolerance", "first"}


@pytest.mark.parametrize("function", [cqblend.blend_edges, cadquery_plugin.blend])
def test_functions_have_the_options_of_the_record_in_its_order_with_its_defaults_and_types(function):
    assert list(keywords(function).items()) == list(RECORD.items())
    positional = [one.name for one in inspect.signature(function).parameters.values() if one.kind is one.KEYWORD_ONLY]
    assert positional[: len(RECORD) - 1] == list(RECORD)[1:]
    given = {name: kind for name, kind in function.__annotations__.items() if name in RECORD}
    assert given == {name: kind for name, kind in BlendOptions.__annotations__.items() if name in RECORD}


def test_the_command_line_has_options_of_the_record_with_its_defaults_and_choices():
    (commands,) = (action.choices for action in cli._build_parser()._actions if isinstance(action.choices, dict))
    known = {action.dest: action for action in commands["blend"]._actions if action.dest in RECORD}
    implied = {"section", "a", "b", "lam"}  # by --potential and --order
    assert [name for name in RECORD if name not in NOT_IN_THE_COMMAND | implied] == [
        name for name in RECORD if name in known
    ]
    assert {name: action.default for name, action in known.items()} == {name: RECORD[name] for name in known}
    choices = {name: action.choices for name, action in known.items() if action.choices}
    assert choices == {"continuity": CONTINUITIES, "ends": ENDS, "form": FORMS}


@pytest.mark.parametrize("function", [cqblend.blend_edges, cadquery_plugin.blend])
def test_every_option_is_documented_with_its_default_in_help(function):
    text = function.__doc__
    assert inspect.getdoc(BlendOptions).partition("----------")[2].strip() in text
    assert "... :" not in text
    headers = [line for line in text.splitlines() if re.match(r"[a-z_, ]+ : ", line)]
    documented = {name: line for line in headers for name in line.partition(" : ")[0].split(", ")}
    assert [name for name in documented if name in RECORD] == list(RECORD)
    for name, default in RECORD.items():
        number = isinstance(default, float) and name not in ("bulge",)
        text = f"{default:.3g}" if number else f'"{default}"' if isinstance(default, str) else str(default)
        assert documented[name].endswith("optional" if default is None else f"default {text}"), documented[name]


def test_options_of_one_section_are_said_to_be_so():
    """The record itself says which section an option belongs to, and its documentation says the same."""
    paragraphs = re.split(r"\n(?=[a-z_, ]+ : )", inspect.getdoc(BlendOptions))
    for option in fields(BlendOptions):
        (text,) = (one for one in paragraphs if re.match(rf"([a-z_]+, )*{option.name}\b.* : ", one.partition("\n")[0]))
        section = option.metadata.get("section")
        assert (f"Of the {section} section" in text) == (section is not None), option.name
