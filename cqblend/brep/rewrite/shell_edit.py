"""Wire substitution: put a blend face into a solid by rewriting the boundaries of the faces it touches.

No intersection is computed and no boolean is run. The two faces next to the edge are trimmed at the rails by replacing
the edge in their wires, the blend face goes in on the same rail edges, whose 3D curves are its own boundary rows of
poles, and the shell is put together again. A closed edge may cross seams: rail and seam are split there and the loops
traced anew. An open edge ends on a neighbour face at each end: the end curve of the blend on that face is solved point
by point.

The result is a proposal: :mod:`cqblend.solid_blends.edge_blend` verifies it before anybody sees it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_G1, GeomAbs_G2
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex, TopoDS_Wire

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.read import spline_arrays
from cqblend.brep.read.face_surface import SupportFace, build_rail_pcurve
from cqblend.brep.rewrite import end_cap, end_on_face
from cqblend.brep.rewrite.edge_accuracy import TOLERANCE_MARGIN, raise_edge_tolerances
from cqblend.brep.rewrite.end_curve import BlendEndError
from cqblend.brep.rewrite.neighbour_edges import trim_neighbour_edges
from cqblend.brep.rewrite.sphere_axis import make_sphere_boundary, realign_sphere
from cqblend.brep.select.spine import EdgeSpine
from cqblend.brep.topology import (
    BUILDER,
    CONFUSION,
    AncestorMap,
    ShapeIndex,
    attach_pcurves,
    chain_segments,
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    find_seam_edges,
    make_bare_face,
    make_closed_wire,
    make_edge,
    make_trimmed_copy,
    make_vertex,
    orient_forward,
    raise_vertex_tolerance,
    replace_solid_faces,
    reverse_edge,
)
from cqblend.errors import GeometryError, SizeError, TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.roots import find_sign_changes

SEAM_TOLERANCE = 1e-9  # relative: a rail end this near to a seam lies on it
CONTINUITY_FLAGS = (GeomAbs_C0, GeomAbs_G1, GeomAbs_G2)  # of an edge, by the order of continuity


@dataclass
class FaceEdit:
    """What becomes of one face: edges replaced (by pieces, FORWARD, or by nothing) and edge uses added.

    Or ``replacement_face``, another FORWARD face in its place.
    """

    face: TopoDS_Face
    replacement_face: TopoDS_Face | None = None
    replaced_edges: dict[int, list[TopoDS_Edge]] = field(default_factory=dict)
    added_uses: list[TopoDS_Edge] = field(default_factory=list)  # oriented as in the FORWARD face


@dataclass(frozen=True)
class ProposedSolid:
    """A rewritten solid, not yet verified."""

    solid: TopoDS_Shape
    blend_face: TopoDS_Face
    trimmed_faces: tuple[TopoDS_Face, TopoDS_Face]  # the trimmed faces
    rail_edges: tuple[list[TopoDS_Edge], list[TopoDS_Edge]]  # between blend and sides
    cap_count: int  # how many ends are flat caps
    tolerance: float  # the largest of an edge that was made or cut (mm)


class RailsTooShortError(GeometryError):
    """The blend must be made over a longer range of t, ``needed_domain``, to reach the faces at its ends."""

    def __init__(self, needed: tuple[float, float]) -> None:
        super().__init__(f"the rails must reach from t = {needed[0]:.4g} to {needed[1]:.4g}")
        self.needed_domain = needed


@dataclass
class ShellEdit:
    """One operation on one solid: :meth:`blend_closed_edge` and :meth:`blend_open_edge` return a proposal."""

    solid: TopoDS_Shape
    spine: EdgeSpine
    sides: tuple[SupportFace, SupportFace]
    blend: BlendSurface
    name_part: Callable[[TopoDS_Shape], str]  # what messages call a part of the solid

    def __post_init__(self) -> None:
        self.input_sides = self.sides
        self.edge_index = ShapeIndex(self.solid, TopAbs_EDGE)
        self.face_index = ShapeIndex(self.solid, TopAbs_FACE)
        self.removed_vertices = [vertex for edge in self.spine.edges for vertex in find_end_vertices(edge)]
        self.edge_remainders: dict[int, list[TopoDS_Edge]] = {
            self.edge_index.find_number(edge): [] for edge in self.spine.edges
        }
        self.face_edits: dict[int, FaceEdit] = {}
        self.blend_surface: Geom_BSplineSurface = spline_arrays.surface_from_arrays(*self.blend.surface.to_bspline())
        self.blend_face = make_bare_face(self.blend_surface)
        self.rail_curves = [self.blend.surface.isoparametric(v=v) for v in (0.0, 1.0)]
        self.occ_rail_curves = [spline_arrays.curve_from_arrays(*row.to_bspline()) for row in self.rail_curves]
        if self.spine.closed:
            pairs = zip(self.sides, self.blend.ribbons, strict=True)
            first, second = (realign_sphere(side, rail, self.spine.edges) or side for side, rail in pairs)
            self.sides = (first, second)
        self.rail_pcurves = [
            build_rail_pcurve(side, rail) for side, rail in zip(self.sides, self.blend.ribbons, strict=True)
        ]

    @cached_property
    def vertex_index(self) -> ShapeIndex:
        """The vertices of the solid, numbered."""
        return ShapeIndex(self.solid, TopAbs_VERTEX)

    @cached_property
    def faces_at_edge(self) -> AncestorMap:
        """The faces at each edge of the solid."""
        return AncestorMap(self.solid, TopAbs_EDGE, TopAbs_FACE)

    @property
    def domain(self) -> tuple[float, float]:
        """The rails' parameter range."""
        breaks = self.blend.surface.breaks[0]
        return float(breaks[0]), float(breaks[-1])

    def get_face_edit(self, face: TopoDS_Face) -> FaceEdit:
        """Return the one record of what becomes of a face."""
        return self.face_edits.setdefault(
            self.face_index.find_number(face), FaceEdit(TopoDS.Face_s(orient_forward(face)))
        )

    # -- rails ---------------------------------------------------------------------------------------------------------

    def make_rail_edge(
        self, i: int, vertices: tuple[TopoDS_Vertex, TopoDS_Vertex], span: tuple[float, float]
    ) -> TopoDS_Edge:
        """Make rail i's edge over a span of t: its 3D curve the blend's own row, with pcurves on both faces."""
        side, curve = self.sides[i], self.rail_pcurves[i]
        middle = curve(np.array([sum(span) / 2]))[0]
        shift = np.zeros(2)
        for axis, period in enumerate(side.face_primary.periods):
            if period is not None:
                shift[axis] = -period * np.floor((middle[axis] - side.bounds[axis, 0]) / period + SEAM_TOLERANCE)
        edge = make_edge(self.occ_rail_curves[i], vertices, span)
        attach_pcurves(edge, side.face, to_shifted_pcurve(curve if span == self.domain else curve.clip(*span), shift))
        attach_pcurves(edge, self.blend_face, Geom2d_Line(gp_Pnt2d(0, i), gp_Dir2d(1, 0)))
        return edge

    def find_seam_crossings(self, i: int) -> Array:
        """Return where rail i crosses seams of its face, in t, ascending."""
        side, curve = self.sides[i], self.rail_pcurves[i]
        found = [np.empty(0)]
        if find_seam_edges(side.face):
            coefs = curve.coefs
            for axis, period in enumerate(side.face_primary.periods):
                if period is None:
                    continue
                weight = coefs[:, 2] if curve.rational else np.ones_like(coefs[:, 0])
                value = coefs[:, axis] / weight
                start = side.bounds[axis, 0]
                for k in range(
                    int(np.floor((value.min() - start) / period)), int(np.ceil((value.max() - start) / period)) + 1
                ):
                    line = start + k * period
                    at_breaks = curve(curve.breaks)[:, axis] - line
                    found.append(curve.breaks[np.abs(at_breaks) < SEAM_TOLERANCE * period])
                    column, root = find_sign_changes(coefs[:, axis] - line * weight, 1e-14 * (1 + abs(line)))
                    found.append(curve.breaks[column] + root * np.diff(curve.breaks)[column])
        t = np.unique(np.concatenate(found))
        low, high = self.domain
        t = t[(t > low + SEAM_TOLERANCE * (high - low)) & (t < high - SEAM_TOLERANCE * (high - low))]
        return t[np.append(True, np.diff(t) > SEAM_TOLERANCE * (high - low))] if len(t) else t

    def _trim_at_rail(
        self,
        i: int,
        span: tuple[float, float],
        vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
        walls: tuple[list[TopoDS_Edge], list[TopoDS_Edge]] = ([], []),
    ) -> list[TopoDS_Edge]:
        """Replace the old edge by rail i in the boundary of its face, split at seams; return the rail's edges.

        Where the blend ends in a cap, its wall leads from the edge to the rail, or back.
        """
        side = self.sides[i]
        rewrite = self.get_face_edit(self.input_sides[i].face)
        crossings = self.find_seam_crossings(i)
        crossings = crossings[(crossings > span[0]) & (crossings < span[1])]
        stops = np.concatenate([span[:1], crossings, span[1:]]).tolist()
        between = [make_vertex(point) for point in self.rail_curves[i](crossings)]
        chain = [vertices[0], *between, vertices[1]]
        rail = [
            self.make_rail_edge(i, (chain[k], chain[k + 1]), (stops[k], stops[k + 1])) for k in range(len(stops) - 1)
        ]
        ahead = (side.outward > 0) == (i == 0)
        path = [*walls[0], *rail, *(reverse_edge(edge) for edge in walls[1])]
        uses = path if ahead else [reverse_edge(edge) for edge in reversed(path)]
        if side is not self.input_sides[i]:
            start = _evaluate_rail(self.blend.ribbons[i], np.array([span[0]]))[1][0]
            BUILDER.Add(side.face, make_sphere_boundary(side, uses[0], start))
            rewrite.replacement_face = side.face
            return rail
        rewrite.added_uses += uses
        rewrite.replaced_edges |= self.edge_remainders
        if vertices[0].IsSame(vertices[1]):
            self._cut_seams(i, rewrite, np.array(stops[:-1]), chain[:-1])
        else:
            self._cut_seams(i, rewrite, crossings, between)
        return rail

    def blend_closed_edge(self) -> ProposedSolid:
        """Blend a closed edge."""
        low, high = self.domain
        joints = [make_vertex(row(np.array([low]))[0]) for row in self.rail_curves]
        rails = (
            self._trim_at_rail(0, self.domain, (joints[0],) * 2),
            self._trim_at_rail(1, self.domain, (joints[1],) * 2),
        )
        seam = make_edge(self.blend_surface.UIso(low), (joints[0], joints[1]), (0.0, 1.0))
        up = gp_Dir2d(0, 1)
        attach_pcurves(seam, self.blend_face, Geom2d_Line(gp_Pnt2d(high, 0), up), Geom2d_Line(gp_Pnt2d(low, 0), up))
        uses = [*rails[0], seam, *(reverse_edge(edge) for edge in reversed(rails[1])), reverse_edge(seam)]
        return self._assemble_solid(make_closed_wire(uses), rails)

    def _cut_seams(self, i: int, rewrite: FaceEdit, stops: Array, vertices: list[TopoDS_Vertex]) -> None:
        """Cut the face's seams where the rail crosses them and drop what lies between rail and edge."""
        side = self.sides[i]
        if not vertices:
            point, field = np.empty((0, 3)), np.empty((0, 3))
        else:
            point, field = _evaluate_rail(self.blend.ribbons[i], stops)
        dropped: list[TopoDS_Vertex] = []
        for edge in find_seam_edges(side.face):
            number = self.edge_index.find_number(edge)
            curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
            first, last = BRep_Tool.Range_s(edge)
            marks: list[tuple[float, TopoDS_Vertex, bool]] = []
            for k, vertex in enumerate(vertices):
                project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*point[k].tolist()), curve, first, last)
                if project.NbPoints() == 0 or project.LowerDistance() > 10 * CONFUSION:
                    continue
                at = project.LowerDistanceParameter()
                ahead = curve.DN(at, 1)
                entering = float(field[k] @ (ahead.X(), ahead.Y(), ahead.Z())) > 0
                marks.append((at, vertex, entering))
                raise_vertex_tolerance(vertex, TOLERANCE_MARGIN * project.LowerDistance())
            marks.sort(key=lambda mark: mark[0])
            start, end = find_end_vertices(edge)
            if not marks:
                touching = [vertex for vertex in (start, end) if any(vertex.IsSame(o) for o in self.removed_vertices)]
                if len(touching) == 1:
                    raise SizeError("the rail passes beyond the end of the face: the size is too large")
                if len(touching) == 2:
                    rewrite.replaced_edges[number] = []
                    dropped += [start, end]
                continue
            stations = [(first, start), *((at, vertex) for at, vertex, _ in marks), (last, end)]
            inside = [not marks[0][2], *(entering for _, _, entering in marks)]
            kept = []
            for (a, va), (b, vb), strip in zip(stations[:-1], stations[1:], inside, strict=True):
                if strip:
                    dropped += [v for v in (va, vb) if v.IsSame(start) or v.IsSame(end)]
                elif b - a > SEAM_TOLERANCE * (last - first):
                    kept.append(make_trimmed_copy(edge, (va, vb), (a, b)))
            rewrite.replaced_edges[number] = kept
        for use in explore_subshapes(rewrite.face, TopAbs_EDGE):  # poles that lost their seam
            if BRep_Tool.Degenerated_s(use) and any(find_end_vertices(use)[0].IsSame(vertex) for vertex in dropped):
                rewrite.replaced_edges[self.edge_index.find_number(use)] = []

    # -- open edges ----------------------------------------------------------------------------------------------------

    def blend_open_edge(self, caps: tuple[float | None, float | None] = (None, None)) -> ProposedSolid:
        """Blend an open edge, ending on the one other face at each of its vertices, or in caps at the given t.

        Raises
        ------
        RailsTooShort
            If the blend must reach further than its rails.
        EndError
            If it cannot end so at one end.
        """
        low, high = (self._build_end(end, cap) for end, cap in enumerate(caps))
        needed = (min(low.rail_parameters), max(high.rail_parameters))
        if needed[0] < self.domain[0] or needed[1] > self.domain[1]:
            raise RailsTooShortError(needed)
        self.edge_remainders = end_cap.make_edge_remainders(self, low, high, caps)
        kept = [vertex for vertex, cap in zip(self.spine.vertices, caps, strict=True) if cap is not None]
        self.removed_vertices = [
            vertex for vertex in self.removed_vertices if not any(vertex.IsSame(one) for one in kept)
        ]
        rails = []
        for i in (0, 1):
            if low.rail_parameters[i] >= high.rail_parameters[i]:
                raise SizeError("the two ends of the blend meet: the size is too large for the length of the edge")
            walls = (low.cap_borders[i], high.cap_borders[i])
            rails.append(
                self._trim_at_rail(
                    i, (low.rail_parameters[i], high.rail_parameters[i]), (low.corners[i], high.corners[i]), walls
                )
            )
        trim_neighbour_edges(self, (*low.edge_trims, *high.edge_trims))
        uses = [*rails[0], high.edge, *(reverse_edge(edge) for edge in reversed(rails[1])), reverse_edge(low.edge)]
        made = [ending.cap for ending in (low, high) if ending.cap is not None]
        return self._assemble_solid(make_closed_wire(uses), (rails[0], rails[1]), made)

    def _build_end(self, end: int, cap: float | None) -> end_on_face.BlendEnd:
        """End the blend at one end of the edge."""
        try:
            return end_on_face.end_on_face(self, end) if cap is None else end_cap.end_in_cap(self, end, cap)
        except (SizeError, TopologyError, GeometryError) as error:
            raise BlendEndError(end, error) from error

    # -- assembling ----------------------------------------------------------------------------------------------------

    def _assemble_solid(
        self,
        boundary: TopoDS_Wire,
        rails: tuple[list[TopoDS_Edge], list[TopoDS_Edge]],
        caps: Sequence[TopoDS_Face] = (),
    ) -> ProposedSolid:
        """Close the blend face, rebuild every face that changed, and put the shell together."""
        BUILDER.Add(self.blend_face, boundary)
        blend = TopoDS.Face_s(self.blend_face.Reversed())
        made = {number: self._rebuild_face(rewrite) for number, rewrite in self.face_edits.items()}
        for number, face in made.items():
            face.Orientation(self.face_index[number].Orientation())
        sides = (
            made[self.face_index.find_number(self.input_sides[0].face)],
            made[self.face_index.find_number(self.input_sides[1].face)],
        )
        for side, rail, ribbon in zip(sides, rails, self.blend.ribbons, strict=True):
            for edge in rail:
                BUILDER.Continuity(edge, side, blend, CONTINUITY_FLAGS[min(ribbon.order, 2)])
        tolerance = raise_edge_tolerances([*made.values(), blend, *caps], self.edge_index, self.vertex_index)
        solid = replace_solid_faces(self.solid, made, self.face_index, [blend, *caps])
        return ProposedSolid(solid, blend, sides, rails, len(caps), tolerance)

    def _rebuild_face(self, rewrite: FaceEdit) -> TopoDS_Face:
        """Return the FORWARD face with its new boundary; wires that nothing happens to are taken over."""
        if rewrite.replacement_face is not None:
            return rewrite.replacement_face
        face = TopoDS.Face_s(rewrite.face.EmptyCopied())
        loose = list(rewrite.added_uses)
        for wire in explore_subshapes(rewrite.face, TopAbs_WIRE):
            uses = list(explore_subshapes(wire, TopAbs_EDGE))
            if not any(self.edge_index.find_number(use) in rewrite.replaced_edges for use in uses):
                BUILDER.Add(face, wire)
                continue
            for use in uses:
                pieces = rewrite.replaced_edges.get(self.edge_index.find_number(use))
                loose += [use] if pieces is None else [_orient_like(piece, use) for piece in pieces]
        for loop in trace_loops(loose, rewrite.face):
            BUILDER.Add(face, make_closed_wire(loop))
        return face


