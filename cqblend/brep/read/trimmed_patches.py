"""Faces of OCCT as patches to be unrolled: symbolic surfaces, loops in their parameter planes, shared edges.

The only reader of shapes that unrolling has. It decides orientation once (material on the left of every loop, the outer
side known), brings every pcurve into the parameters of the face's spline, and measures how well both agree. Must not
know what is made of the patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepGProp import BRepGProp
from OCP.Geom import (
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.read.sampled_curve import SampledCurve, read_sampled_curve
from cqblend.brep.read.spline_conversion import ParameterMap, to_surface_with_map
from cqblend.brep.read.unshared_edges import sew_faces
from cqblend.brep.shape_kinds import is_topods
from cqblend.brep.topology import (
    ShapeIndex,
    chain_segments,
    explore_subshapes,
    find_end_vertices,
    locate_vertex,
    make_compound,
    orient_forward,
)
from cqblend.errors import CqblendError, InputError, SelectionError, TopologyError, shown
from cqblend.patterns.trim import coplanar_patches
from cqblend.patterns.trim.trimmed_patch import (
    CurveFunction,
    EdgeUse,
    FaceKind,
    Loop,
    Patch,
    PatchEdge,
    PatchShell,
    PlaneFrame,
)
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array

PLANARITY_TOLERANCE = 1e-9
"""Largest distance of a spline surface's poles from a plane, relative to its size, for it to count as planar."""

_KINDS: dict[type[Geom_Surface], FaceKind] = {
    Geom_Plane: "plane",
    Geom_CylindricalSurface: "cylinder",
    Geom_ConicalSurface: "cone",
    Geom_SphericalSurface: "sphere",
    Geom_ToroidalSurface: "torus",
    Geom_SurfaceOfLinearExtrusion: "extrusion",
    Geom_SurfaceOfRevolution: "revolution",
}
_BOUNDARY_ORIENTATIONS = (TopAbs_FORWARD, TopAbs_REVERSED)
_LOOP_SLACK = 1e-2
"""How far, relative to the face, a loop may pass its surface's window, or neighbours in a loop be apart.

Tolerant shapes from files need it; what it costs is told by the gap of the edge. Loops are drawn back to the border.
"""

_SAMPLE_SHARES = np.append(np.linspace(0.0, 1.0, 33), [0.4995, 0.5005])
"""Parts of an edge's range at which curves and pcurves are compared; the last two tell its direction in the middle."""

_MIDDLE_SAMPLE = 16

_AREA_TOLERANCE = 1e-5
"""Of a face's area, relative, that OCCT is asked for."""


def read_patches(
    source: TopoDS_Shape | Sequence[TopoDS_Face],
    *,
    whole: TopoDS_Shape | None = None,
    merge: bool = True,
    join: float | None = None,
) -> PatchShell:
    """Return the faces of a shape, or some faces of it, as patches with their edges.

    Closed faces are as OCCT has them: a seam is an edge that one loop uses twice. A face without wires gets its natural
    boundary.

    Parameters
    ----------
    source
        A shape of any kind with faces in it, or faces; faces that share edges are joined there.
    whole
        The shape whose numbers faces and edges get, if the source is a part of it.
    merge
        Whether neighbouring faces of one plane become one patch.
    join
        Distance within which borders of faces that share no edge are one, mm; None leaves them as they are.

    Returns
    -------
    Skin
        Faces that could not be read are named in its ``refused``, with the reason.

    Raises
    ------
    InputError
        Something is not a shape, or is null.
    SelectionError
        There is no face in it, or a face is not of the whole shape.
    TopologyError
        More than two faces meet at an edge.

    Examples
    --------
    >>> import cadquery as cq
    >>> skin = read(cq.Workplane().cylinder(2.0, 1.0).val().wrapped)
    >>> [(patch.index, patch.kind, len(patch.loops[0])) for patch in skin.patches]
    [(1, 'cylinder', 4), (2, 'plane', 1), (3, 'plane', 1)]
    >>> sorted(edge.faces for edge in skin.edges.values())
    [(1, 1), (1, 2), (1, 3)]
    """
    shapes = [source] if isinstance(source, TopoDS_Shape) else list(source)
    for shape in shapes:
        if not is_topods(shape):
            what = "a null shape" if isinstance(shape, TopoDS_Shape) else shown(shape)
            raise InputError(f"cannot unroll {what}: give a shape, or faces of one")
    part = shapes[0] if len(shapes) == 1 else make_compound(shapes)
    whole = part if whole is None else whole
    numbers = ShapeIndex(whole, TopAbs_FACE)
    faces = {numbers.find_number(face): face for face in reversed(list(explore_subshapes(part, TopAbs_FACE)))}
    if not faces:
        raise SelectionError("there is nothing to unroll: the selection has no face")
    if 0 in faces:
        raise SelectionError("a face does not belong to the shape: select faces of the very shape that is unrolled")
    faces = {number: _add_natural_boundary(faces[number]) for number in sorted(faces)}
    reader = _PatchReader(make_compound([whole, *faces.values()]))
    if join is not None:
        sewn = sew_faces(faces, join)
        if any(not sewn[number].IsSame(face) for number, face in faces.items()):
            faces, reader = sewn, _PatchReader(make_compound([*sewn.values()]))
    patches: list[Patch] = []
    refused: dict[int, CqblendError] = {}
    for number, face in faces.items():
        try:
            patches.append(reader.read_patch(number, face))
        except CqblendError as error:
            refused[number] = error.with_details(shape=f"face {number}")
    skin = reader.assemble_patches(patches, refused)
    return coplanar_patches.merge_coplanar_patches(skin) if merge else skin


