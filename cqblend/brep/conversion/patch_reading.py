"""Read faces of OCCT as patches to be unrolled: symbolic surfaces, loops in their parameter planes, shared edges.

It is the only reader of shapes that unrolling has. It decides orientation once (material on the left of every loop, the
outer side known), converts every pcurve to the parameters of the face's spline, and measures how well both agree.
Depends on the data structures of :mod:`cqblend.patterns.trimming`, not on flattening.
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

from cqblend.brep.conversion.sampled_curve import SampledCurve, read_sampled_curve
from cqblend.brep.conversion.sewing import sew_faces
from cqblend.brep.conversion.spline_conversion import ParameterMap, to_surface_with_map
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
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
from cqblend.patterns.trimming import coplanar_patches
from cqblend.patterns.trimming.trimmed_patch import (
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

_EDGE_SAMPLE_SHARES = np.append(np.linspace(0.0, 1.0, 33), [0.4995, 0.5005])
"""Parts of an edge's range at which its curve and the pcurves of its uses are compared.

The last two tell the direction of the edge in its middle, which is sample :data:`_MIDDLE_SAMPLE`.
"""

_MIDDLE_SAMPLE = 16


def read_patches(
    source: TopoDS_Shape | Sequence[TopoDS_Face],
    *,
    numbered_shape: TopoDS_Shape | None = None,
    merge_coplanar: bool = True,
    sewing_tolerance: float | None = None,
) -> PatchShell:
    """Return the faces of a shape, or some faces of it, as patches with their edges.

    Closed faces are as OCCT has them: a seam is an edge that one loop uses twice. A face without wires gets its natural
    boundary.

    Parameters
    ----------
    source
        A shape of any kind with faces in it, or faces; faces that share edges are joined there.
    numbered_shape
        The shape whose numbers faces and edges get, if the source is a part of it.
    merge_coplanar
        Whether neighbouring faces of one plane become one patch.
    sewing_tolerance
        Distance within which borders of faces that share no edge are joined, mm; None leaves them as they are.

    Returns
    -------
    PatchShell
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
    >>> shell = read_patches(cq.Workplane().cylinder(2.0, 1.0).val().wrapped)
    >>> [(patch.index, patch.kind, len(patch.loops[0])) for patch in shell.patches]
    [(1, 'cylinder', 4), (2, 'plane', 1), (3, 'plane', 1)]
    >>> sorted(edge.faces for edge in shell.edges.values())
    [(1, 1), (1, 2), (1, 3)]
    """
    shapes = [source] if isinstance(source, TopoDS_Shape) else list(source)
    for shape in shapes:
        if not is_topods(shape):
            what = "a null shape" if isinstance(shape, TopoDS_Shape) else shown(shape)
            raise InputError(f"cannot unroll {what}: give a shape, or faces of one")
    part = shapes[0] if len(shapes) == 1 else make_compound(shapes)
    numbered_shape = part if numbered_shape is None else numbered_shape
    numbers = ShapeIndex(numbered_shape, TopAbs_FACE)
    faces = {numbers.find_number(face): face for face in reversed(list(explore_subshapes(part, TopAbs_FACE)))}
    if not faces:
        raise SelectionError("there is nothing to unroll: the selection has no face")
    if 0 in faces:
        raise SelectionError("a face does not belong to the shape: select faces of the very shape that is unrolled")
    faces = {number: _add_natural_boundary(faces[number]) for number in sorted(faces)}
    reader = _PatchReader(make_compound([numbered_shape, *faces.values()]))
    if sewing_tolerance is not None:
        sewn = sew_faces(faces, sewing_tolerance)
        if any(not sewn[number].IsSame(face) for number, face in faces.items()):
            faces, reader = sewn, _PatchReader(make_compound([*sewn.values()]))
    patches: list[Patch] = []
    refused: dict[int, CqblendError] = {}
    for number, face in faces.items():
        try:
            patches.append(reader.read_patch(number, face))
        except CqblendError as error:
            refused[number] = error.with_details(shape=f"face {number}")
    shell = reader.assemble_patches(patches, refused)
    return coplanar_patches.merge_coplanar_patches(shell) if merge_coplanar else shell


class _PatchReader:
    """Reads faces of one shape, and each of its edges once: when the first face that uses it is read."""

    def __init__(self, shape: TopoDS_Shape) -> None:
        self._edge_index, self._vertex_index = ShapeIndex(shape, TopAbs_EDGE), ShapeIndex(shape, TopAbs_VERTEX)
        self._space_curves: dict[int, SampledCurve | None] = {}  # by edge number; None of a degenerate edge
        self._surface_curves: dict[int, CurveFunction] = {}  # of edges without a curve in space: pcurve on the surface

    def read_patch(self, number: int, face: TopoDS_Face) -> Patch:
        """Read a face; errors do not name it."""
        plane = _ParameterPlane.from_face(face)
        loops = []
        for wire in explore_subshapes(plane.face, TopAbs_WIRE):
            segments = [
                self._read_edge_use(use, plane)
                for use in explore_subshapes(wire, TopAbs_EDGE)
                if use.Orientation() in _BOUNDARY_ORIENTATIONS
            ]
            if segments:
                loops.append(plane.build_loop(_chain_uses(segments, plane.extent)))
        if not loops:
            raise TopologyError("it has no boundary")
        area = _measure_area(plane.face)
        if plane.frame is not None:
            return coplanar_patches.make_planar_patch((number,), plane.frame, loops, area, plane.plane_deviation)
        return Patch(
            (number,), plane.kind, plane.surface, plane.outward, coplanar_patches.sort_outer_first(loops), area=area
        )

    def assemble_patches(self, patches: list[Patch], refused: dict[int, CqblendError]) -> PatchShell:
        """Return patches with all their edges, measured."""
        samples: dict[int, list[_UseSamples]] = {}
        for patch in patches:
            for number, one in _sample_edge_uses(patch):
                samples.setdefault(number, []).append(one)
        edges = {number: self._build_edge(number, samples[number]) for number in sorted(samples)}
        vertices = sorted({vertex for edge in edges.values() for vertex in edge.vertices})
        points = {vertex: locate_vertex(self._vertex_index[vertex]) for vertex in vertices}
        return PatchShell(tuple(patches), edges, points, refused)

    def _read_edge_use(self, use: TopoDS_Edge, plane: _ParameterPlane) -> _LoopSegment:
        number = self._edge_index.find_number(use)
        if number not in self._space_curves:
            self._space_curves[number] = _read_space_curve(use)
            if self._space_curves[number] is None:
                self._surface_curves[number] = plane.map_to_space(_read_pcurve(number, use, plane.face))
        space = self._space_curves[number]
        pcurve: CurveFunction
        if plane.frame is None:
            sampled = _read_pcurve(number, use, plane.face)
            pcurve, breaks = sampled, sampled.breaks
        else:
            pcurve = coplanar_patches.project_to_plane(plane.frame, space or self._surface_curves[number])
            breaks = np.array(BRep_Tool.Range_s(use)) if space is None else space.breaks
        start, stop = (self._vertex_index.find_number(vertex) for vertex in find_end_vertices(use))
        is_forward, degenerate = use.Orientation() == TopAbs_FORWARD, bool(BRep_Tool.Degenerated_s(use))
        return _LoopSegment(EdgeUse(number, is_forward, pcurve, breaks, degenerate), start, stop)

    def _build_edge(self, number: int, samples: list[_UseSamples]) -> PatchEdge:
        """Return an edge, measured on the samples of all its uses."""
        faces = tuple(one.face for one in samples)
        if len(faces) > 2:
            raise TopologyError(
                f"faces {', '.join(map(str, faces))} all meet at edge {number}; no more than two can be unrolled in one"
                " piece of skin: unroll them in two goes"
            )
        space, use = self._space_curves[number], samples[0].use
        points: CurveFunction = space or self._surface_curves[number]
        breaks = use.breaks if space is None else space.breaks
        at = points(_sample_range(breaks))
        first, last = (
            self._vertex_index.find_number(vertex)
            for vertex in find_end_vertices(TopoDS.Edge_s(orient_forward(self._edge_index[number])))
        )
        return PatchEdge(
            index=number,
            points=points,
            breaks=breaks,
            curve=None if space is None else space.curve,
            parameter=_identity_map if space is None else space.to_curve_parameter,
            vertices=(first, last),
            faces=faces,
            angle=_measure_normal_turn(at[-1] - at[-2], samples),
            gap=max(float(np.linalg.norm(one.points - at, axis=1).max()) for one in samples),
            degenerate=use.degenerate,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _LoopSegment:
    """A use of an edge with its pcurve in a parameter plane, and the vertices at which it starts and stops."""

    use: EdgeUse
    start_vertex: int
    stop_vertex: int


@dataclass(frozen=True, slots=True, eq=False)
class _ParameterPlane:
    """The plane of the pcurves of a face's edges, and their conversion to the parameter plane of its patch.

    It is the plane of the face's own parameters, over ``window`` ((u0, u1), (v0, v1)), or if the face is planar that of
    ``frame``, from which the face is at most ``plane_deviation`` (mm) away. If ``is_swapped``, the patch has the same
    parameters with u and v swapped, and so the other orientation.
    """

    face: TopoDS_Face
    kind: FaceKind
    surface: Surface
    parameters: ParameterMap
    outward: bool
    is_swapped: bool
    window: Array
    periods: tuple[float, float] = (0.0, 0.0)
    frame: PlaneFrame | None = None
    plane_deviation: float = 0.0

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
            deviation = _bound_plane_distance(surface, frame)
            return cls(
                face, "plane", surface, parameters, True, not outward, window, frame=frame, plane_deviation=deviation
            )
        basis = BRep_Tool.Surface_s(face, TopLoc_Location())
        while isinstance(basis, Geom_RectangularTrimmedSurface):
            basis = basis.BasisSurface()
        kind: FaceKind = next((word for of_kind, word in _KINDS.items() if isinstance(basis, of_kind)), "freeform")
        periods = (basis.UPeriod() if basis.IsUPeriodic() else 0.0, basis.VPeriod() if basis.IsVPeriodic() else 0.0)
        is_swapped = _is_linear(surface, 0) and not _is_linear(surface, 1)
        if is_swapped:
            surface, outward = surface.transpose(), not outward
        return cls(face, kind, surface, parameters, outward, is_swapped, window, periods)

    @property
    def extent(self) -> Array:
        """Size of the face in the plane, (2,)."""
        if self.frame is None:
            return np.diff(self.window, axis=1)[:, 0]
        return np.full(2, np.ptp(_extract_bezier_poles(self.surface), axis=0).max())

    def map_to_space(self, pcurve: CurveFunction) -> CurveFunction:
        """Return the curve in space that a curve in the face's own parameters is on the surface."""
        surface = self.surface.transpose() if self.is_swapped and self.frame is None else self.surface

        def evaluate_points(t: Array) -> Array:
            uv = self.parameters.to_spline(pcurve(t))
            return surface(uv[:, 0], uv[:, 1])

        return evaluate_points

    def build_loop(self, uses: list[EdgeUse]) -> Loop:
        """Convert a loop of the plane to the parameter plane of the patch."""
        if self.frame is None:
            shift = self._find_period_shift(uses)
            uses = [replace(use, pcurve=self._map_pcurve(use.pcurve, shift)) for use in uses]
        return tuple(use.reversed_use for use in uses[::-1]) if self.is_swapped else tuple(uses)

    def _find_period_shift(self, uses: list[EdgeUse]) -> Array:
        """Return the shift (2,) by whole periods that moves a loop into the window."""
        points = np.concatenate([use.pcurve(_sample_range(use.breaks)) for use in uses])
        low, high = points.min(axis=0), points.max(axis=0)
        (start, stop), slack = self.window.T, CONVERSION_TOLERANCES.loop_slack * self.extent
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
        """Convert a curve from the face's own parameters to those of the patch, clipped to the surface's domain."""

        def map_parameters(t: Array) -> Array:
            uv = np.clip(self.parameters.to_spline(pcurve(t) + shift), self.window[:, 0], self.window[:, 1])
            return uv[:, ::-1] if self.is_swapped else uv

        return map_parameters


