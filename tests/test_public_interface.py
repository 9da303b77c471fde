"""Every public callable with every kind of nonsense for every parameter: only errors of cqblend leave.

What is public is read off by introspection: functions and classes of ``cqblend.__all__``, the public methods and
operators of these classes, the fluent methods, and the options of the command line. `ARGUMENTS` says how each is called
well, with tiny shapes. A callable or a parameter that is not in it fails a test: who adds one, adds it here.
"""

import inspect
import math
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from OCP.TopoDS import TopoDS_Shape

import cqblend
from cqblend import Boundary, Combination, Conic, Curve, Guide, Rail, Surface
from cqblend import __main__ as cli
from cqblend.blend_options import BLEND_DEFAULTS
from cqblend.brep.step_files import write_step
from cqblend.errors import CqblendError, InputError

OPERATORS = (
    "__call__", "__getitem__", "__neg__", "__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__",
    "__truediv__", "__rtruediv__", "__pow__", "__matmul__", "__contains__", "__iter__", "__len__",
)  # fmt: skip


FOLDER = TemporaryDirectory()


class Boom(Exception):
    """What callables and objects of these tests raise."""


def boom(*args: Any, **options: Any) -> Any:
    raise Boom("boom")


class Explosive:
    """Whatever is asked of it, it raises."""

    __getattr__ = __array__ = __float__ = __int__ = __index__ = __len__ = __iter__ = __getitem__ = __call__ = boom
    __eq__ = __lt__ = __gt__ = __le__ = __ge__ = __bool__ = __contains__ = __fspath__ = __neg__ = __add__ = boom
    __radd__ = __mul__ = __rmul__ = __sub__ = __rsub__ = __repr__ = __str__ = __hash__ = boom


def nested() -> list[Any]:
    """Return a list that contains itself."""
    own: list[Any] = []
    own.append(own)
    return own


# what is called


@cache
def line() -> Curve:
    return Curve.bezier([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [3.0, 1.0, 0.0]])


@cache
def ahead() -> Curve:
    return line() + np.array([0.0, 0.0, 1.0])


@cache
def across() -> Curve:
    return Curve.bezier([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])


@cache
def bowl() -> Surface:
    x, y = np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], indexing="ij")
    return Surface.from_bspline((2, 2), ([0, 0, 0, 1, 1, 1],) * 2, np.stack([x, y, x * y * (2 - y)], -1))


@cache
def scalar() -> Curve:
    return Curve.bezier([[0.0], [1.0]])


@cache
def square() -> Curve:
    return Curve.bezier([[0.0], [0.0], [1.0]])


@cache
def plane_curve() -> Curve:
    return Curve.bezier([[0.2, 0.5], [0.8, 0.5]])


@cache
def sheet(shift: float = 0.0, lift: float = 0.0) -> Surface:
    low = [[[0, 0, 0], [0, 4, 0]], [[4, 0, 0], [4, 4, 0]]]
    poles = np.array(low, dtype=float) + np.array([0, shift, lift])
    return Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), poles)


@cache
def rail(second: bool = False) -> Rail:
    return Rail(sheet(-6.0, 3.0) if second else sheet(), plane_curve(), "left" if second else "right")


@cache
def boundary(second: bool = False) -> Boundary:
    height = 2.0 if second else 0.0
    return Boundary((np.cos, np.sin, height), (0.0, 0.0, 3.0))


@cache
def segment(z: float) -> Boundary:
    return Boundary(Curve.bezier([[0.0, 0.0, z], [2.0, 0.0, z]]), Curve.bezier([[0.0, 0.0, 1.0]] * 2))


def end(x: float) -> Boundary:
    return Boundary(
        Curve.bezier([[x, 0.0, 0.0], [x, 0.0, 1.0]]), Curve.bezier([[2.0, 0.0, 0.0]] * 2), domain=(0.0, 1.0)
    )


@cache
def box() -> cq.Shape:
    return cq.Solid.makeBox(3, 2, 1)


@cache
def corner() -> cq.Edge:
    return box().edges("|Z and >X and >Y").Edges()[0]


@cache
def pair_of_boxes() -> cq.Shape:
    return cq.Compound.makeCompound([box(), cq.Solid.makeBox(3, 2, 1, (0, 0, 4))])


def bridged_sides() -> dict[str, Any]:
    lower, upper = pair_of_boxes().Solids()
    return {"side1": lower.faces(">Z").Faces()[0], "side2": upper.faces("<Z").Faces()[0]}


@cache
def blended() -> cqblend.BlendResult:
    return cqblend.blend_edges(box(), corner(), 0.2)


