"""All balls of a given radius that touch both sides of an edge, found by OCCT's evaluation and NumPy alone.

A *side* of an edge is one of its two faces with all faces that go on smoothly from there. At a *station*, a point X of
the edge with its tangent, a ball counts if its centre lies in the plane through X square to the edge and it touches
both sides with the same orientation: from inside the material at a convex edge, from outside at a concave one. That is
what every rolling-ball blend has at every station. Balls are searched from all over both sides, not followed from the
edge: seeds are pairs of points of the two offset surfaces that lie near each other and near the plane, and Newton's
method on the untrimmed surfaces does the rest.

Nothing here knows cqblend.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_OUT, TopAbs_REVERSED
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape, TopTools_IndexedMapOfShape

Array = np.ndarray

SMOOTH = 0.02
"""Angle between faces below which they go on in each other, rad; generous, since going on allows more balls."""
GRID = 40
"""Points each way of a grid on a face, from which balls are searched."""
SEEDS = 16
"""Largest number of seeds at a station."""
CURVATURE_STEP = 0.01
"""Share of an edge over which its curvature is found: second derivatives of intersection curves are no use."""
NEWTON_STEPS = 25
SOLVED = 1e-9
"""Residual of a touching ball, in radii."""


@dataclass(frozen=True, eq=False)
class Face:
    """A face of a body, with its number in OCCT's map."""

    number: int
    shape: TopoDS_Face

    @cached_property
    def surface(self) -> Geom_Surface:
        """The surface, in the place of the face."""
        return BRep_Tool.Surface_s(self.shape)

    @cached_property
    def sign(self) -> int:
        """+1 if S_u x S_v points out of the material, else -1."""
        return -1 if self.shape.Orientation() == TopAbs_REVERSED else 1

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounds of u and of v."""
        return BRepTools.UVBounds_s(self.shape)

    @cached_property
    def box(self) -> Bnd_Box:
        """A box around the face."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.shape, box)
        return box

    @cached_property
    def _classifier(self) -> BRepTopAdaptor_FClass2d:
        return BRepTopAdaptor_FClass2d(self.shape, 1e-7)

    def contains(self, uv: Array) -> bool:
        """Whether a place in the parameter plane lies in the face or on its boundary."""
        return self._classifier.Perform(gp_Pnt2d(*map(float, uv))) != TopAbs_OUT

    def evaluate(self, u: float, v: float) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return S, S_u, S_v, S_uu, S_vv and S_uv."""
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
        self.surface.D2(u, v, point, *vectors)
        return (_coordinates(point), *(_coordinates(vector) for vector in vectors))

    def find_normal(self, u: float, v: float) -> Array:
        """Return the unit normal that points out of the material; NaN at a singular place."""
        _, du, dv, *_ = self.evaluate(u, v)
        cross = self.sign * np.cross(du, dv)
        length = np.linalg.norm(cross)
        return cross / length if length > 0 else np.full(3, np.nan)

    def sample(self, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
        """Return parameters (n, 2), points and normals (n, 3) of a grid on the part of the face inside a box."""
        u0, u1, v0, v1 = self.bounds
        for count in (12, 12, GRID):
            u, v = np.linspace(u0, u1, count), np.linspace(v0, v1, count)
            uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
            points, normals = self._evaluate_grid(uv)
            if count == GRID:
                return uv.reshape(-1, 2), points.reshape(-1, 3), normals.reshape(-1, 3)
            gaps = [np.linalg.norm(np.diff(points, axis=axis), axis=-1).max(initial=0.0) for axis in (0, 1)]
            inside = ((points > lower - max(gaps)) & (points < upper + max(gaps))).all(axis=-1)
            if not inside.any():
                return np.empty((0, 2)), np.empty((0, 3)), np.empty((0, 3))
            rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
            u0, u1 = u[max(rows[0] - 1, 0)], u[min(rows[-1] + 1, count - 1)]
            v0, v1 = v[max(columns[0] - 1, 0)], v[min(columns[-1] + 1, count - 1)]
        raise AssertionError("unreachable")

    def _evaluate_grid(self, uv: Array) -> tuple[Array, Array]:
        point, du, dv, rows = gp_Pnt(), gp_Vec(), gp_Vec(), []
        for u, v in uv.reshape(-1, 2).tolist():
            self.surface.D1(u, v, point, du, dv)
            rows.append((*point.Coord(), *du.Coord(), *dv.Coord()))
        table = np.array(rows).reshape(*uv.shape[:-1], 3, 3)
        cross = self.sign * np.cross(table[..., 1, :], table[..., 2, :])
        with np.errstate(invalid="ignore", divide="ignore"):
            return table[..., 0, :], cross / np.linalg.norm(cross, axis=-1, keepdims=True)


Seed = tuple[tuple[Face, Face], Array]
"""Two faces and parameters on both, (4,), near which a ball may touch them."""


def _coordinates(of: gp_Pnt | gp_Vec) -> Array:
    return np.array(of.Coord())


@dataclass(frozen=True, eq=False)
class Body:
    """A shape with its faces, and which of them meet at which edge."""

    shape: TopoDS_Shape
    _sides: dict[int, list[Face]] = field(default_factory=dict)

    @cached_property
    def faces(self) -> list[Face]:
        """All faces in the order of their numbers."""
        return [Face(n, TopoDS.Face_s(self._faces.FindKey(n))) for n in range(1, self._faces.Extent() + 1)]

    @cached_property
    def _faces(self) -> TopTools_IndexedMapOfShape:
        found = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(self.shape, TopAbs_FACE, found)
        return found

    @cached_property
    def _ancestors(self) -> TopTools_IndexedDataMapOfShapeListOfShape:
        found = TopTools_IndexedDataMapOfShapeListOfShape()
        TopExp.MapShapesAndAncestors_s(self.shape, TopAbs_EDGE, TopAbs_FACE, found)
        return found

    def find_faces_at(self, edge: TopoDS_Edge) -> list[Face]:
        """Return the faces at an edge, each once."""
        numbers = dict.fromkeys(self._faces.FindIndex(face) for face in self._ancestors.FindFromKey(edge))
        return [self.faces[number - 1] for number in numbers]

    def find_number(self, edge: TopoDS_Edge) -> int:
        """Return the number of an edge in OCCT's map of all edges."""
        edges = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(self.shape, TopAbs_EDGE, edges)
        return edges.FindIndex(edge)

    def find_side(self, face: Face, edge: TopoDS_Edge, box: Bnd_Box) -> list[Face]:
        """Return a face and all that go on smoothly from there, as far as they reach into a box."""
        found, waiting = {face.number: face}, [face]
        while waiting:
            here = waiting.pop()
            for there in self._find_smooth_neighbours(here, edge):
                if there.number not in found and not there.box.IsOut(box):
                    found[there.number] = there
                    waiting.append(there)
        return list(found.values())

    def _find_smooth_neighbours(self, face: Face, without: TopoDS_Edge) -> Iterator[Face]:
        if face.number not in self._sides:
            self._sides[face.number] = list(self._list_smooth_neighbours(face, without))
        yield from self._sides[face.number]

    def _list_smooth_neighbours(self, face: Face, without: TopoDS_Edge) -> Iterator[Face]:
        explorer = TopExp_Explorer(face.shape, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            if edge.IsSame(without) or BRep_Tool.Degenerated_s(edge):
                continue
            for other in self.find_faces_at(edge):
                if other is not face and np.nanmin(measure_angles(edge, face, other), initial=math.pi) < SMOOTH:
                    yield other


def trace_pcurve(edge: TopoDS_Edge, face: Face) -> tuple[Geom2d_Curve, float, float]:
    """Return the curve of an edge in the parameter plane of a face, and its range."""
    first, last = BRep_Tool.Range_s(edge, face.shape)
    return BRep_Tool.CurveOnSurface_s(edge, face.shape, first, last), first, last


def measure_angles(edge: TopoDS_Edge, one: Face, other: Face) -> Array:
    """Return the angles between the normals of two faces at nine places of their common edge, rad."""
    normals = []
    for face in (one, other):
        curve, first, last = trace_pcurve(edge, face)
        at = first + (last - first) * (np.arange(9) + 0.5) / 9
        normals.append([face.find_normal(*curve.Value(t).Coord()) for t in at.tolist()])
    a, b = np.array(normals)
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))


