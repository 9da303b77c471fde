"""A thousand malformed calls: each raises the right one of our own errors, none crashes, and no input is changed.

The calls are drawn with a fixed seed from what callers get wrong: the size, an option, the shape, or the edges; through
`blend_edges` with CadQuery or plain OCP shapes, and through `Workplane.blend`.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from io import BytesIO
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

import cqblend
from cqblend.errors import CqblendError, InputError, SelectionError, SizeError, TopologyError, UnsupportedError

SEED = 20240607
CALLS = 1000


# Bodies. Each is built once; that no call changes it is part of what is tested.


def in_compound(shape: cq.Shape) -> cq.Shape:
    """Put a shape into a compound once, as findSolid does: OCCT notes in the shape that it is part of one."""
    cq.Compound.makeCompound([shape])
    return shape


@cache
def body(name: str) -> cq.Shape:
    make = {
        "box": lambda: cq.Solid.makeBox(30, 20, 10),
        "other box": lambda: cq.Solid.makeBox(30, 20, 10),
        "cylinder": lambda: cq.Solid.makeCylinder(8, 20),
        "sphere": lambda: cq.Solid.makeSphere(9, angleDegrees1=-90, angleDegrees2=90),
        "cone": lambda: cq.Solid.makeCone(8, 0, 12),
        "torus": lambda: cq.Solid.makeTorus(10, 3),
        "rounded box": lambda: body("box").fillet(3, body("box").edges("|Z and >X").Edges()),
        "spline prism": lambda: cq.Workplane().spline([(9, 0), (0, 6), (-9, 0), (0, -6)]).close().extrude(8).val(),
        "open box": lambda: cq.Shell.makeShell(body("box").Faces()[1:]),
        "two boxes": lambda: cq.Compound.makeCompound(
            [cq.Solid.makeBox(3, 3, 3), cq.Solid.makeBox(2, 2, 2, (9, 0, 0))]
        ),
    }[name]
    return in_compound(make())


def is_seam(shape: cq.Shape, edge: cq.Edge) -> bool:
    return any(BRep_Tool.IsClosed_s(edge.wrapped, face.wrapped) for face in shape.Faces())


@cache
def edges(name: str, kind: str) -> list[cq.Edge]:
    """Edges of a body: "sharp", "smooth", "seam" or "degenerate"."""
    shape = body(name)
    index = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape.wrapped, TopAbs_EDGE, index)
    found: dict[str, list[cq.Edge]] = {"sharp": [], "smooth": [], "seam": [], "degenerate": []}
    for edge in (cq.Edge(TopoDS.Edge_s(index.FindKey(i))) for i in range(1, index.Extent() + 1)):
        if BRep_Tool.Degenerated_s(edge.wrapped):
            found["degenerate"].append(edge)
        elif is_seam(shape, edge):
            found["seam"].append(edge)
        else:
            found["smooth" if cqblend.continuity(shape, edge).angle < 1e-3 else "sharp"].append(edge)
    assert found[kind], f"{name} has no {kind} edge"
    return found[kind]


def content(shape: cq.Shape) -> bytes:
    stream = BytesIO()
    BinTools.Write_s(shape.wrapped, stream)
    return stream.getvalue()


# Calls.


@dataclass(frozen=True)
class Call:
    """A call that must fail: what to pass, to which front door, and with which errors it may be refused."""

    what: str
    door: str
    shape: Callable[[], Any]
    edges: Callable[[], Any]
    options: dict[str, Any]
    errors: tuple[type[CqblendError], ...]

    def __call__(self) -> None:
        shape, picked = self.shape(), self.edges()
        if self.door == "Workplane":
            cq.Workplane(obj=shape).newObject(picked).blend(**self.options)
        elif self.door == "TopoDS":
            cqblend.blend_edges(shape.wrapped, [edge.wrapped for edge in picked], **self.options)
        else:
            cqblend.blend_edges(shape, picked, **self.options)


DOORS = ("cadquery", "TopoDS", "Workplane")
SHARP = ("box", "cylinder", "cone", "rounded box", "spline prism")


def no_number(draw: random.Random) -> Any:
    return draw.choice(
        ["2", "", "wide", b"2", True, False, 2j, [], [1], {}, object(), Decimal(2), np.ones(1), np.True_]
    )


def out_of_range(draw: random.Random) -> float:
    return draw.choice(
        [0, 0.0, -0.0, -1, -1e-9, -1e300, -math.inf, math.inf, math.nan, 10**400, 1e10, 1e300, np.float64(np.nan)]
    )


def too_small(draw: random.Random) -> float:
    return draw.choice([5e-324, 1e-300, 1e-12, 1e-7, 9.99e-7, 10 ** draw.uniform(-300, -6.01)])


def too_large(draw: random.Random) -> float:
    return draw.choice([math.pi * 100, 1e4, 1e9, 10 ** draw.uniform(2.5, 9)])


def sizes(value: Any, draw: random.Random) -> dict[str, Any]:
    """Put a bad size where a size is expected."""
    good = draw.uniform(0.5, 1.5)
    return draw.choice([{"radius": value}, {"width": value}, {"width": (value, good)}, {"width": (good, value)}])


def with_size(bad: Callable[[random.Random], Any], *errors: type[CqblendError]) -> Callable[[random.Random], Call]:
    def make(draw: random.Random) -> Call:
        name, value = draw.choice(SHARP), bad(draw)
        options = sizes(value, draw)
        if isinstance(value, list) and "width" in options:  # of a list, each item is a size
            options = {"radius": value}
        return Call(f"size {value!r:.20}", draw.choice(DOORS), *sharp(name, draw), options, errors)

    return make


def sharp(name: str, draw: random.Random) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return a body and one of its sharp edges, to be built when called."""
    share = draw.random()
    return lambda: body(name), lambda: [edges(name, "sharp")[int(share * len(edges(name, "sharp")))]]