@cache
def can() -> cq.Shape:
    return cq.Solid.makeCylinder(5, 10).toNURBS()


@cache
def families() -> tuple[cqblend.Family, cqblend.Family]:
    lid, wall = (cq.Workplane(can()).faces(one).val() for one in (">Z", "not(>Z or <Z)"))
    return cqblend.reshape(lid, by="normal", amounts=-1), cqblend.reshape(wall, by="normal", amounts=-1)


@cache
def walls() -> tuple[cqblend.Family, cqblend.Family]:
    floor = [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]]
    wall = [[[0, 0, 0], [0, 0, 9]], [[0, 9, 0], [0, 9, 9]]]
    first, second = (Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), one) for one in (floor, wall))
    return cqblend.reshape(first, by="normal"), cqblend.reshape(second, by="normal")


@cache
def hermite() -> cqblend.Blend:
    return cqblend.hermite_blend(rail(), rail(True))


@cache
def pde() -> cqblend.PdeBlend:
    return cqblend.pde_blend(boundary(), boundary(True), terms=2, modes=1)


@cache
def potential() -> cqblend.PotentialBlend:
    return cqblend.potential_blend(*families(), Conic(1, 2))


@cache
def pattern() -> cqblend.Pattern:
    return cqblend.unroll(cq.Face.makePlane(2, 1), 0.1)


def fields(record: Any) -> dict[str, Any]:
    """Return the arguments from which a record was made."""
    return {name: getattr(record, name) for name in inspect.signature(type(record)).parameters}


@cache
def skipping() -> cqblend.BlendResult:
    can = cq.Solid.makeCylinder(1, 2)
    return cqblend.blend_edges(can, [edge for edge in can.Edges() if edge.Center().z > 0.5], 0.2)


def plane_function() -> dict[str, Any]:
    return {"function": lambda x, y, z: y - 0.5, "gradient": lambda x, y, z: np.stack([0 * x, 1 + 0 * y, 0 * z])}


SELVES: dict[str, Callable[[], Any]] = {
    "BezierRelation": lambda: cqblend.BezierRelation([(1, 0), (0, 0), (0, 1)]),
    "Blend": hermite,
    "BlendResult": blended,
    "Boundary": boundary,
    "Certificate": lambda: blended().certificate,
    "Combination": lambda: Combination(plane_curve()),
    "Conic": lambda: Conic(1, 1),
    "Continuity": lambda: cqblend.continuity(box(), corner()),
    "Curve": line,
    "Family": lambda: families()[0],
    "Guide": lambda: Guide(line()),
    "ImplicitSurface": lambda: cqblend.ImplicitSurface(**plane_function()),
    "Normalised": lambda: cqblend.normalise(ahead(), 1e-3),
    "Pattern": pattern,
    "PdeBlend": pde,
    "PotentialBlend": potential,
    "Rail": rail,
    "EdgeRecord": lambda: blended().certificate.edges[0],
    "EndRecord": lambda: blended().certificate.ends[0],
    "RailRecord": lambda: blended().certificate.rails[0],
    "SkippedEdges": lambda: skipping().skipped[0],
    "Relation": lambda: cqblend.Relation(Conic(1, 1).curve),
    "Surface": sheet,
    "Verification": lambda: cqblend.verify(box()),
}

RECORDS = (
    "Blend", "BlendResult", "Certificate", "Continuity", "EdgeRecord", "EndRecord", "Normalised", "Pattern",
    "PdeBlend", "PotentialBlend", "RailRecord", "SkippedEdges", "Verification",
)  # fmt: skip
"""Classes that only hold what a function of cqblend has found out; what somebody else puts into them is his."""

EDGE_OPTIONS = {
    "radius": 0.2,
    "width": None,
    "taper": None,
    "continuity": "G1",
    "tangents": "perpendicular",
    "bulge": 1.0,
    "steer": 0.1,
    "crease": None,
    "section": "hermite",
    "a": None,
    "b": None,
    "lam": None,
    "order": None,
    "parameters": None,
    "terms": "auto",
    "form": "auto",
    "tolerance": 1e-7,
    "angular_tolerance": 1e-5,
    "ends": "natural",
    "corner": "auto",
    "setback": None,
    "first": None,
    "on_error": "raise",
    "chain": True,
    "hold": None,
}

BRIDGE_OPTIONS = {
    "continuity": "G1",
    "bulge": 1.0,
    "tangents": "perpendicular",
    "section": "hermite",
    "start": None,
    "solid": True,
    "form": "auto",
    "tolerance": 1e-7,
    "angular_tolerance": 1e-5,
    "steer": BLEND_DEFAULTS.steer,
    "crease": None,
}
UNROLL_OPTIONS = {
    "tolerance": 0.1,
    "method": "longest",
    "direction": "auto",
    "layout": "smooth",
    "strain": 0.01,
    "developable": False,
    "even": False,
    "least_width": None,
    "flat_tolerance": 0.01,
    "progress": None,
}