class _PatchReader:
    """Edges of one shape, numbered, and read when a face first asks for them."""

    def __init__(self, shape: TopoDS_Shape) -> None:
        self._index, self._vertices = ShapeIndex(shape, TopAbs_EDGE), ShapeIndex(shape, TopAbs_VERTEX)
        self._tracks: dict[int, SampledCurve | None] = {}
        self._points: dict[int, CurveFunction] = {}

    def read_patch(self, number: int, face: TopoDS_Face) -> Patch:
        """Read a face; what is wrong with it is told without its number."""
        chart = _ParameterPlane.from_face(face)
        loops = []
        for wire in explore_subshapes(chart.face, TopAbs_WIRE):
            drawn = [
                self._read_edge_use(use, chart)
                for use in explore_subshapes(wire, TopAbs_EDGE)
                if use.Orientation() in _BOUNDARY_ORIENTATIONS
            ]
            if drawn:
                loops.append(chart.build_loop(_chain_uses(drawn, chart.extent)))
        if not loops:
            raise TopologyError("it has no boundary")
        area = _measure_area(chart.face)
        if chart.frame is not None:
            return coplanar_patches.make_planar_patch((number,), chart.frame, loops, area, chart.off)
        return Patch(
            (number,), chart.kind, chart.surface, chart.outward, coplanar_patches.sort_outer_first(loops), area=area
        )

    def assemble_patches(self, patches: list[Patch], refused: dict[int, CqblendError]) -> PatchShell:
        """Return patches with all their edges, measured."""
        witnesses: dict[int, list[_UseSamples]] = {}
        for patch in patches:
            for number, witness in _sample_edge_uses(patch):
                witnesses.setdefault(number, []).append(witness)
        edges = {number: self._build_edge(number, witnesses[number]) for number in sorted(witnesses)}
        vertices = sorted({vertex for edge in edges.values() for vertex in edge.vertices})
        points = {vertex: locate_vertex(self._vertices[vertex]) for vertex in vertices}
        return PatchShell(tuple(patches), edges, points, refused)

    def _read_edge_use(self, use: TopoDS_Edge, chart: _ParameterPlane) -> _LoopSegment:
        number = self._index.find_number(use)
        if number not in self._tracks:
            self._tracks[number] = _read_space_curve(use)
            if self._tracks[number] is None:
                self._points[number] = chart.map_to_space(_read_pcurve(number, use, chart.face))
        space = self._tracks[number]
        at: CurveFunction
        if chart.frame is None:
            at = flat = _read_pcurve(number, use, chart.face)
            breaks = flat.breaks
        else:
            at = coplanar_patches.project_to_plane(chart.frame, space or self._points[number])
            breaks = np.array(BRep_Tool.Range_s(use)) if space is None else space.breaks
        start, stop = (self._vertices.find_number(vertex) for vertex in find_end_vertices(use))
        along, degenerate = use.Orientation() == TopAbs_FORWARD, bool(BRep_Tool.Degenerated_s(use))
        return _LoopSegment(EdgeUse(number, along, at, breaks, degenerate), start, stop)

    def _build_edge(self, number: int, witnesses: list[_UseSamples]) -> PatchEdge:
        faces = tuple(witness.face for witness in witnesses)
        if len(faces) > 2:
            raise TopologyError(
                f"faces {', '.join(map(str, faces))} all meet at edge {number}; no more than two can be unrolled in one"
                " piece of skin: unroll them in two goes"
            )
        space, use = self._tracks[number], witnesses[0].use
        points: CurveFunction = space or self._points[number]
        breaks = use.breaks if space is None else space.breaks
        at = points(_sample_range(breaks))
        first, last = (
            self._vertices.find_number(vertex)
            for vertex in find_end_vertices(TopoDS.Edge_s(orient_forward(self._index[number])))
        )
        return PatchEdge(
            index=number,
            points=points,
            breaks=breaks,
            curve=None if space is None else space.curve,
            parameter=_identity_map if space is None else space.to_curve_parameter,
            vertices=(first, last),
            faces=faces,
            angle=_measure_normal_turn(at[-1] - at[-2], witnesses),
            gap=max(float(np.linalg.norm(witness.points - at, axis=1).max()) for witness in witnesses),
            degenerate=use.degenerate,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _LoopSegment:
    """A use in the window of a chart, and the numbers of the vertices at which the loop enters and leaves it."""

    use: EdgeUse
    start_vertex: int
    stop_vertex: int


@dataclass(frozen=True, slots=True, eq=False)
class _ParameterPlane:
    """The plane in which the uses of a face are drawn, and the way from there to that of its patch.

    It is the plane of the face's own parameters, over ``window`` ((u0, u1), (v0, v1)), or that of the frame. If it is
    ``mirrored``, the patch sees it from the other side.
    """

    face: TopoDS_Face
    kind: FaceKind
    surface: Surface
    parameters: ParameterMap
    outward: bool
    mirrored: bool
    window: Array
    periods: tuple[float, float] = (0.0, 0.0)
    frame: PlaneFrame | None = None
    off: float = 0.0

    @classmethod
    def from_face(cls, face: TopoDS_Face) -> _ParameterPlane:
        """Read the surface of a face."""
        outward = (face.Orientation() == TopAbs_REVERSED) == bool(face.Location().Transformation().IsNegative())
        face = TopoDS.Face_s(orient_forward(face))
        surface, parameters = to_surface_with_map(face)
        window = np.array(surface.domain)
        frame = _find_plane(surface)
        if frame is not None:
            if not outward:
                frame = PlaneFrame(frame.origin, frame.y, frame.x)
            off = _bound_plane_distance(surface, frame)
            return cls(face, "plane", surface, parameters, True, not outward, window, frame=frame, off=off)
        basis = BRep_Tool.Surface_s(face, TopLoc_Location())
        while isinstance(basis, Geom_RectangularTrimmedSurface):
            basis = basis.BasisSurface()
        kind: FaceKind = next((word for of_kind, word in _KINDS.items() if isinstance(basis, of_kind)), "freeform")
        periods = (basis.UPeriod() if basis.IsUPeriodic() else 0.0, basis.VPeriod() if basis.IsVPeriodic() else 0.0)
        mirrored = _is_linear(surface, 0) and not _is_linear(surface, 1)
        if mirrored:
            surface, outward = surface.transpose(), not outward
        return cls(face, kind, surface, parameters, outward, mirrored, window, periods)

    @property
    def extent(self) -> Array:
        """How large the face is in the plane in which its uses are drawn, (2,)."""
        if self.frame is None:
            return np.diff(self.window, axis=1)[:, 0]
        return np.full(2, np.ptp(_extract_bezier_poles(self.surface), axis=0).max())

    def map_to_space(self, pcurve: CurveFunction) -> CurveFunction:
        """Return a curve in the face's own parameters as one in space, laid on the surface."""
        surface = self.surface.transpose() if self.mirrored and self.frame is None else self.surface

        def evaluate_points(t: Array) -> Array:
            uv = self.parameters.to_spline(pcurve(t))
            return surface(uv[:, 0], uv[:, 1])

        return evaluate_points

    def build_loop(self, uses: list[EdgeUse]) -> Loop:
        """Return the loop of the patch that a loop of drawn uses is."""
        if self.frame is None:
            shift = self._find_period_shift(uses)
            uses = [replace(use, pcurve=self._map_pcurve(use.pcurve, shift)) for use in uses]
        return tuple(use.reversed_use for use in uses[::-1]) if self.mirrored else tuple(uses)

    def _find_period_shift(self, uses: list[EdgeUse]) -> Array:
        """Return the whole periods, (2,), that bring a loop into the window."""
        points = np.concatenate([use.pcurve(_sample_range(use.breaks)) for use in uses])
        low, high = points.min(axis=0), points.max(axis=0)
        (start, stop), slack = self.window.T, _LOOP_SLACK * self.extent
        periods = np.array(self.periods)
        off = (low < start - slack) | (high > stop + slack)
        count = np.divide((start + stop - low - high) / 2, periods, out=np.zeros(2), where=off & (periods > 0))
        shift = periods * np.round(count)
        beyond = np.maximum(start - low - shift, high + shift - stop)
        if (beyond > slack).any():
            raise TopologyError(
                f"the loop of edges {', '.join(str(use.edge) for use in uses)} leaves the parameters of the surface by "
                f"{beyond.max():.3g}: heal the shape (ShapeFix_Shape) first"
            )
        return shift

    def _map_pcurve(self, pcurve: CurveFunction, shift: Array) -> CurveFunction:
        """Return a curve in the face's own parameters as one in those of the patch's surface."""

        def map_parameters(t: Array) -> Array:
            uv = np.clip(self.parameters.to_spline(pcurve(t) + shift), self.window[:, 0], self.window[:, 1])
            return uv[:, ::-1] if self.mirrored else uv

        return map_parameters


@dataclass(frozen=True, slots=True, eq=False)
class _UseSamples:
    """What one use says of its edge at the witnesses: points in space, and in the middle the unit outer normal."""

    face: int
    use: EdgeUse
    points: Array
    normal: Array
    is_material_left: bool
    """Whether the material, seen from outside, is on the left of increasing t."""


def _sample_edge_uses(patch: Patch) -> list[tuple[int, _UseSamples]]:
    uses = [use for loop in patch.loops for use in loop]
    uv = np.stack([use.pcurve(_sample_range(use.breaks)) for use in uses])
    jet = patch.surface.jet(uv[..., 0], uv[..., 1], 1)
    normals = np.cross(jet[1, 0, :, _MIDDLE_SAMPLE], jet[0, 1, :, _MIDDLE_SAMPLE]) * (1.0 if patch.outward else -1.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    sizes = np.linalg.norm(jet[1, 0], axis=-1).max() * np.linalg.norm(jet[0, 1], axis=-1).max()
    normals = np.divide(normals, lengths, out=np.full(normals.shape, np.nan), where=lengths > 1e-12 * sizes)
    return [
        (use.edge, _UseSamples(patch.index, use, points, normal, use.forward == patch.outward))
        for use, points, normal in zip(uses, jet[0, 0], normals, strict=True)
    ]


def _measure_normal_turn(direction: Array, witnesses: list[_UseSamples]) -> float:
    """Return the turn of the outer normal across an edge, positive if it is convex."""
    if (
        len(witnesses) < 2
        or witnesses[0].is_material_left == witnesses[1].is_material_left
        or witnesses[0].use.degenerate
    ):
        return np.nan
    first, second = witnesses if witnesses[0].is_material_left else witnesses[::-1]
    across = np.cross(first.normal, second.normal)
    angle = np.arctan2(np.linalg.norm(across), first.normal @ second.normal)
    return float(np.copysign(angle, across @ direction))


def _chain_uses(drawn: list[_LoopSegment], extent: Array) -> list[EdgeUse]:
    """Return uses in such an order that each starts where the one before ends."""
    uses, ends = [one.use for one in drawn], [one.use.ends for one in drawn]

    def measure_gap(one: int, following: int) -> float:
        return float(np.abs((ends[one][1] - ends[following][0]) / extent).max())

    # a loop of which edges share no vertex comes as several chains
    chains = chain_segments([one.start_vertex for one in drawn], [one.stop_vertex for one in drawn], measure_gap)
    loop = [k for chain in chains for k in chain]
    for one, following in pairwise([*loop, loop[0]]):
        if not measure_gap(one, following) <= _LOOP_SLACK:
            raise TopologyError(
                f"its loop does not close between edges {uses[one].edge} and {uses[following].edge}: heal the shape "
                "(ShapeFix_Shape) first"
            )
    return [uses[k] for k in loop]


def _read_space_curve(edge: TopoDS_Edge) -> SampledCurve | None:
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    return None if curve is None else read_sampled_curve(curve, *BRep_Tool.Range_s(edge))


def _read_pcurve(number: int, use: TopoDS_Edge, face: TopoDS_Face) -> SampledCurve:
    curve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    if curve is None:
        raise TopologyError(f"edge {number} has no curve in its parameters: heal the shape (ShapeFix_Shape) first")
    span, own = BRep_Tool.Range_s(use), BRep_Tool.Range_s(use, face)
    if max(abs(a - b) for a, b in zip(span, own, strict=True)) > 1e-9 * (span[1] - span[0]):
        raise TopologyError(
            f"edge {number} runs over {own} in its parameters but over {span} in space: heal the shape"
            " (BRepLib.SameParameter) first"
        )
    return read_sampled_curve(curve, *span)


def _find_plane(surface: Surface) -> PlaneFrame | None:
    """Return the plane of a surface that is flat and nowhere folded, with Su x Sv along its normal; else None."""
    (u0, u1), (v0, v1) = surface.domain
    jet = surface.jet((u0 + u1) / 2, (v0 + v1) / 2, 1)
    normal, poles = np.cross(jet[1, 0], jet[0, 1]), _extract_bezier_poles(surface)
    length = float(np.linalg.norm(normal))
    if (
        not length > 0
        or np.abs((poles - jet[0, 0]) @ normal).max() > PLANARITY_TOLERANCE * np.ptp(poles, axis=0).max() * length
    ):
        return None
    u, v = np.linspace(u0, u1, 9), np.linspace(v0, v1, 9)
    if (np.cross(surface.grid(u, v, 1, 0), surface.grid(u, v, 0, 1)) @ normal < 0).any():
        return None
    x = jet[1, 0] / np.linalg.norm(jet[1, 0])
    return PlaneFrame(surface(u0, v0), x, np.cross(normal / length, x))


def _bound_plane_distance(surface: Surface, frame: PlaneFrame) -> float:
    """Bound the distance of a surface from a plane, rounding included."""
    poles = _extract_bezier_poles(surface)
    return float(np.abs((poles - frame.origin) @ frame.normal).max() + 8 * np.finfo(float).eps * np.abs(poles).max())


def _measure_area(face: TopoDS_Face) -> float:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties, _AREA_TOLERANCE)
    return abs(properties.Mass())


def _extract_bezier_poles(surface: Surface) -> Array:
    """Return the Bezier poles (n, 3)."""
    poles = np.moveaxis(surface.coefs, 2, -1).reshape(-1, surface.coefs.shape[2])
    return poles[:, :3] / poles[:, 3:] if surface.rational else poles


def _is_linear(surface: Surface, axis: int) -> bool:
    return surface.degree[axis] == 1 and len(surface.breaks[axis]) == 2


def _sample_range(breaks: Array) -> Array:
    return np.asarray(breaks[0] + _SAMPLE_SHARES * (breaks[-1] - breaks[0]))


def _identity_map(t: Array) -> Array:
    return t


def _add_natural_boundary(face: TopoDS_Face) -> TopoDS_Face:
    """Return a face with wires: itself, or one with the natural boundary of its surface."""
    surface = BRep_Tool.Surface_s(face)
    if surface is None or next(explore_subshapes(face, TopAbs_WIRE), None) is not None:
        return face
    maker = BRepBuilderAPI_MakeFace(surface, BRep_Tool.Tolerance_s(face))
    return TopoDS.Face_s(maker.Face().Oriented(face.Orientation())) if maker.IsDone() else face