@dataclass(frozen=True)
class Station:
    """A point of an edge: tangent, curvature vector, outward normals of both faces, and whether the edge is convex.

    ``share`` is t, the fraction of the edge's parameter range; ``inward`` are the directions into the two faces, square
    to the edge; ``angle`` is that between them on the ball's side, rad: inside the material at a convex edge.
    """

    share: float
    point: Array
    tangent: Array
    curvature: Array
    normals: tuple[Array, Array]
    inward: tuple[Array, Array]
    convex: bool
    angle: float

    @property
    def sense(self) -> int:
        """How the ball lies to the outward normals: its centre is a contact plus this, times radius, times normal."""
        return -1 if self.convex else 1


@dataclass(frozen=True)
class Ball:
    """A ball at a station: centre, and of both contacts the face, the parameters, the point and the outward normal.

    ``bends`` are the largest curvatures of the two surfaces towards the ball, times its radius: above 1, the surface
    bends into the ball. ``advance`` tells how the centre moves while the station does: below 0 it moves backwards.
    """

    centre: Array
    faces: tuple[Face, Face]
    parameters: tuple[Array, Array]
    contacts: tuple[Array, Array]
    normals: tuple[Array, Array]
    bends: tuple[float, float]
    advance: float

    def measure_distance(self, station: Station) -> float:
        """Return the distance of the farther contact from a station, mm."""
        return max(float(np.linalg.norm(contact - station.point)) for contact in self.contacts)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Points of the offset surface of one face, at the distance of the radius."""

    face: Face
    parameters: Array
    centres: Array
    spacing: float


class BallSearch:
    """Search balls of one radius at one edge."""

    def __init__(self, sides: Sequence[Sequence[Face]], radius: float, sense: int, lower: Array, upper: Array) -> None:
        self.radius, self.sense = radius, sense
        self._sides = [[self._offset_samples(face, lower, upper) for face in side] for side in sides]
        self._samples = [[one for one in side if len(one.centres)] for side in self._sides]

    def list_faces(self, side: int) -> list[Face]:
        """Return the faces of a side, 0 or 1."""
        return [one.face for one in self._sides[side]]

    def _offset_samples(self, face: Face, lower: Array, upper: Array) -> _Samples:
        parameters, points, normals = face.sample(lower, upper)
        centres = points + self.sense * self.radius * normals
        sound = np.isfinite(centres).all(axis=1)
        grid = centres.reshape(GRID, GRID, 3) if len(centres) else np.zeros((2, 2, 3))
        steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1) for axis in (0, 1)]
        return _Samples(face, parameters[sound], centres[sound], float(max(np.nanmax(step) for step in steps)))

    def iterate_balls(self, station: Station, reach: float) -> Iterator[Ball]:
        """Yield all balls at a station that touch both, untrimmed, sides within a reach of it; likely ones first."""
        found: list[Ball] = []
        for seeds in (self._list_plain_seeds(station), self._list_near_seeds(station, reach)):
            for ball in solve_balls(list(seeds), station, self.radius):
                if ball.measure_distance(station) > 2 * reach:
                    continue
                apart = [np.abs(np.subtract(ball.contacts, other.contacts)).max() for other in found]
                if min(apart, default=math.inf) > 1e-6 * self.radius:
                    found.append(ball)
                    yield ball

    def measure_gap(self, station: Station, reach: float) -> tuple[float, float]:
        """Return the least distance of the sampled offset surfaces at a station, and what sampling may hide, mm."""
        near = [self._take_near(side, station, reach) for side in self._samples]
        spacing = max((one.spacing for side in self._samples for one in side), default=math.inf)
        if not all(len(points) for points, _ in near):
            return math.inf, spacing
        distances = np.linalg.norm(near[0][0][:, None] - near[1][0][None], axis=-1)
        return float(distances.min()), 2 * spacing

    def _take_near(self, side: Sequence[_Samples], station: Station, reach: float) -> tuple[Array, Array]:
        """Return centres near the plane of a station, and for each its face's place in the side and its own, (n, 2)."""
        points, places = [np.empty((0, 3))], [np.empty((0, 2), dtype=int)]
        for number, one in enumerate(side):
            away = one.centres - station.point
            near = np.abs(away @ station.tangent) < max(0.75 * one.spacing, 0.02 * self.radius)
            near &= np.linalg.norm(away, axis=1) < reach + self.radius
            chosen = np.flatnonzero(near)
            points.append(one.centres[chosen])
            places.append(np.stack([np.full(len(chosen), number), chosen], axis=1))
        return np.concatenate(points), np.concatenate(places)

    def _list_near_seeds(self, station: Station, reach: float) -> Iterator[Seed]:
        """Yield pairs of sampled points whose offsets lie near each other."""
        (first, at_first), (second, at_second) = (self._take_near(side, station, reach) for side in self._samples)
        if len(first) and len(second):
            distances = np.linalg.norm(first[:, None] - second[None], axis=-1)
            allowed = 3 * max(one.spacing for side in self._samples for one in side)
            nearest = distances.argmin(axis=1)
            least = distances[np.arange(len(first)), nearest]
            taken: list[Array] = []
            for i in np.argsort(least).tolist():
                if least[i] > allowed or len(taken) == SEEDS:
                    break
                if min((np.linalg.norm(first[i] - other) for other in taken), default=math.inf) < 0.05 * self.radius:
                    continue
                taken.append(first[i])
                (f, n), (g, m) = at_first[i].tolist(), at_second[nearest[i]].tolist()
                one, other = self._samples[0][f], self._samples[1][g]
                yield (one.face, other.face), np.concatenate([one.parameters[n], other.parameters[m]])

    def _list_plain_seeds(self, station: Station) -> Iterator[Seed]:
        """Yield where a ball would touch the tangent planes at the edge, on every pair of sampled faces."""
        width = self.radius / math.tan(station.angle / 2)
        for one in self._samples[0]:
            for other in self._samples[1]:
                seed = []
                for side, samples in enumerate((one, other)):
                    wanted = station.point + width * station.inward[side]
                    wanted = wanted + self.sense * self.radius * station.normals[side]
                    nearest = np.linalg.norm(samples.centres - wanted, axis=1).argmin()
                    seed.append(samples.parameters[nearest])
                yield (one.face, other.face), np.concatenate(seed)