SPLINE = {
    "__add__": {"other": 1.0},
    "__getitem__": {"index": 0},
    "__mul__": {"other": 2.0},
    "__neg__": {},
    "__radd__": {"other": 1.0},
    "__rmul__": {"other": 2.0},
    "__rsub__": {"other": 1.0},
    "__sub__": {"other": 1.0},
    "__truediv__": {"other": 2.0},
    "bounds": {},
    "to_bspline": {},
}

RELATION = {"__call__": {"x": 0.5}, "first": {"s2": 0.0}, "second": {"s1": 0.0}}

ARGUMENTS: dict[str, Callable[[], dict[str, Any]]] = {
    "BezierRelation": lambda: {"points": [(1, 0), (0, 0), (0, 1)]},
    "Blend.face": dict,
    "Boundary": lambda: {
        "position": (0.0, 1.0, scalar()),
        "first": (0, 0, 1),
        "second": (1, 0, 0),
        "domain": (0.0, 1.0),
    },
    "Boundary.rail": lambda: {"side": 1},
    "Boundary.ribbon": lambda: {"order": 1, "side": 0, "other": boundary(True)},
    "Certificate.merge": lambda: {"certificates": [blended().certificate]},
    "Combination": lambda: {"first": plane_curve(), "second": None},
    "Combination.operands": lambda: {"side": 0},
    "ImplicitSurface": lambda: plane_function(),
    "Conic": lambda: {"a": 1.0, "b": 2.0, "lam": 0.0},
    "Curve": lambda: {"breaks": [0, 1], "coefs": np.ones((2, 3, 1)), "rational": False, "continuity": None},
    "Curve.__call__": lambda: {"t": 0.5, "k": 0, "side": "right"},
    "Curve.bezier": lambda: {"poles": [[0, 0], [1, 1]], "weights": [1, 2], "domain": (0, 1)},
    "Curve.clip": lambda: {"t0": 0.2, "t1": 0.7},
    "Curve.compose": lambda: {"parameter": scalar()},
    "Curve.cross": lambda: {"other": line()},
    "Curve.cut": lambda: {"breaks": [0.5]},
    "Curve.derivative": lambda: {"k": 1},
    "Curve.dot": lambda: {"other": line()},
    "Curve.elevate": lambda: {"amount": 1},
    "Curve.from_bspline": lambda: {"degree": 1, "knots": [0, 0, 1, 1], "poles": [[0, 0], [1, 1]], "weights": [1, 1]},
    "Curve.jet": lambda: {"t": 0.5, "order": 1, "side": "right"},
    "Curve.join": lambda: {"other": line().reparametrized(1, 2), "continuity": 0},
    "Curve.reduce": lambda: {"amount": 0, "tolerance": 1e-12},
    "Curve.reparametrized": lambda: {"t0": 0.0, "t1": 2.0},
    "Curve.reverse": dict,
    "Curve.stack": lambda: {"splines": [line(), line()]},
    "Family.__call__": lambda: {"s": 0.5, "tolerance": 1e-3},
    "Family.bounds": dict,
    "Family.size": dict,
    "Family.course": lambda: {"s": square(), "which": "1"},
    "Family.jet": lambda: {"uv": np.zeros((1, 2)), "state": families()[0].course(square(), "1")(np.array([0.5]))},
    "Family.kinks": lambda: {"axis": 0, "within": (0.0, 1.0)},
    "Guide": lambda: {"first": line(), "second": None},
    "Guide.operands": lambda: {"side": 0},
    "Pattern.cross_sections": dict,
    "Pattern.export": lambda: {
        "path": f"{FOLDER.name}/pattern.pdf",
        "sheet": None,
        "margin": 5.0,
        "gap": 3.0,
        "kerf": 0.0,
        "labels": 4.0,
        "fit": None,
        "page": None,
        "packer": "grid",
        "seconds": 30.0,
        "per_sheet": False,
    },
    "Pattern.faces": lambda: {"tabs": False},
    "Pattern.fold": lambda: {"strip": 0, "points": [[0.1, 0.1]]},
    "Pattern.strips_3d": dict,
    "Pattern.with_tabs": lambda: {"width": 0.2, "style": "one", "taper": 0.7, "pitch": None},
    "PotentialBlend.amounts": lambda: {"v": 0.5},
    "PotentialBlend.swept": lambda: {"t": 0.5, "v": 0.5},
    "Rail": lambda: {"surface": sheet(), "curve": plane_curve(), "side": None},
    "Rail.check_direction": lambda: {"rs": [[0.0, 1.0]], "t": [0.5]},
    "Rail.coordinates": lambda: {"name": "guide", "t": [0.5], "operands": (line(),)},
    "Rail.curve3d": dict,
    "Rail.field": lambda: {"name": "guide", "operands": (line(),)},
    "Rail.normal": dict,
    "Rail.reparametrized": lambda: {"t0": 0.0, "t1": 2.0},
    "Rail.reverse": dict,
    "Rail.symbolic_coordinates": lambda: {"name": "combination", "operands": (plane_curve(),)},
    "Rail.towards": lambda: {"target": (2.0, -9.0, 1.0)},
    "Relation": lambda: {"curve": Conic(1, 1).curve},
    "Surface": lambda: {
        "breaks": ([0, 1], [0, 1]),
        "coefs": np.ones((2, 2, 3, 1, 1)),
        "rational": False,
        "continuity": (None, None),
    },
    "Surface.__call__": lambda: {"u": 0.5, "v": 0.5, "ku": 0, "kv": 0, "side": "right"},
    "Surface.clip": lambda: {"u": (0.2, 0.7), "v": None},
    "Surface.compose": lambda: {"curve": plane_curve()},
    "Surface.cross": lambda: {"other": sheet()},
    "Surface.crossings": lambda: {"curve": plane_curve(), "axis": None},
    "Surface.cut": lambda: {"u": [0.5], "v": ()},
    "Surface.derivative": lambda: {"ku": 1, "kv": 0},
    "Surface.dot": lambda: {"other": sheet()},
    "Surface.elevate": lambda: {"amount_u": 1, "amount_v": 0},
    "Surface.from_bspline": lambda: {
        "degrees": (1, 1),
        "knots": ([0, 0, 1, 1], [0, 0, 1, 1]),
        "poles": np.ones((2, 2, 3)),
        "weights": np.ones((2, 2)),
    },
    "Surface.from_rows": lambda: {"rows": [line(), line()], "domain": (0, 1)},
    "Surface.grid": lambda: {"u": [0.5], "v": [0.5], "ku": 0, "kv": 0},
    "Surface.isoparametric": lambda: {"u": 0.5, "v": None},
    "Surface.jet": lambda: {"u": 0.5, "v": 0.5, "order": 1, "side": "right"},
    "Surface.reduce": lambda: {"amount_u": 0, "amount_v": 0, "tolerance": 1e-12},
    "Surface.reverse": lambda: {"axis": 0},
    "Surface.stack": lambda: {"splines": [sheet(), sheet()]},
    "Surface.tiled": lambda: {"axis": 0, "before": 0, "after": 1, "continuity": -1},
    "Surface.transpose": dict,
    "Workplane.blend": lambda: {**EDGE_OPTIONS, "report": None},
    "Workplane.bridge": lambda: {**bridged_sides(), **BRIDGE_OPTIONS, "report": None},
    "Workplane.unroll": lambda: {**UNROLL_OPTIONS, "report": None},
    "blend_edges": lambda: {"shape": box(), "edges": corner(), **EDGE_OPTIONS},
    "change_of_parameter": lambda: {"start": 1.0, "end": 1.0, "domain": (0.0, 1.0), "onto": (0.0, 1.0)},
    "bridge": lambda: {"shape": pair_of_boxes(), **bridged_sides(), **BRIDGE_OPTIONS},
    "continuity": lambda: {"shape": box(), "edge": corner()},
    "curve_on": lambda: {"face": box().Faces()[0], "edge": box().Faces()[0].Edges()[0]},
    "hermite_blend": lambda: {
        "rail1": rail(),
        "rail2": rail(True),
        "tangents": "perpendicular",
        "continuity": "G1",
        "bulge": 1.0,
        "length": None,
        "form": "auto",
        "tolerance": 1e-7,
        "angular_tolerance": 1e-5,
        "steer": 0.3,
        "crease": None,
    },
    "insert_blend": lambda: {
        "shape": can(),
        "edges": cq.Workplane(can()).edges(">Z").vals(),
        "blend": potential(),
        "first": None,
    },
    "linear": lambda: {"a": 0.1, "b": 0.2},
    "max_size": lambda: {"shape": box(), "edges": corner(), "by": "radius", "tolerance": 0.5, "options": "G1"},
    "normalise": lambda: {"field": ahead(), "tolerance": 1e-2, "method": "schoenberg", "length": 1.0, "knots": None},
    "pde_blend": lambda: {
        "side1": segment(0.0),
        "side2": segment(1.0),
        "order": 2,
        "parameters": None,
        "terms": 2,
        "basis": "auto",
        "modes": 2,
        "points": "auto",
        "minimise": "auto",
        "ends": None,
        "tangents": "perpendicular",
        "bulge": 1.0,
        "length": None,
        "form": "auto",
        "tolerance": 1e-5,
        "angular_tolerance": 1e-5,
        "steer": BLEND_DEFAULTS.steer,
        "crease": None,
    },
    "potential_blend": lambda: {
        "surface1": walls()[0],
        "surface2": walls()[1],
        "relation": Conic(2, 2),
        "near": None,
        "form": "auto",
        "tolerance": 1e-7,
        "angular_tolerance": 1e-5,
        "skin": None,
        "crease": None,
    },
    "projected": lambda: {"surface": sheet(), "curve": line(), "tolerance": 1e-4},
    "reparameterise": lambda: {"curve": line(), "change": scalar()},
    "reshape": lambda: {
        "surface": sheet(),
        "by": "reference",
        "reference": (2.0, 2.0, -2.0),
        "tuning": (1.0, 1.0, 1.0),
        "amounts": None,
        "tolerance": 1e-6,
    },
    "table": lambda: {"points": [(0, 0.1), (0.5, 0.2), (1, 0.1)]},
    "to_curve": lambda: {"edge": corner()},
    "to_edge": lambda: {"curve": line()},
    "to_face": lambda: {"surface": sheet()},
    "to_surface": lambda: {"face": box().Faces()[0]},
    "unroll": lambda: {"shape": cq.Face.makePlane(2, 1), **UNROLL_OPTIONS},
    "verify": lambda: {"shape": box(), "faces": None},
    "with_end_speeds": lambda: {"curve": line(), "start": 1.0, "end": 1.0, "domain": (0.0, 2.0)},
}
for _name in ("Curve", "Surface"):
    for _method, _given in SPLINE.items():
        ARGUMENTS[f"{_name}.{_method}"] = lambda given=_given: dict(given)
