"""Random solids of revolution, and how finished faces meet along circles: by OCCT, and in long doubles.

Measurements share no code with cqblend: faces are read from OCCT, evaluated by its D1 and D2, and once more in long
doubles by the formulas of their surfaces, from the doubles in them.
"""

from __future__ import annotations

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.Geom import (
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_Line,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face
from proof_witness import LONG, Measured, basis, compared, length, spans

import cqblend

KINDS = ("cylinder", "cone", "sphere", "torus", "spline", "step", "groove", "ring", "ball")


def revolve_outline(kind: str, size: float, rng: np.random.Generator, turn: float = 360.0) -> cq.Workplane:
    """Return a solid of revolution about Z whose outline has a corner at height 0 and radius about ``size``."""
    r, h = size * rng.uniform(0.8, 1.2), size * rng.uniform(1.5, 2.5)
    if kind in ("ring", "ball"):  # a torus or a sphere, cut at height 0
        whole = cq.Solid.makeTorus(r, r / 3) if kind == "ring" else cq.Solid.makeSphere(r, angleDegrees1=-90)
        cutter = cq.Solid.makeBox(4 * r, 4 * r, 2 * r, cq.Vector(-2 * r, -2 * r, -2 * r))
        low = r * rng.uniform(-0.2, 0.2)
        return cq.Workplane(whole.moved(cq.Location(cq.Vector(0, 0, low))).cut(cutter))
    plan = cq.Workplane("XZ")
    start = plan.moveTo(0, 0).lineTo(r, 0) if turn == 360 else plan.moveTo(r / 8, 0).lineTo(r, 0)
    inner = 0.0 if turn == 360 else r / 8
    if kind == "cylinder":
        wall = start.lineTo(r, h)
    elif kind == "cone":
        wall = start.lineTo(r * rng.uniform(0.5, 1.4), h)
    elif kind == "sphere":
        ball, low = 1.3 * r, -np.sqrt(1.3**2 - 1) * r  # about the axis, cut at height 0
        angles = np.arctan2(low, r) + np.array([0.5, 1.0]) * rng.uniform(0.7, 1.3)
        middle, end = (np.stack([ball * np.cos(angles), ball * np.sin(angles) - low], -1)).tolist()
        wall = start.threePointArc(tuple(middle), tuple(end))
        h = end[1]
    elif kind == "torus":
        wall = start.threePointArc((r * rng.uniform(1.1, 1.3), h / 2), (r * rng.uniform(0.9, 1.1), h))
    elif kind == "spline":
        middle = (r * rng.uniform(0.7, 1.2), h / 2)
        wall = start.spline([middle, (r * rng.uniform(0.8, 1.1), h)], includeCurrent=True)
    else:  # both faces at the corner lean
        slope = rng.uniform(0.2, 0.5) * (1 if kind == "step" else -1)
        plan = cq.Workplane("XZ").moveTo(inner, -slope * r * (1 - inner / r)).lineTo(r, 0)
        wall = plan.lineTo(r * rng.uniform(0.9, 1.2), h)
    return wall.lineTo(inner, h).close().revolve(turn, (0, 0, 0), (0, 1, 0))


def place_at_random(shape: cq.Shape, distance: float, rng: np.random.Generator) -> cq.Shape:
    """Return a shape, turned and moved by about a distance; its own geometry, or by a location."""
    trsf, move = gp_Trsf(), gp_Trsf()
    trsf.SetRotation(gp_Ax1(gp_Pnt(), gp_Dir(*rng.normal(size=3))), float(rng.uniform(0, 6)))
    move.SetTranslation(gp_Vec(*(distance * rng.uniform(-1, 1, 3))))
    return cq.Shape.cast(BRepBuilderAPI_Transform(shape.wrapped, move * trsf, bool(rng.integers(2))).Shape())


def find_corner(shape: cq.Shape, corner: cq.Vector) -> cq.Edge:
    """Return the circular edge whose centre is nearest to a point."""
    round_edges = [edge for edge in shape.Edges() if edge.geomType() == "CIRCLE"]
    return min(round_edges, key=lambda edge: (edge.arcCenter() - corner).Length)


def is_turned(result: cqblend.BlendResult) -> bool:
    """Whether all blend faces of a result, but for planes at its ends, are surfaces of revolution."""
    kinds = {cq.Face(getattr(face, "wrapped", face)).geomType() for face in result.faces}
    return kinds - {"PLANE"} == {"REVOLUTION"}


def find_rails(result: cqblend.BlendResult) -> list[tuple[cq.Face, cq.Face, cq.Edge]]:
    """Return blend face, neighbour, and the circular edge between them, for all of a result."""
    blends = [cq.Face(getattr(face, "wrapped", face)) for face in result.faces]
    return [
        (blend, face, edge)
        for blend in blends
        for edge in blend.Edges()
        for face in result.shape.Faces()
        if edge.geomType() == "CIRCLE" and not face.isSame(blend) and any(map(edge.isSame, face.Edges()))
    ]


def read_jets(face: TopoDS_Face, edge: TopoDS_Edge, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the jets (6, n, 3) of a face along its edge: as OCCT evaluates them, and in long doubles."""
    surface, pcurve = BRep_Tool.Surface_s(face), BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
    p, su, sv, suu, svv, suv = gp_Pnt(), *(gp_Vec() for _ in range(5))
    out = []
    for at in t.tolist():
        uv = pcurve.Value(at)
        surface.D2(uv.X(), uv.Y(), p, su, sv, suu, svv, suv)
        second = [x.Coord() for x in (suu, suv, svv)]
        surface.D1(uv.X(), uv.Y(), p, su, sv)
        out.append([*(x.Coord() for x in (p, su, sv)), *second])
    return np.array(out).swapaxes(0, 1).astype(LONG), evaluate_long(surface, locate_long(pcurve, t))


def locate_long(pcurve: Geom2d_Circle | Geom2d_Line, t: np.ndarray) -> np.ndarray:
    """Return the parameters (n, 2) of a pcurve in long doubles."""
    t = t.astype(LONG)[:, None]
    if isinstance(pcurve, Geom2d_Line):
        return np.array(pcurve.Location().Coord(), LONG) + t * np.array(pcurve.Direction().Coord(), LONG)
    position = pcurve.Position()
    centre, x, y = (
        np.array(part.Coord(), LONG) for part in (position.Location(), position.XDirection(), position.YDirection())
    )
    return centre + LONG(pcurve.Radius()) * (np.cos(t) * x + np.sin(t) * y)


def evaluate_long(surface: Geom_Surface, uv: np.ndarray) -> np.ndarray:
    """Return the jets (6, n, 3) of a surface by its formula, at long doubles (n, 2)."""
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    u, v = uv.T
    zero, one = np.zeros_like(v), np.ones_like(v)
    if isinstance(surface, Geom_SurfaceOfRevolution):
        axis = surface.Axis()
        origin, z = (np.array(part.Coord(), LONG) for part in (axis.Location(), axis.Direction()))
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        z, x = z / length(z), x / length(x)
        frame = np.stack([x, np.cross(z, x), z])
        profile = evaluate_long_curve(surface.BasisCurve(), v)
        profile[0] -= origin
        profile = profile @ frame.T
    else:
        position = surface.Position()
        parts = (position.Location(), position.XDirection(), position.YDirection(), position.Direction())
        origin, *axes = (np.array(part.Coord(), LONG) for part in parts)
        frame = np.stack(axes)
        if isinstance(surface, Geom_Plane):
            flat = [origin + uv @ frame[:2], frame[0] + 0 * uv[:, :1], frame[1] + 0 * uv[:, :1]]
            return np.stack([*flat, *np.zeros((3, len(u), 3), LONG)])
        if isinstance(surface, Geom_SphericalSurface | Geom_ToroidalSurface):
            ring = isinstance(surface, Geom_ToroidalSurface)
            major, r = (surface.MajorRadius(), surface.MinorRadius()) if ring else (0.0, surface.Radius())
            cos, sin = LONG(r) * np.cos(v), LONG(r) * np.sin(v)
            columns = [[major + cos, zero, sin], [-sin, zero, cos], [-cos, zero, -sin]]
        else:
            assert isinstance(surface, Geom_CylindricalSurface | Geom_ConicalSurface)
            leans = isinstance(surface, Geom_ConicalSurface)
            radius, angle = (surface.RefRadius(), surface.SemiAngle()) if leans else (surface.Radius(), 0.0)
            sine, cosine = np.sin(LONG(angle)), np.cos(LONG(angle))
            columns = [[radius + v * sine, zero, v * cosine], [sine * one, zero, cosine * one], [zero, zero, zero]]
        profile = np.stack([np.stack(column, -1) for column in columns])
    cos, sin = np.cos(u)[:, None], np.sin(u)[:, None]

    def turned(rows: np.ndarray) -> np.ndarray:
        a, b, c = rows[:, :1], rows[:, 1:2], rows[:, 2:]
        return np.concatenate([cos * a - sin * b, sin * a + cos * b, c], axis=1)

    def quarter(rows: np.ndarray) -> np.ndarray:
        return np.stack([-rows[:, 1], rows[:, 0], 0 * rows[:, 0]], -1)

    s, sv, svv = map(turned, profile)
    flat = s * np.array([1, 1, 0])
    return np.stack([origin + s @ frame, *(part @ frame for part in (quarter(s), sv, -flat, quarter(sv), svv))])


def evaluate_long_curve(curve: Geom_Curve, v: np.ndarray) -> np.ndarray:
    """Return points and two derivatives (3, n, 3) of a line, a circle or a B-spline at long doubles (n,)."""
    while isinstance(curve, Geom_TrimmedCurve):
        curve = curve.BasisCurve()
    if isinstance(curve, Geom_Line):
        start, along = (np.array(part.Coord(), LONG) for part in (curve.Lin().Location(), curve.Lin().Direction()))
        return np.stack([start + v[:, None] * along, along + 0 * v[:, None], np.zeros((len(v), 3), LONG)])
    if isinstance(curve, Geom_Circle):
        position = curve.Position()
        parts = (position.Location(), position.XDirection(), position.YDirection())
        centre, x, y = (np.array(part.Coord(), LONG) for part in parts)
        cos, sin = np.cos(v)[:, None], np.sin(v)[:, None]
        jet = [cos * x + sin * y, cos * y - sin * x, -cos * x - sin * y]
        return LONG(curve.Radius()) * np.stack(jet) + centre * np.array([1, 0, 0])[:, None, None]
    degree = curve.Degree()
    knots = np.array([curve.KnotSequence().Value(i + 1) for i in range(curve.KnotSequence().Length())], LONG)
    poles = np.array([curve.Pole(i + 1).Coord() for i in range(curve.NbPoles())], LONG)
    weights = np.array([curve.Weight(i + 1) for i in range(curve.NbPoles())], LONG)
    span = spans(degree, knots, v)
    index = span - degree + np.arange(degree + 1)[:, None]
    middle = poles.mean(axis=0)
    both = np.concatenate([(poles - middle) * weights[:, None], weights[:, None]], axis=1)[index]
    rows = [np.einsum("in,ind->nd", basis(degree, knots, span, v, k), both) for k in range(3)]
    (point, w), (rate, dw), (bend, ddw) = ((row[:, :3], row[:, 3:]) for row in rows)
    point = point / w
    rate = (rate - dw * point) / w
    return np.stack([point + middle, rate, (bend - 2 * dw * rate - ddw * point) / w])


def measure_joint(
    blend: TopoDS_Face, support: TopoDS_Face, edge: TopoDS_Edge, count: int = 61
) -> tuple[Measured, Measured]:
    """Measure how two faces meet along an edge: in long doubles, and as OCCT evaluates them."""
    t = np.linspace(*BRep_Tool.Range_s(edge), count)
    (by_occt, exact), (other_by_occt, other_exact) = (read_jets(face, edge, t) for face in (blend, support))
    return compared(exact, other_exact), compared(by_occt, other_by_occt)