def solve_balls(seeds: Sequence[Seed], station: Station, radius: float) -> Iterator[Ball]:
    """Yield the balls that Newton's method finds from seeds: two faces, and parameters on both, (4,)."""
    faces, distance = [pair for pair, _ in seeds], station.sense * radius
    x = np.array([start for _, start in seeds]).reshape(-1, 2, 2)
    open_ones = np.arange(len(seeds))
    for _ in range(NEWTON_STEPS):
        if not len(open_ones):
            return
        jets = np.array([[f.evaluate(*uv) for f, uv in zip(faces[i], x[i].tolist(), strict=True)] for i in open_ones])
        signs = np.array([[face.sign for face in faces[i]] for i in open_ones])
        centres, slopes = _offset(jets, signs, distance)  # (n, 2, 3), (n, 2, 2, 3)
        gap = centres[:, 0] - centres[:, 1]
        ahead = (centres[:, 0] - station.point) @ station.tangent
        residual = np.column_stack([gap, ahead]) / radius
        sound = np.isfinite(slopes).all(axis=(1, 2, 3)) & np.isfinite(residual).all(axis=1)
        solved = sound & (np.abs(residual).max(axis=1, initial=0.0) < SOLVED)
        for i in open_ones[solved]:
            ball = _describe_ball(faces[i], x[i], station, radius)
            if ball is not None:
                yield ball
        going = sound & ~solved
        slopes, residual, open_ones = slopes[going], residual[going], open_ones[going]
        jacobian = np.zeros((len(open_ones), 4, 4))
        jacobian[:, :3, :2] = slopes[:, 0].transpose(0, 2, 1)
        jacobian[:, :3, 2:] = -slopes[:, 1].transpose(0, 2, 1)
        jacobian[:, 3, :2] = slopes[:, 0] @ station.tangent
        step = -(np.linalg.pinv(jacobian / radius, rcond=1e-12) @ residual[..., None]).reshape(-1, 2, 2)
        moved = np.linalg.norm(np.einsum("nsp,nspx->nsx", step, slopes), axis=-1).max(axis=1, initial=1e-300)
        x[open_ones] += step * np.minimum(1.0, radius / moved)[:, None, None]