for _name in ("BezierRelation", "Conic", "Relation"):
    for _method, _given in RELATION.items():
        ARGUMENTS[f"{_name}.{_method}"] = lambda given=_given: dict(given)
for _name in ("PdeBlend", "PotentialBlend"):
    ARGUMENTS[f"{_name}.face"] = dict

VARIANTS: dict[str, tuple[str, Callable[[], dict[str, Any]]]] = {
    "potential section": (
        "blend_edges",
        lambda: {"radius": None, "section": "potential", "steer": BLEND_DEFAULTS.steer, "a": 0.3, "b": 0.2, "lam": 0.0},
    ),
    "pde section": ("blend_edges", lambda: {"section": "pde", "order": 4, "terms": 2, "continuity": None}),
    "width": ("blend_edges", lambda: {"radius": None, "width": (0.2, 0.3)}),
    "sizes by edge": ("blend_edges", lambda: {"radius": {corner(): 0.2}, "taper": 0.1}),
    "pde along rails": (
        "pde_blend",
        lambda: {"side1": rail(), "side2": rail(True), "order": 4, "terms": 4, "modes": 4, "tolerance": 1e-3},
    ),
    "pde of rings": ("pde_blend", lambda: {"side1": boundary(), "side2": boundary(True), "order": 4, "modes": 1}),
    "pde with ends": (
        "pde_blend",
        lambda: {"ends": (end(0.0), end(2.0)), "order": 2, "terms": 2, "modes": 3},
    ),
    "pde by three": (
        "pde_blend",
        lambda: {"order": (2, 2, 2), "parameters": ((1, 1), (1, 2), (1, 3)), "points": (9, 9)},
    ),
    "guide": (
        "hermite_blend",
        lambda: {"tangents": Guide(across()), "length": scalar() + 1.0, "bulge": (1.0, np.cosh)},
    ),
    "exact": (
        "hermite_blend",
        lambda: {"form": "exact", "continuity": ("G2", "G1"), "tangents": "parametric"},
    ),
    "by normal": ("reshape", lambda: {"by": "normal", "reference": "centroid", "amounts": [[1, 2], [3, np.sin]]}),
    "by extents": ("reshape", lambda: {"surface": bowl(), "reference": "extents", "tuning": (1, 2, -3)}),
    "of functions": ("potential_blend", lambda: {"relation": (lambda x: 2 * (1 - x) ** 2, lambda x: 2 * x**2)}),
    "implicit": ("potential_blend", lambda: {"surface2": cqblend.ImplicitSurface(**plane_function())}),
    "hermite": ("normalise", lambda: {"method": "hermite", "length": scalar() + 1.0}),
    "knots": ("normalise", lambda: {"knots": 3, "tolerance": math.inf}),
    "a surface": ("unroll", lambda: {"shape": bowl(), "tolerance": 0.5}),
    "triangles": ("unroll", lambda: {"shape": bowl(), "tolerance": 0.5, "layout": "triangles"}),
    "elber": ("unroll", lambda: {"shape": bowl(), "tolerance": 0.5, "method": "elber"}),
    "chord": ("Rail.coordinates", lambda: {"name": "chord", "operands": (rail(True),)}),
    "rings": (
        "Boundary",
        lambda: {"position": lambda t: np.stack([t, t * t, t * 0], axis=-1), "first": None, "second": None},
    ),
    "dxf": (
        "Pattern.export",
        lambda: {"path": f"{FOLDER.name}/p.dxf", "page": "a4", "sheet": (9.0, 9.0), "margin": 0.5},
    ),
    "json": ("Pattern.export", lambda: {"path": f"{FOLDER.name}/p.json", "page": "a4"}),
    "paper": ("Pattern.export", lambda: {"page": (210.0, 297.0), "sheet": [9.0, 9.0], "margin": 0.5, "kerf": 0.1}),
    "strips": ("Pattern.with_tabs", lambda: {"style": "strips", "pitch": 0.5}),
    "surface's": ("Surface.isoparametric", lambda: {"u": None, "v": 0.5}),
    "both": ("Surface.clip", lambda: {"v": [0.1, 0.2]}),
    "faces": ("verify", lambda: {"shape": blended().shape, "faces": list(blended().faces)}),
}
"""Other ways to call some of them."""