def bad_law(draw: random.Random) -> Callable[..., Any]:
    """A size that varies, but as no size can: by its values, by what it returns, or by its arguments."""
    return draw.choice(
        [
            lambda t: -1 - t,
            lambda t: t - 0.5,
            lambda t: (t - 0.5) ** 2,
            lambda t: 0 * t,
            lambda t: 1 + np.heaviside(t - 0.3, 1.0),
            lambda t: 1 + np.abs(t - 0.4),
            lambda t: 1 / (t - 0.5) ** 2,
            lambda t: np.full_like(t, math.nan),
            lambda t: math.inf,
            lambda t: 1e10 * (1 + t),
            lambda t: "1",
            lambda t: None,
            lambda t: 1 + 1j * t,
            lambda t: [1, 2, 3],
            lambda t: {}["t"],
            lambda: 1.0,
            lambda t, u: t + u,
            cqblend.linear,
        ]
    )


def too_small_law(draw: random.Random) -> Callable[..., Any]:
    return draw.choice([lambda t: 1e-7 * (1 + t), lambda t: 0 * t + 1e-9, cqblend.linear(1e-8, 1.0)])


def open_law(draw: random.Random) -> Call:
    """A size that differs at both ends, on an edge that is closed."""
    law = draw.choice([lambda t: 1 + t, cqblend.linear(2, 1), cqblend.table([(0, 1), (0.5, 2), (1, 1.5)])])
    return Call("open law", draw.choice(DOORS), *sharp("cylinder", draw), sizes(law, draw), (InputError,))


def bad_mapping(draw: random.Random) -> Call:
    """Sizes of single edges that are not those of the picked edge, or no sizes."""
    name = draw.choice(("box", "rounded box", "spline prism"))
    shape, picked = sharp(name, draw)
    own, other = picked()[0], body("other box").Edges()[0]
    unpicked = next(edge for edge in edges(name, "sharp") if not edge.isSame(own))
    sized = draw.choice(
        [
            {},
            {"edge": 1.0},
            {None: 1.0},
            {body(name).Faces()[0]: 1.0},
            {other: 1.0},
            {unpicked: 1.0},
            {own: 1.0, unpicked: 1.0},
            {own: draw.choice(["2", None, True, {}, 2j, object()])},
            {own: out_of_range(draw)},
            {own: bad_law(draw)},
            {own: {own: 1.0}},
        ]
    )
    options: dict[str, Any] = {draw.choice(["radius", "width"]): sized}
    if draw.random() < 0.3:
        options["taper"] = draw.choice([1.0, 0, -1, math.nan, "1"])
    return Call(f"mapping {sized!r:.20}", draw.choice(DOORS), shape, picked, options, (InputError,))


def bad_hold(draw: random.Random) -> Call:
    """What is held is no edge, no edge that lies across a face beside the blended one, or cannot be held as asked."""
    shape, picked = sharp("box", draw)
    own = picked()[0]
    beside = [face for face in body("box").Faces() if any(edge.isSame(own) for edge in face.Edges())]
    parallel = [
        edge
        for face in beside
        for edge in face.Edges()
        if not any(v.isSame(w) for v in edge.Vertices() for w in own.Vertices())
    ]
    away = [edge for edge in body("box").Edges() if not any(edge.isSame(e) for face in beside for e in face.Edges())]
    hold, options = draw.choice(
        [
            (draw.choice([3, "x", object(), [], [None], body("box"), beside[0], cq.Workplane()]), {}),
            (body("other box").Edges()[0], {}),
            (own, {}),
            (away[0], {}),
            (parallel, {}),
            (parallel[0], {"width": 1, "radius": None}),
            (parallel[0], {"radius": lambda t: 1 + t}),
            (parallel[0], {"radius": {own: 30.0}}),
            (parallel[0], {"continuity": ("G1", "G1")}),
            (parallel[0], {"tangents": "chord"}),
            (parallel[0], {"ends": "flat"}),
            (parallel[0], {"section": "pde"}),
        ]
    )
    return Call(
        f"hold {hold!r:.20}",
        draw.choice(DOORS),
        shape,
        picked,
        {"radius": 30.0, "hold": hold, **options},
        (InputError, SelectionError),
    )