def _offset(jets: Array, signs: Array, distance: float) -> tuple[Array, Array]:
    """Return points (..., 3) of offsets along outward normals, and derivatives (..., 2, 3), of jets (..., 6, 3)."""
    p, du, dv, duu, dvv, duv = np.moveaxis(jets, -2, 0)
    cross = np.cross(du, dv)
    with np.errstate(divide="ignore", invalid="ignore"):
        length = np.linalg.norm(cross, axis=-1, keepdims=True) * signs[..., None]
        unit = cross / length
        moved = []
        for tangent, turn in ((du, np.cross(duu, dv) + np.cross(du, duv)), (dv, np.cross(duv, dv) + np.cross(du, dvv))):
            slope = turn / length
            moved.append(tangent + distance * (slope - (slope * unit).sum(-1, keepdims=True) * unit))
    return p + distance * unit, np.stack(moved, axis=-2)


def _describe_ball(faces: tuple[Face, Face], x: Array, station: Station, radius: float) -> Ball | None:
    contacts, normals, bends = [], [], []
    for face, (u, v) in zip(faces, x.tolist(), strict=True):
        contacts.append(face.evaluate(u, v)[0])
        normals.append(face.find_normal(u, v))
        bends.append(radius * measure_largest_bend(face, u, v, station.sense))
    turn = np.cross(*normals)
    if np.linalg.norm(turn) < 1e-2 and normals[0] @ normals[1] > 0:
        return None  # one contact, on a face that belongs to both sides
    centre = contacts[0] + station.sense * radius * normals[0]
    forwards = np.sign(np.cross(*station.normals) @ station.tangent) * (turn @ station.tangent)
    advance = (1 - (centre - station.point) @ station.curvature) * np.sign(forwards)
    pairs = ((x[0].copy(), x[1].copy()), (contacts[0], contacts[1]), (normals[0], normals[1]), (bends[0], bends[1]))
    return Ball(centre, faces, *pairs, float(advance))