NONSENSE: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "text": lambda: "x",
    "empty text": lambda: "",
    "bytes": lambda: b"x",
    "True": lambda: True,
    "zero": lambda: 0,
    "negative": lambda: -1,
    "fraction": lambda: 0.3,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "-inf": lambda: -math.inf,
    "huge": lambda: 10**9,
    "beyond doubles": lambda: 10**400,
    "large": lambda: 1e300,
    "tiny": lambda: 5e-324,
    "complex": lambda: 2j,
    "array of nan": lambda: np.full((2, 2), np.nan),
    "array of text": lambda: np.array(["a", "b"]),
    "array of objects": lambda: np.array([None, object()]),
    "array": lambda: np.ones((2, 1, 2, 1, 2)),
    "empty array": lambda: np.empty((0, 3)),
    "empty list": list,
    "empty dict": dict,
    "list of text": lambda: ["x"],
    "list of None": lambda: [None, None],
    "pair of nan": lambda: (math.nan, math.inf),
    "pair of texts": lambda: ("a", "b"),
    "pair reversed": lambda: (1.0, 0.0),
    "ragged": lambda: [[1.0], [1.0, 2.0], 3.0],
    "nested": nested,
    "object": object,
    "class": lambda: Curve,
    "explosive": Explosive,
    "list of explosive": lambda: [Explosive()],
    "raising function": lambda: boom,
    "function of text": lambda: lambda *args: "x",
    "function of None": lambda: lambda *args: None,
    "function of nan": lambda: lambda *args: math.nan,
    "raising generator": lambda: (boom() for _ in range(3)),
    "curve": lambda: Curve.bezier([[1.0], [2.0]], domain=(5, 6)),
    "rational curve without weight": lambda: Curve([0, 1], np.zeros((2, 4, 1)), rational=True),
    "surface": lambda: sheet(),
    "rail": rail,
    "shape": box,
    "edge": corner,
    "null shape": TopoDS_Shape,
    "empty Workplane": cq.Workplane,
}


