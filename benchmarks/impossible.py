"""Edges at which no complete rolling-ball blend of a radius can exist, each with a witness; made without cqblend.

Run ``python -m benchmarks.impossible CASES_DIR`` from the project's folder: a table of the listed edges of real parts,
with the witness of each or none. `find_witness` does the same for one edge of any shape.

A rolling-ball blend has, at every station X of its edge but near its ends, a ball whose centre lies in the plane
through X square to the edge and that touches both sides of the edge: the two faces, and what goes on smoothly from
them. `benchmarks.touching_balls` finds all such balls. None of them serves if

``curvature``
    at a contact the face bends into the ball: its largest curvature towards the ball, times the radius, is above 1. The
    blend is tangent to the face all along the rail, so that their second fundamental forms agree on the rail's
    direction s and any other; the difference of the face's and that of a sphere of radius R then has s and the
    direction c of the ball's arc for conjugate directions. It must be negative on c, or the blend begins behind the
    face, and on s, or the envelope of the balls has folded over. So it is negative on all directions.
``backwards``
    the ball's centre lies beyond the edge's own centre of curvature: while X goes forwards, the ball goes backwards.
    The balls lead from the edge's beginning to its end, so that they pass the station forwards at least once.
``narrow face``
    a contact lies outside the face, and outside what goes on smoothly from it: the rail has left it across a sharp
    edge, its outer boundary or that of a hole. Near the end of the edge that is how blends end, and does not count.
``thin material``, ``narrow space``
    the arc from contact to contact, which is to be the blend, leaves the material of a convex edge, or at a concave
    edge leaves the empty space. Near ends it does not count, where the blend is cut by whatever faces lie there.
``no ball``
    there is no ball at all: the two surfaces on which its centre must lie do not meet in the plane of X, but keep a
    distance that is larger than what the sampling may hide.
``no solid angle``
    all along the edge the faces meet smoothly, or what is between them is a knife's edge.

An edge is impossible if at one station no ball is without fault. What counts as an end is generous, and so is what goes
on smoothly; where numbers leave a doubt, there is no witness. The blend of a chain is impossible if it is so at one of
its edges: the witness may be at an edge into which the given one goes on tangentially, which it names.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_IN, TopAbs_OUT, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

from benchmarks.real_edges import list_edges, read_listed_edges
from benchmarks.tables import Table
from benchmarks.tangent_chains import EdgeLinks, find_chain_ends, measure_length
from benchmarks.touching_balls import Array, Ball, BallSearch, Body, Face, Station, find_station

STATIONS, STATIONS_BEYOND = 24, 6
"""Stations of the edge that is asked for, and of each other one of its chain."""
END = 1.5
"""Length at each end of an open chain of which nothing narrow or thin counts, in widths of the blend."""
FAULT = 1e-3
"""By how much a ball must fail, in radii or relative, before it counts as impossible."""
KNIFE, FLAT = math.radians(1.0), math.radians(0.5)
"""Below the first angle between the faces an edge is a knife's; nearer to pi than the second, it is smooth."""
WIDEST = 20.0
"""Width of a blend, in radii, beyond which no ball is looked for: the edge is nearly a knife's."""
ARC_POINTS = 3
"""Points of an arc that are looked at."""


@dataclass(frozen=True)
class Witness:
    """Why there is no complete blend: the kind, the edge's number, the place t on it, and a statement with numbers."""

    kind: str
    edge: int
    share: float
    statement: str

    def __str__(self) -> str:
        return f"{self.kind}: edge {self.edge}, t = {self.share:.3f}: {self.statement}"


def find_witness(shape: TopoDS_Shape, edge: TopoDS_Edge, radius: float, *, chain: bool = True) -> Witness | None:
    """Return a witness that no complete rolling-ball blend of that radius exists at an edge, or None.

    With ``chain``, the blend is that of all edges into which this one goes on tangentially; without, of this one alone,
    whose ends are then where it ends.
    """
    body = Body(shape)
    if find_station(body, edge, 0.5) is None:
        return None
    if not chain:
        return _EdgeTrial(body, edge, radius).find_witness(0.0, 0.0)
    row = EdgeLinks(body).follow_chain(edge)
    for place in sorted(range(len(row.edges)), key=lambda place: not row.edges[place].IsSame(edge)):
        count = STATIONS if row.edges[place].IsSame(edge) else STATIONS_BEYOND
        witness = _EdgeTrial(body, row.edges[place], radius, count).find_witness(*find_chain_ends(row, place))
        if witness is not None:
            return witness
    return None


