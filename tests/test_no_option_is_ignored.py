"""An option that has no effect in a combination is refused, and the message names it; without it the call is right."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import cadquery as cq
import numpy as np
import pytest

import cqblend
from cqblend import Boundary, Conic, Curve, Guide, Rail, Surface
from cqblend.errors import InputError

LINE = Curve.bezier([[0.2, 0.5], [0.8, 0.5]])


def sheet(shift: float = 0.0, lift: float = 0.0) -> Surface:
    poles = np.array([[[0, 0, 0], [0, 4, 0]], [[4, 0, 0], [4, 4, 0]]], dtype=float)
    return Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), poles + np.array([0, shift, lift]))


RAILS = Rail(sheet(), LINE, "right"), Rail(sheet(-6.0, 3.0), LINE, "left")
GUIDE = Curve.bezier([[0.0, -1.0, 0.0]] * 2)
RINGS = [Boundary((np.cos, np.sin, z), (0.0, 0.0, 3.0)) for z in (0.0, 2.0)]


@cache
def box() -> cq.Shape:
    return cq.Solid.makeBox(3, 2, 1)


@cache
def walls() -> tuple[cqblend.Family, cqblend.Family]:
    floor = [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]]
    wall = [[[0, 0, 0], [0, 0, 9]], [[0, 9, 0], [0, 9, 9]]]
    first, second = (Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), one) for one in (floor, wall))
    return cqblend.reshape(first, by="normal"), cqblend.reshape(second, by="normal")


@cache
def saddle() -> Surface:
    """A hyperbolic paraboloid: its strips twist, and have no pairing of rulings that is developable."""
    return Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), [[[0, 0, 0], [0, 9, 1]], [[9, 0, 1], [9, 9, 0]]])


@cache
def plate() -> cqblend.Pattern:
    return cqblend.unroll(box(), 0.1)


def blend(**options: Any) -> Any:
    return cqblend.blend_edges(box(), box().edges("|Z and >X and >Y"), **options)


def exported(tmp_path: Any, name: str, **options: Any) -> Any:
    return plate().export(tmp_path / name, **options)


def potential(**options: Any) -> Any:
    return cqblend.potential_blend(*walls(), Conic(2, 2), **options)


hermite = partial(cqblend.hermite_blend, *RAILS)
pde = partial(cqblend.pde_blend, *RINGS, modes=1, terms=2)
along_rails = partial(cqblend.pde_blend, *RAILS, modes=4, terms=2)
unroll = partial(cqblend.unroll, sheet(), 0.1)

CASES: list[tuple[Callable[..., Any], dict[str, Any], dict[str, Any]]] = [
    # what is called, with what, and the options that have no effect beside that
    *((pde, {}, {name: value}) for name, value in (
        ("tangents", "chord"), ("tangents", "nonsense"), ("tangents", Guide(GUIDE)), ("bulge", 2), ("bulge", "x"),
        ("length", 1.0), ("length", "field"), ("steer", 0), ("steer", -5),
    )),
    *((along_rails, {"order": 2}, {name: value}) for name, value in (
        ("bulge", 2.0), ("steer", 0.0)
    )),
    *((hermite, {"continuity": "G0"}, {name: value}) for name, value in (
        ("tangents", "chord"), ("bulge", 2.0), ("bulge", (1.0, 2.0)), ("length", 1.0), ("steer", 0.0)
    )),
    (hermite, {"form": "exact"}, {"tolerance": 1e-3}),
    *((cqblend.reshape, {"surface": sheet(), "reference": reference}, {"tuning": (1, 2, 3)}) for reference in (
        (2.0, 2.0, -2.0), lambda s: np.array([2.0, 2.0, -2.0]),
    )),
    (cqblend.reshape, {"surface": sheet(), "reference": (2.0, 2.0, -2.0)}, {"tolerance": 1e-3}),
    (cqblend.reshape, {"surface": sheet(), "by": "normal"}, {"tuning": (1, 2, 3)}),
    (cqblend.reshape, {"surface": sheet(), "by": "normal"}, {"reference": (0.0, 0.0, 1.0)}),
    (cqblend.reshape, {"surface": sheet(), "by": "normal"}, {"reference": "extents"}),
    (potential, {"form": "exact", "skin": 1e-2}, {"tolerance": 1e-3}),
    *((unroll, {"method": "elber"}, {name: value}) for name, value in (
        ("even", True), ("developable", True), ("strain", 0.5)
    )),
    (unroll, {"layout": "triangles"}, {"developable": True}),
    (partial(cqblend.unroll, saddle(), 0.5), {}, {"developable": True}),
    (plate, {}, {}),
    *((blend, {"radius": 0.2, "continuity": "G0"}, {name: value}) for name, value in (
        ("tangents", "chord"), ("bulge", 2.0), ("steer", 0.0)
    )),
    (blend, {"radius": 0.2, "section": "pde", "order": 2}, {"bulge": 2.0}),
    *((blend, {"radius": 0.2}, {name: value}) for name, value in (
        ("taper", 1.0), ("a", 1.0), ("b", 1.0), ("lam", 0), ("order", 4), ("parameters", 1.0), ("terms", 3)
    )),
    *((blend, {"section": "potential", "a": 0.3}, {name: value}) for name, value in (
        ("radius", 1.0), ("width", 1.0), ("taper", 1.0), ("tangents", "chord"), ("bulge", 2.0), ("steer", 0.0),
        ("order", 4),
    )),
]  # fmt: skip
CASES = [case for case in CASES if case[2]]


def named(case: tuple[Callable[..., Any], dict[str, Any], dict[str, Any]]) -> str:
    return f"{getattr(case[0], 'func', case[0]).__name__}, {', '.join(case[1])}, {', '.join(case[2])}"


@pytest.mark.parametrize("case", CASES, ids=named)
def test_an_option_without_effect_is_refused(case: tuple[Callable[..., Any], dict[str, Any], dict[str, Any]]) -> None:
    call, options, without = case
    (name,) = without
    with pytest.raises(InputError, match=rf"\b{name}\b"):
        call(**options, **without)


@pytest.mark.parametrize(
    ("call", "options"),
    list({named((call, options, {})): (call, options) for call, options, _ in CASES}.values()),
)
def test_without_it_the_call_is_right(call: Callable[..., Any], options: dict[str, Any]) -> None:
    call(**options)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("p.dxf", {"page": "a3"}),
        ("p.svg", {"page": None}),
        ("p.json", {"labels": None}),
        ("p.json", {"fit": 0.0}),
        ("p.pdf", {"seconds": 5.0}),
    ],
)
def test_options_of_export_without_effect_are_refused(name: str, options: dict[str, Any], tmp_path: Any) -> None:
    (option,) = options
    with pytest.raises(InputError, match=rf"\b{option}\b"):
        exported(tmp_path, name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [{"taper": 1.0}, {"pitch": 2.0}])
def test_an_allowance_has_no_teeth(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        plate().with_tabs(0.2, style="allowance", **options)
    assert plate().with_tabs(0.2, style="allowance").faces(tabs=True)


def test_there_are_no_tabs_in_faces_of_a_pattern_without() -> None:
    with pytest.raises(InputError, match="tabs"):
        plate().faces(tabs=True)


def test_a_second_curve_of_a_guide_needs_two_sides() -> None:
    own = Guide(GUIDE, -GUIDE)
    with pytest.raises(InputError, match="second curve of a Guide"):
        hermite(tangents=(own, "perpendicular"))
    hermite(tangents=(Guide(GUIDE), "perpendicular"))
    hermite(tangents=own)


def test_what_is_developable_by_nature_needs_no_pairing() -> None:
    pattern = cqblend.unroll(cq.Solid.makeCylinder(2, 3), 0.1, developable=True)
    assert max(record.twist for record in pattern.report.pieces) == 0


def test_a_rectangle_of_points_is_too_much() -> None:
    ends = [Boundary(Curve.bezier([[0.0, 0.0, z], [2.0, 0.0, z]])) for z in (0.0, 1.0)]
    with pytest.raises(InputError, match=r"would take .* GB: give fewer points"):
        cqblend.pde_blend(*ends, order=2, points=(500, 500), terms=30, modes=30)


def test_a_side_that_the_direction_contradicts_is_refused() -> None:
    wrong = Rail(sheet(), LINE, "left")  # the other rail lies to its right
    with pytest.raises(InputError, match=r'side="left" of rail 1 has no effect: the chord points to its right'):
        cqblend.hermite_blend(wrong, RAILS[1], tangents="chord")
    with pytest.raises(InputError, match=r"the guide points to its right"):
        cqblend.hermite_blend(wrong, RAILS[1], tangents=Guide(GUIDE))
    hermite(tangents="chord")
    cqblend.hermite_blend(Rail(sheet(), LINE), RAILS[1], tangents="chord")