def both_or_neither(draw: random.Random) -> Call:
    options = draw.choice([{}, {"radius": 1, "width": 1}, {"radius": 1.5, "width": (1, 2)}, {"radius": None}])
    return Call("both or neither", draw.choice(DOORS), *sharp(draw.choice(SHARP), draw), options, (InputError,))


def bad_option(draw: random.Random) -> Call:
    number = draw.choice(["bulge", "tolerance", "angular_tolerance"])
    name, value, error = draw.choice(
        [
            (number, no_number(draw), InputError),
            (number, draw.choice([0, -1, math.nan, math.inf, -math.inf, 10**400]), InputError),
            (
                "continuity",
                draw.choice(["G4", "g1", "", 1, 1.0, (), ("G1",) * 3 + ("x",), b"G1", object()]),
                InputError,
            ),
            ("steer", draw.choice([-0.1, math.nan, math.inf, "20", None, (0.1, 0.1)]), InputError),
            ("crease", draw.choice([-0.1, math.nan, math.inf, "20", 1.6, (0.1, 0.1)]), InputError),
            ("tangents", draw.choice(["T2", "", None, 2, (), object()]), InputError),
            ("tangents", draw.choice(["guide", "combination", ("guide", "chord")]), UnsupportedError),
            ("section", draw.choice(["cubic", None, 3, ["spline"]]), InputError),
            ("section", "potential", InputError),
            (draw.choice(["a", "b", "lam"]), draw.choice([1, 2.0, 0]), InputError),
            ("order", draw.choice([2, 4, (4, 4, 6), 3]), InputError),
            ("bulge", draw.choice([5e-324, 1e-200, 1e9, 1e300, (1, 1e-20)]), InputError),
            ("taper", draw.choice([1.0, 0, -1, "1"]), InputError),
            ("chain", draw.choice([None, 0, 1, "True", [], np.ones(2)]), InputError),
            ("ends", draw.choice(["round", "", None, 1, (), ("flat",) * 3, ("flat", "Natural")]), InputError),
            ("on_error", draw.choice(["ignore", "", None, True, ("skip", "raise")]), InputError),
            ("form", draw.choice(["Exact", "", None, 7, ("auto", "exact")]), InputError),
            ("first", draw.choice(["left", 1, [], True, object()]), InputError),
        ]
    )
    options = {"radius": 1, name: value}
    return Call(f"{name} {value!r:.20}", draw.choice(DOORS), *sharp(draw.choice(SHARP), draw), options, (error,))


def bad_first(draw: random.Random) -> Call:
    """A face that is not one of the two at the edge, or none at all."""
    shape, picked = sharp("box", draw)
    other = draw.choice(
        [
            lambda: body("other box").Faces()[0],
            lambda: next(f for f in body("box").Faces() if not any(e.isSame(picked()[0]) for e in f.Edges())),
            lambda: body("box").Edges()[0],
            lambda: body("box"),
        ]
    )()
    return Call("first", draw.choice(DOORS), shape, picked, {"radius": 1, "first": other}, (SelectionError, InputError))


def bad_shape(draw: random.Random) -> Call:
    _, picked = sharp("box", draw)
    shape = draw.choice(
        [
            None,
            3,
            math.nan,
            "box",
            b"",
            [],
            {},
            object(),
            cq,
            cq.Solid,
            cq.Workplane(),
            cq.Workplane().rect(1, 2),
            cq.Vector(1, 2, 3),
            TopoDS_Shape(),
            TopoDS_Compound(),
        ]
    )
    return Call(f"shape {shape!r:.20}", "cadquery", lambda: shape, picked, {"radius": 1}, (InputError,))


def not_solid(draw: random.Random) -> Call:
    """Edges of a shape that has them, but of fewer than two faces, or of two that are oriented against each other."""
    part = draw.choice(
        [
            lambda: body("box").Faces()[0],
            lambda: body("box").Wires()[0],
            lambda: body("box").Edges()[0],
            lambda: cq.Compound.makeCompound(body("open box").Faces()[:1]),
            lambda: cq.Compound.makeCompound(
                [cq.Face(f.wrapped.Oriented(TopAbs_FORWARD)) for f in body("box").Faces()]
            ),
        ]
    )
    share = draw.random()
    return Call(
        "no solid",
        draw.choice(("cadquery", "TopoDS")),
        part,
        lambda: [part().Edges()[int(share * len(part().Edges()))]],
        {"radius": 1},
        (SelectionError, TopologyError),
    )