def callables() -> dict[str, Callable[..., Any]]:
    """Return everything public that can be called, by name; methods take themselves first."""
    found: dict[str, Callable[..., Any]] = {}
    for name in cqblend.__all__:
        thing = getattr(cqblend, name)
        if not inspect.isclass(thing):
            if callable(thing):
                found[name] = thing
            continue
        if issubclass(thing, BaseException):
            continue
        if name not in RECORDS and not inspect.isabstract(thing):
            found[name] = thing
        for method, value in inspect.getmembers(thing):
            public = not method.startswith("_") or method in OPERATORS
            if public and callable(value) and method not in ("register",) and not isinstance(value, type):
                found[f"{name}.{method}"] = value
    for method in ("blend", "bridge", "unroll"):
        found[f"Workplane.{method}"] = getattr(cq.Workplane, method)
    return found


FOUND = callables()


def bound(name: str) -> Callable[..., Any]:
    """Return a callable without its ``self``, with ``operands`` as one argument, and one option for all ``options``."""
    owner, _, method = name.partition(".")
    if name == "max_size":
        return lambda *, options, **given: cqblend.max_size(**given, continuity=options)
    if not method:
        return FOUND[name]
    if method == "bridge" and owner == "Workplane":
        return cq.Workplane(pair_of_boxes()).bridge
    if owner == "Workplane":
        stack = cq.Workplane(box()).newObject([corner() if method == "blend" else box().Faces()[0]])
        return getattr(stack, method)
    function = getattr(SELVES[owner](), method)
    if "operands" not in inspect.signature(function).parameters or owner in ("Guide", "Combination"):
        return function

    def spread(*, operands: Any, **given: Any) -> Any:
        many = operands if isinstance(operands, tuple) else (operands,)
        return function(*given.values(), *many)

    return spread