def _orient_like(piece: TopoDS_Edge, use: TopoDS_Edge) -> TopoDS_Edge:
    return TopoDS.Edge_s(piece.Oriented(use.Orientation()))


def _evaluate_rail(rail: Ribbon, t: Array) -> tuple[Array, Array]:
    """Return points and directions into the blend (n, 3) along a rail."""
    point, direction = dehomogenise_jets(np.stack([jet(t) for jet in rail.compose_jets()[:2]]))
    return point, direction


def trace_loops(uses: list[TopoDS_Edge], face: TopoDS_Face) -> list[list[TopoDS_Edge]]:
    """Sort edge uses of a FORWARD face into closed loops: head to tail at vertices, and where several wait, in (u, v).

    Raises
    ------
    TopologyError
        If a loop does not close: the new boundary crosses itself or swallows an edge.
    """
    ends = [find_end_uv(use, face) for use in uses]
    vertices = ShapeIndex.from_shapes(uses, TopAbs_VERTEX)
    starts, stops = zip(*(map(vertices.find_number, find_end_vertices(use)) for use in uses), strict=True)

    def measure_gap(one: int, following: int) -> float:
        return float(np.abs(ends[following][0] - ends[one][1]).max())

    loops = chain_segments(starts, stops, measure_gap, until_closed=True)
    if any(stops[loop[-1]] != starts[loop[0]] for loop in loops):
        raise TopologyError("the face's boundary cannot be closed along the rail: the size is too large for the face")
    return [[uses[k] for k in loop] for loop in loops]


def to_shifted_pcurve(curve: Curve, shift: Array) -> Geom2d_Curve:
    """Return a parameter curve as an OCCT pcurve, shifted by whole periods."""
    degree, knots, poles, weights = curve.to_bspline()
    return spline_arrays.curve2d_from_arrays(degree, knots, poles + shift, weights)