def measure_largest_bend(face: Face, u: float, v: float, sense: int) -> float:
    """Return the largest curvature of a face at a point, towards its outward normal times a sense of +-1, 1/mm."""
    _, du, dv, duu, dvv, duv = face.evaluate(u, v)
    normal = face.find_normal(u, v)
    first = np.array([[du @ du, du @ dv], [du @ dv, dv @ dv]])
    second = np.array([[duu @ normal, duv @ normal], [duv @ normal, dvv @ normal]])
    return float((sense * np.linalg.eigvals(np.linalg.solve(first, second)).real).max())


def find_station(body: Body, edge: TopoDS_Edge, share: float) -> Station | None:
    """Return the station of an edge at t, a fraction of its parameter range; None if it is not between two faces."""
    faces = body.find_faces_at(edge)
    if len(faces) != 2 or BRep_Tool.Degenerated_s(edge):
        return None
    curve = BRepAdaptor_Curve(edge)
    start, end = curve.FirstParameter(), curve.LastParameter()
    t, step = start + share * (end - start), CURVATURE_STEP * (end - start)
    jets = [_find_point_and_tangent(curve, at) for at in (max(t - step, start), t, min(t + step, end))]
    if any(jet is None for jet in jets):
        return None
    (before, slope_before), (point, tangent), (after, slope_after) = jets  # type: ignore[misc]
    bend = (slope_after - slope_before) / np.linalg.norm(after - before)
    normals, inward = [], []
    for face in faces:
        pcurve, first, last = trace_pcurve(edge, face)
        normals.append(face.find_normal(*pcurve.Value(first + share * (last - first)).Coord()))
        inward.append(np.cross(normals[-1], tangent) * _find_sense(face, edge))
    if not np.isfinite(normals).all():
        return None
    convex = bool(normals[1] @ inward[0] < 0)
    angle = math.atan2(float(np.linalg.norm(np.cross(*inward))), float(inward[0] @ inward[1]))
    curvature = bend - (bend @ tangent) * tangent
    pairs = ((normals[0], normals[1]), (inward[0], inward[1]))
    return Station(share, point, tangent, curvature, *pairs, convex, angle)


def _find_point_and_tangent(curve: BRepAdaptor_Curve, t: float) -> tuple[Array, Array] | None:
    """Return a point of a curve and its unit tangent; None where it stands still."""
    point, slope = gp_Pnt(), gp_Vec()
    curve.D1(t, point, slope)
    speed = slope.Magnitude()
    return None if speed < 1e-12 else (_coordinates(point), _coordinates(slope) / speed)


def _find_sense(face: Face, edge: TopoDS_Edge) -> int:
    """Return +1 if a face lies to the left of an edge, seen from outside along the edge's curve, else -1."""
    explorer = TopExp_Explorer(face.shape, TopAbs_EDGE)
    while explorer.More():
        if explorer.Current().IsSame(edge):
            return -1 if explorer.Current().Orientation() == TopAbs_REVERSED else 1
        explorer.Next()
    raise ValueError("the edge is not one of the face")