def parameters(name: str) -> list[str]:
    names = list(inspect.signature(FOUND[name]).parameters)
    return [one for one in names if one != "self"]


def called(name: str, given: dict[str, Any]) -> Any:
    return bound(name)(**given)


def test_every_public_callable_and_parameter_is_walked() -> None:
    assert sorted(FOUND) == sorted(ARGUMENTS)
    for name in FOUND:
        assert sorted(ARGUMENTS[name]()) == sorted(parameters(name)), name


FEW = ("text", "negative", "nan", "huge", "array of nan", "empty list", "explosive", "raising function", "surface")
"""Kinds of nonsense for calls that differ little from others."""


def walk(name: str, arguments: dict[str, Any], kinds: Iterable[str]) -> None:
    """Call with kinds of nonsense in the place of every argument."""
    for parameter in arguments:
        for what in kinds:
            given = NONSENSE[what]()
            if parameter in ("progress", "report") and callable(given):
                continue  # what these raise leaves unchanged, see below
            try:
                called(name, {**arguments, parameter: given})
            except CqblendError as error:
                said = str(error)
            except Exception as error:
                raise AssertionError(f"{name}({parameter}={what})") from error
            else:
                continue
            assert len(said) > 10, (parameter, what)
            assert "\n" not in said, (parameter, what)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FOUND))
def test_nothing_raw_leaves(name: str) -> None:
    called(name, ARGUMENTS[name]())
    walk(
        name, ARGUMENTS[name](), FEW if name in ("Workplane.blend", "Workplane.bridge", "potential_blend") else NONSENSE
    )


@pytest.mark.parametrize("variant", VARIANTS)
def test_nothing_raw_leaves_when_called_in_another_way(variant: str) -> None:
    name, others = VARIANTS[variant]
    arguments = {**ARGUMENTS[name](), **others()}
    called(name, arguments)
    walk(name, arguments, FEW)


@pytest.mark.parametrize("kind", [Guide, Combination])
def test_directions_made_of_nonsense_are_refused(kind: type[Any]) -> None:
    for what, make in NONSENSE.items():
        for field in (kind(make()), kind(line(), make())):
            try:
                cqblend.hermite_blend(rail(), rail(True), tangents=field)
            except CqblendError:
                continue
            assert kind is Guide, what  # whose second curve may be left out
            assert field.second is None, what


def test_blends_made_of_nonsense_are_refused() -> None:
    made = hermite()
    for make in NONSENSE.values():
        with pytest.raises(InputError):
            cqblend.Blend(make() if not isinstance(make(), Surface) else None, made.ribbons, made.form, made.rails)
        with pytest.raises(InputError):
            cqblend.Blend(made.surface, make(), made.form, made.rails)


# callables of the caller's


def raising(kind: type[BaseException]) -> Callable[..., Any]:
    def call(*args: Any) -> Any:
        raise kind("no such thing")

    return call


DATA: dict[str, Callable[[Callable[..., Any]], Any]] = {
    "length": lambda bad: cqblend.hermite_blend(rail(), rail(True), length=bad),
    "bulge": lambda bad: cqblend.hermite_blend(rail(), rail(True), bulge=(1.0, bad)),
    "amounts": lambda bad: cqblend.reshape(sheet(), by="normal", amounts=bad)(0.5),
    "amounts of a blend": lambda bad: cqblend.potential_blend(
        cqblend.reshape(sheet(), by="normal", amounts=bad), walls()[1], Conic(2, 2)
    ),
    "reference": lambda bad: cqblend.reshape(sheet(), reference=bad),
    "relation": lambda bad: cqblend.potential_blend(*walls(), bad),
    "pair of relations": lambda bad: cqblend.potential_blend(*walls(), (bad, bad)),
    "position": lambda bad: Boundary(bad),
    "component": lambda bad: Boundary((0.0, bad, 1.0)),
    "first derivative": lambda bad: Boundary((np.cos, np.sin, 0.0), bad),
}