def bad_edges(draw: random.Random) -> Call:
    shape, picked = sharp("box", draw)
    wrong = draw.choice(
        [
            lambda: None,
            lambda: 7,
            lambda: math.inf,
            lambda: "|Z",
            lambda: b"",
            list,
            tuple,
            lambda: [[], ()],
            dict,
            lambda: object(),
            lambda: [None],
            lambda: [*picked(), None],
            lambda: [*picked(), 3],
            lambda: iter(()),
            lambda: body("box"),
            lambda: body("box").Faces(),
            lambda: body("box").Faces()[0],
            lambda: body("box").Wires()[0],
            lambda: body("box").Vertices(),
            lambda: [*picked(), body("box").Faces()[0]],
            lambda: cq.Workplane(),
            lambda: cq.Workplane(obj=body("box")).faces(),
            lambda: [cq.Vector(1, 2, 3)],
            TopoDS_Edge,
            lambda: TopoDS_Shape(),
            lambda: cq.Compound.makeCompound([]),
            lambda: cq.Compound.makeCompound(body("box").Faces()),
        ]
    )
    return Call("edges", "cadquery", shape, wrong, {"radius": 1}, (InputError,))


def wrong_kind_of_edge(draw: random.Random) -> Call:
    kind, name = draw.choice(
        [
            ("seam", "cylinder"),
            ("seam", "sphere"),
            ("seam", "cone"),
            ("seam", "torus"),
            ("degenerate", "sphere"),
            ("degenerate", "cone"),
            ("smooth", "rounded box"),
        ]
    )
    share = draw.random()

    def picked() -> list[cq.Edge]:  # together with another edge, such a one is passed over
        wrong = edges(name, kind)
        return [wrong[int(share * len(wrong))]]

    options = sizes(draw.uniform(0.1, 2), draw)
    return Call(f"{kind} edge", draw.choice(DOORS), lambda: body(name), picked, options, (SelectionError,))


def foreign_edge(draw: random.Random) -> Call:
    """An edge of another shape, or a copy: in the same place, but not the same edge."""
    name = draw.choice(["box", "two boxes", "cylinder"])
    _, own = sharp("box" if name == "two boxes" else name, draw)
    share = draw.random()

    def foreign() -> list[cq.Edge]:
        return draw_from([*body("other box").Edges(), own()[0].copy(), own()[0].moved(cq.Location((0, 0, 5)))], share)

    return Call("foreign edge", draw.choice(DOORS), lambda: body(name), foreign, sizes(1.0, draw), (SelectionError,))


def draw_from(things: list[Any], share: float) -> list[Any]:
    return [things[int(share * len(things))]]


KINDS = (
    (with_size(no_number, InputError), 15),
    (with_size(out_of_range, InputError), 15),
    (with_size(too_small, SizeError), 10),
    (with_size(too_large, SizeError, InputError), 6),
    (with_size(bad_law, InputError), 6),
    (with_size(too_small_law, SizeError), 2),
    (open_law, 3),
    (bad_mapping, 6),
    (bad_hold, 6),
    (both_or_neither, 6),
    (bad_option, 15),
    (bad_first, 3),
    (bad_shape, 6),
    (not_solid, 5),
    (bad_edges, 8),
    (wrong_kind_of_edge, 12),
    (foreign_edge, 8),
)


def drawn(number: int) -> Call:
    draw = random.Random(SEED + number)
    (make,) = draw.choices([kind for kind, _ in KINDS], [weight for _, weight in KINDS])
    return make(draw)


@pytest.mark.parametrize("number", range(CALLS))
def test_malformed_call(number: int) -> None:
    call = drawn(number)
    bodies = [shape for shape in (call.shape(),) if isinstance(shape, cq.Shape) and shape.wrapped is not None]
    before = [content(shape) for shape in bodies]
    with pytest.raises(call.errors) as caught:
        call()
    message = str(caught.value)
    assert len(message) > 10, call.what
    assert "\n" not in message, call.what
    assert [content(shape) for shape in bodies] == before, call.what


def test_the_same_bodies_are_blended_when_called_well() -> None:
    """Otherwise the calls above could be refused for a reason that has nothing to do with what is wrong in them."""
    for name in SHARP:
        result = cqblend.blend_edges(body(name), edges(name, "sharp")[-1], 0.3)
        assert result.shape.isValid(), name