@dataclass(frozen=True)
class _Fault:
    """What is wrong with a ball; ``at_ends`` if it counts there as well."""

    kind: str
    statement: str
    at_ends: bool


@dataclass(frozen=True, eq=False)
class _EdgeTrial:
    """One edge of a body and a radius."""

    body: Body
    edge: TopoDS_Edge
    radius: float
    count: int = STATIONS

    @cached_property
    def number(self) -> int:
        return self.body.find_number(self.edge)

    @cached_property
    def stations(self) -> list[tuple[float, Station]]:
        """Stations at equal distances, each with its distance from the edge's first point, mm."""
        curve, length = BRepAdaptor_Curve(self.edge), measure_length(self.edge)
        first, last = curve.FirstParameter(), curve.LastParameter()
        found = []
        for distance in (length * (np.arange(self.count) + 0.5) / self.count).tolist():
            t = GCPnts_AbscissaPoint(curve, distance, first).Parameter()
            station = find_station(self.body, self.edge, (t - first) / (last - first))
            if station is not None:
                found.append((distance, station))
        return found

    def find_witness(self, before: float, after: float) -> Witness | None:
        """Return a witness at this edge, if the chain goes on so far before and after it, mm."""
        angles = np.array([station.angle for _, station in self.stations])
        if not len(angles):
            return None
        if (angles < KNIFE).all() or (angles > math.pi - FLAT).all():
            statement = (
                f"the angle between the faces is {np.degrees(angles).min():.3g} to {np.degrees(angles).max():.3g} deg"
            )
            return Witness("no solid angle", self.number, 0.5, statement)
        length = measure_length(self.edge)
        if len({station.convex for _, station in self.stations}) > 1:
            return None
        for distance, station in sorted(self.stations, key=lambda one: abs(one[0] - length / 2)):
            width = self.radius / math.tan(station.angle / 2)
            if station.angle > math.pi - FLAT or width > WIDEST * self.radius:
                continue
            end = END * max(width, self.radius)
            near_end = before + distance < end or after + length - distance < end
            fault = self._find_fault(station, near_end)
            if fault is not None:
                return Witness(fault.kind, self.number, station.share, fault.statement)
        return None

    @cached_property
    def _reach(self) -> float:
        """How far from the edge contacts are looked for, mm."""
        widths = [self.radius / math.tan(max(station.angle, KNIFE) / 2) for _, station in self.stations]
        return 3 * min(max(*widths, self.radius), WIDEST * self.radius)

    @cached_property
    def _search(self) -> BallSearch:
        points = np.array([station.point for _, station in self.stations])
        lower, upper = points.min(axis=0) - self._reach, points.max(axis=0) + self._reach
        box = Bnd_Box(gp_Pnt(*lower.tolist()), gp_Pnt(*upper.tolist()))
        sides = [self.body.find_side(face, self.edge, box) for face in self.body.find_faces_at(self.edge)]
        return BallSearch(sides, self.radius, self.stations[0][1].sense, lower, upper)

    def _find_fault(self, station: Station, near_end: bool) -> _Fault | None:
        """Return why there is no ball at a station; None if there is one, or if that is not certain."""
        faults = []
        for ball in self._search.iterate_balls(station, self._reach):
            fault = next((fault for fault in self._list_faults(ball, station) if fault.at_ends or not near_end), None)
            if fault is None:
                return None
            faults.append((ball.measure_distance(station), fault))
        if faults:
            return min(faults, key=lambda one: one[0])[1]
        gap, hidden = self._search.measure_gap(station, self._reach)
        if near_end or gap < hidden:
            return None
        return _Fault(
            "no ball", f"centres at {self.radius:g} mm from one side keep {gap:.3g} mm from those of the other", True
        )

    def _list_faults(self, ball: Ball, station: Station) -> Iterator[_Fault]:
        for face, bend in zip(ball.faces, ball.bends, strict=True):
            if bend > 1 + FAULT:
                least = self.radius / bend
                yield _Fault(
                    "curvature", f"face {face.number} bends to the ball by radius {least:.4g} < {self.radius:g}", True
                )
        if ball.advance < -FAULT:
            statement = f"while the edge goes on by 1 mm, the ball goes back by {-ball.advance:.3g} mm"
            yield _Fault("backwards", statement, at_ends=True)
        for side, (face, uv, contact) in enumerate(zip(ball.faces, ball.parameters, ball.contacts, strict=True)):
            outside = 0.0 if face.contains(uv) else self._measure_outside(side, contact)
            if outside > FAULT * self.radius:
                yield _Fault(
                    "narrow face", f"the contact is {outside:.4g} mm outside face {face.number}", at_ends=False
                )
        outside = self._measure_arc_outside(ball, station)
        if outside > FAULT * self.radius:
            kind, what = ("thin material", "material") if station.convex else ("narrow space", "space")
            yield _Fault(kind, f"the arc from contact to contact leaves the {what} by {outside:.4g} mm", at_ends=False)

    def _measure_outside(self, side: int, contact: Array) -> float:
        """Return the distance of a contact from the faces of a side, mm."""
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*contact.tolist())).Vertex()
        faces: list[Face] = self._search.list_faces(side)
        return min(BRepExtrema_DistShapeShape(vertex, face.shape).Value() for face in faces)

    def _measure_arc_outside(self, ball: Ball, station: Station) -> float:
        """Return how far the arc between the contacts leaves the material, or at a concave edge the space, mm."""
        solid = self._solid
        if solid is None:
            return 0.0
        one, other = (contact - ball.centre for contact in ball.contacts)
        angle = math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))
        at = np.linspace(0, angle, ARC_POINTS + 2)[1:-1, None]
        arc = ball.centre + (np.sin(angle - at) * one + np.sin(at) * other) / math.sin(angle)
        wrong, largest = TopAbs_OUT if station.convex else TopAbs_IN, 0.0
        for point in (gp_Pnt(*row) for row in arc.tolist()):
            self._classifier.Perform(point, FAULT * self.radius)
            if self._classifier.State() == wrong:
                vertex = BRepBuilderAPI_MakeVertex(point).Vertex()
                largest = max(
                    largest, min(BRepExtrema_DistShapeShape(vertex, shell).Value() for shell in _list_shells(solid))
                )
        return largest

    @cached_property
    def _classifier(self) -> BRepClass3d_SolidClassifier:
        return BRepClass3d_SolidClassifier(self._solid)

    @cached_property
    def _solid(self) -> TopoDS_Shape | None:
        """The solid that has the edge, if it is in one."""
        explorer = TopExp_Explorer(self.body.shape, TopAbs_SOLID)
        while explorer.More():
            if any(edge.IsSame(self.edge) for edge in list_edges(explorer.Current())):
                return explorer.Current()
            explorer.Next()
        return None


def _list_shells(solid: TopoDS_Shape) -> Iterator[TopoDS_Shape]:
    explorer = TopExp_Explorer(solid, TopAbs_SHELL)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def tabulate(folder: Path) -> Table:
    """Return the table of all listed edges of a folder, and whether each can be blended."""
    rows: list[tuple[str | float, ...]] = []
    found = 0
    for listed in read_listed_edges(folder):
        witness = find_witness(listed.shape, listed.edge, listed.radius)
        found += witness is not None
        rows.append((listed.name, f"{listed.radius:g}", str(witness or "none")))
        print(*rows[-1], file=sys.stderr, flush=True)
    rows.append((f"{len(rows)} edges", "", f"{found} have a witness ({found / max(len(rows), 1):.1%})"))
    return Table("impossible", ("edge", "radius, mm", "witness that there is no complete blend"), rows)


def main() -> None:
    parser = argparse.ArgumentParser(description="List edges of real parts at which no rolling-ball blend can exist.")
    parser.add_argument("cases", type=Path, help="folder with edges.json")
    print(tabulate(parser.parse_args().cases))


if __name__ == "__main__":
    main()