@pytest.mark.parametrize("kind", [ZeroDivisionError, KeyError, RuntimeError, MemoryError, TypeError, InputError])
@pytest.mark.parametrize("what", DATA)
def test_what_data_raise_is_the_cause_of_an_input_error(what: str, kind: type[Exception]) -> None:
    with pytest.raises(InputError, match="no such thing") as caught:
        DATA[what](raising(kind))
    assert type(caught.value.__cause__) is kind


@pytest.mark.parametrize("what", DATA)
def test_an_interrupt_in_data_is_not_caught(what: str) -> None:
    with pytest.raises(KeyboardInterrupt):
        DATA[what](raising(KeyboardInterrupt))


CALLBACKS: dict[str, Callable[[Callable[..., Any]], Any]] = {
    "progress": lambda tell: cqblend.unroll(box(), 0.1, progress=tell),
    "Workplane.unroll, progress": lambda tell: cq.Workplane(box()).unroll(0.1, progress=tell),
    "Workplane.unroll, report": lambda tell: cq.Workplane(box()).unroll(0.1, report=tell),
    "Workplane.blend, report": lambda tell: cq.Workplane(box()).newObject([corner()]).blend(0.2, report=tell),
}


@pytest.mark.parametrize("kind", [Boom, ValueError, InputError, KeyboardInterrupt])
@pytest.mark.parametrize("what", CALLBACKS)
def test_callbacks_cancel_by_any_exception(what: str, kind: type[BaseException]) -> None:
    own = kind("cancelled")

    def cancel(*args: Any) -> None:
        raise own

    with pytest.raises(kind) as caught:
        CALLBACKS[what](cancel)
    assert caught.value is own
    assert own.__cause__ is None


@pytest.mark.parametrize("what", CALLBACKS)
def test_callbacks_that_cannot_be_called_are_refused_before_anything_is_done(what: str) -> None:
    with pytest.raises(InputError, match="cannot be"):
        CALLBACKS[what](3)  # type: ignore[arg-type]


def test_a_relation_ends_where_it_ends() -> None:
    for x in (2.0, -1e-9, [0.5, 1.0 + 1e-9], math.nan):
        with pytest.raises(InputError, match=r"\bx\b"):
            Conic(1, 1)(x)
    assert Conic(1, 1)([0.0, 1.0]).tolist() == [[1.0, 0.0], [0.0, 1.0]]


# the command line

WORDS = ["", "x", "-1", "0", "nan", "inf", "1e999", "1,2", "1,2,3,4", "nan,0,0", "x,y,z", "9" * 400, "0x0", "1x", "é",
         "\0", "/", "no/such/folder.step"]  # fmt: skip

COMMANDS = {
    "blend": {"input": "box.step", "output": "out.step", "--near": "3,2,0.5", "--radius": "0.2", "--form": "auto"},
    "continuity": {"input": "box.step", "--near": "3,2,0.5"},
    "unroll": {"input": "box.step", "output": "p.dxf", "--tolerance": "0.1", "--tabs": "one", "--tab-width": "0.2"},
    "demo": {"--output": "/dev/null/folder"},  # which cannot be: teapots take their time
}


def options_of(command: str) -> list[str]:
    """Return the options and arguments of a command, as its parser knows them."""
    (commands,) = (action.choices for action in cli._build_parser()._actions if isinstance(action.choices, dict))
    assert sorted(commands) == sorted(COMMANDS)
    actions = [action for action in commands[command]._actions if action.dest != "help"]
    return [(action.option_strings or [action.dest])[-1] for action in actions]


@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_raw_leaves_the_command_line(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_step(cq.Face.makePlane(2, 1).wrapped if command == "unroll" else box().wrapped, "box.step")
    for option in options_of(command):
        for word in WORDS:
            given = {**COMMANDS[command], option: word}
            sizes = {"--width", "--potential"} & {option}
            arguments = [f"{name}={value}" for name, value in given.items() if name[0] == "-"]
            arguments = [one for one in arguments if not (sizes and one.startswith("--radius"))]
            if option == "--developable":
                arguments = [one if not one.startswith(option) else option for one in arguments]
            places = [value for name, value in given.items() if name[0] != "-"]
            try:
                code = cli.main([command, *arguments, "--", *places])
            except SystemExit as leaving:
                code = leaving.code
            err = capsys.readouterr().err
            assert code in (0, 1, 2), (option, word)
            assert code == 0 or "error: " in err, (option, word)