@dataclass(frozen=True, slots=True, eq=False)
class _UseSamples:
    """One use of an edge, sampled on its face: points in space (n, 3), and in the middle the unit outer normal."""

    face: int
    use: EdgeUse
    points: Array
    normal: Array
    is_material_left: bool
    """Whether the material, seen from outside, is on the left of increasing t."""


def _sample_edge_uses(patch: Patch) -> list[tuple[int, _UseSamples]]:
    """Return every use of an edge on a patch, as the edge's number and the samples of the use."""
    uses = [use for loop in patch.loops for use in loop]
    uv = np.stack([use.pcurve(_sample_range(use.breaks)) for use in uses])
    jet = patch.surface.jet(uv[..., 0], uv[..., 1], 1)
    normals = np.cross(jet[1, 0, :, _MIDDLE_SAMPLE], jet[0, 1, :, _MIDDLE_SAMPLE]) * (1.0 if patch.outward else -1.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    sizes = np.linalg.norm(jet[1, 0], axis=-1).max() * np.linalg.norm(jet[0, 1], axis=-1).max()
    normals = np.divide(
        normals,
        lengths,
        out=np.full(normals.shape, np.nan),
        where=lengths > CONVERSION_TOLERANCES.degenerate_normal * sizes,
    )
    return [
        (use.edge, _UseSamples(patch.index, use, points, normal, use.forward == patch.outward))
        for use, points, normal in zip(uses, jet[0, 0], normals, strict=True)
    ]


def _measure_normal_turn(direction: Array, samples: list[_UseSamples]) -> float:
    """Return the angle (rad) between the outer normals of an edge's faces, positive if convex; NaN at a border."""
    if len(samples) < 2 or samples[0].is_material_left == samples[1].is_material_left or samples[0].use.degenerate:
        return np.nan
    first, second = samples if samples[0].is_material_left else samples[::-1]
    across = np.cross(first.normal, second.normal)
    angle = np.arctan2(np.linalg.norm(across), first.normal @ second.normal)
    return float(np.copysign(angle, across @ direction))


def _chain_uses(segments: list[_LoopSegment], extent: Array) -> list[EdgeUse]:
    """Return uses in such an order that each starts where the one before ends."""
    uses, ends = [one.use for one in segments], [one.use.ends for one in segments]

    def measure_gap(one: int, following: int) -> float:
        return float(np.abs((ends[one][1] - ends[following][0]) / extent).max())

    # where neighbours share no vertex, as in files, the loop comes as several chains
    chains = chain_segments([one.start_vertex for one in segments], [one.stop_vertex for one in segments], measure_gap)
    loop = [k for chain in chains for k in chain]
    for one, following in pairwise([*loop, loop[0]]):
        if not measure_gap(one, following) <= CONVERSION_TOLERANCES.loop_slack:
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
    if max(abs(a - b) for a, b in zip(span, own, strict=True)) > CONVERSION_TOLERANCES.parameter_range * (
        span[1] - span[0]
    ):
        raise TopologyError(
            f"edge {number} runs over {own} in its parameters but over {span} in space: heal the shape"
            " (BRepLib.SameParameter) first"
        )
    return read_sampled_curve(curve, *span)


def _find_plane(surface: Surface) -> PlaneFrame | None:
    """Return the plane of a planar surface that is nowhere folded, with Su x Sv along its normal; else None."""
    (u0, u1), (v0, v1) = surface.domain
    jet = surface.jet((u0 + u1) / 2, (v0 + v1) / 2, 1)
    normal, poles = np.cross(jet[1, 0], jet[0, 1]), _extract_bezier_poles(surface)
    length = float(np.linalg.norm(normal))
    if (
        not length > 0
        or np.abs((poles - jet[0, 0]) @ normal).max()
        > CONVERSION_TOLERANCES.planarity * np.ptp(poles, axis=0).max() * length
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
    BRepGProp.SurfaceProperties_s(face, properties, CONVERSION_TOLERANCES.area)
    return abs(properties.Mass())


def _extract_bezier_poles(surface: Surface) -> Array:
    """Return the Bezier poles (n, 3)."""
    poles = np.moveaxis(surface.coefs, 2, -1).reshape(-1, surface.coefs.shape[2])
    return poles[:, :3] / poles[:, 3:] if surface.rational else poles


def _is_linear(surface: Surface, axis: int) -> bool:
    return surface.degree[axis] == 1 and len(surface.breaks[axis]) == 2


def _sample_range(breaks: Array) -> Array:
    return np.asarray(breaks[0] + _EDGE_SAMPLE_SHARES * (breaks[-1] - breaks[0]))


def _identity_map(t: Array) -> Array:
    return t


def _add_natural_boundary(face: TopoDS_Face) -> TopoDS_Face:
    """Return a face with wires: itself, or one with the natural boundary of its surface."""
    surface = BRep_Tool.Surface_s(face)
    if surface is None or next(explore_subshapes(face, TopAbs_WIRE), None) is not None:
        return face
    maker = BRepBuilderAPI_MakeFace(surface, BRep_Tool.Tolerance_s(face))
    return TopoDS.Face_s(maker.Face().Oriented(face.Orientation())) if maker.IsDone() else face
