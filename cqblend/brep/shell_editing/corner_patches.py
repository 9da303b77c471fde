"""Corners of patches: the hole that blends leave where they meet is filled by faces of its own.

Strips end where their rails cross those of their neighbours ("cross"), or before that ("setback"): then curves on the
faces between them round off what remains of these. The hole is filled by one patch if it has four sides and no curves
on faces, else by one quad for each of its corners, which meet in *spokes*.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.blends.corners.corner_filler import fill_with_one_patch, fill_with_quads
from cqblend.blends.corners.patch_quality import check_patches
from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.blends.network.blend_plan import (
    EdgeUse,
    FacePlan,
    NewEdge,
    PatchPlan,
    PlannedPcurve,
    PlannedSurface,
    PlannedVertex,
    reverse_path,
)
from cqblend.brep.conversion.support_face import build_rail_pcurve
from cqblend.brep.shell_editing.corner_plan import CornerPlan
from cqblend.brep.shell_editing.corner_sides import (
    CornerStrip,
    FaceCurveSide,
    HoleSide,
    SectionSide,
    choose_dimension,
    cross_all_rails,
    list_crossing_sections,
    list_setback_sections,
    make_face_curve_side,
    make_section_side,
    measure_roughness,
    require_faces_between,
    require_reach,
    settle_compact_ends,
)
from cqblend.brep.shell_editing.rail_edges import find_window_shift
from cqblend.brep.shell_editing.strip_end import PlacedEnd, StripEnd
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface

MIDDLE = 0.5
"""Where quads divide the sides of their hole."""


def patch_crossing_rails(ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan patches between strips that end where their rails cross.

    Raises
    ------
    StripsTooShortError
        If the strips must be made longer.
    SizeError, TopologyError, GeometryError
        If there is no sound corner of this kind.
    """
    strips = [CornerStrip(end) for end in ends]
    require_faces_between(strips)
    crossings = cross_all_rails(strips)
    pcurves = list_crossing_sections(strips, crossings)
    require_reach(strips, pcurves)
    dim = choose_dimension(strips, on_faces=False)
    sides = [make_section_side(strip, pcurve, dim) for strip, pcurve in zip(strips, pcurves, strict=True)]
    vertices = []
    for k, side in enumerate(sides):
        point = crossings[k - 1].point
        vertices.append(PlannedVertex(point, gap=max(side.measure_gap(point), sides[k - 1].measure_gap(point))))
    return CornerPlan("cross", *_Hole(sides, vertices, measure_roughness(strips)).plan_faces())


def patch_set_back_ends(ends: Sequence[PlacedEnd], setbacks: Sequence[float | None]) -> CornerPlan:
    """Plan patches between strips that end before the vertex; ``setbacks`` (mm) are as asked for, None by rule.

    Raises
    ------
    StripsTooShortError
        If the strips must be made longer.
    SizeError, TopologyError, GeometryError
        If there is no sound corner of this kind.
    """
    strips = [CornerStrip(end) for end in ends]
    require_faces_between(strips)
    is_free = any(one is None for one in setbacks)
    failure: GeometryError | None = None
    for attempt in range(len(CORNER_TOLERANCES.setback_factors) if is_free else 1):
        pcurves = settle_compact_ends(strips, list_setback_sections(strips, setbacks, attempt))
        require_reach(strips, pcurves)
        try:
            return _patch_sections(strips, pcurves)
        except GeometryError as error:
            failure = failure or error
    assert failure is not None
    raise failure


def _patch_sections(strips: Sequence[CornerStrip], pcurves: Sequence[Curve]) -> CornerPlan:
    """Plan patches between strips that end in given sections before the vertex."""
    dim = choose_dimension(strips, on_faces=True)
    sections = [make_section_side(strip, pcurve, dim) for strip, pcurve in zip(strips, pcurves, strict=True)]
    sides: list[HoleSide] = []
    for one, other in zip(sections, [*sections[1:], sections[0]], strict=True):
        sides += [one, make_face_curve_side(one, other, dim)]
    vertices = [PlannedVertex(side.side.evaluate_ends()[0]) for side in sides]
    return CornerPlan("setback", *_Hole(sides, vertices).plan_faces())


class _Hole:
    """The hole at a corner: its sides, head to tail, vertices where they start, and by how much they may disagree."""

    def __init__(self, sides: Sequence[HoleSide], vertices: Sequence[PlannedVertex], roughness: float = 0.0) -> None:
        self.roughness = roughness
        self.sides = tuple(sides)
        self.vertices = tuple(vertices)
        self.strips = [side.strip for side in sides if isinstance(side, SectionSide)]

    def plan_faces(self) -> tuple[tuple[StripEnd, ...], tuple[PatchPlan, ...]]:
        """Fill the hole; return what the strips around it end in, and its patches.

        Raises
        ------
        GeometryError
            If the patches are not sound.
        """
        patches, paths = self._fill_with_one_patch() if len(self.sides) == 4 else (None, None)
        if patches is None or paths is None:
            patches, paths = self._fill_with_quads()
        ends = []
        for k, side in enumerate(self.sides):
            if isinstance(side, SectionSide):
                following = self.sides[(k + 1) % len(self.sides)]
                plans: tuple[FacePlan, ...] = ()
                if isinstance(following, FaceCurveSide):
                    plans = (_plan_face(following, paths[(k + 1) % len(self.sides)]),)
                corners = self.vertices[k], self.vertices[(k + 1) % len(self.sides)]
                ends.append(_make_end(side, paths[k], corners, plans))
        return tuple(ends), patches

    @property
    def radius(self) -> float:
        """The least radius of the blends around it."""
        return min(strip.radius for strip in self.strips)

    def _fill_with_one_patch(self) -> tuple[tuple[PatchPlan, ...] | None, list[list[EdgeUse]] | None]:
        """Return the one patch of four sides and its edges by side; None if it is not sound."""
        try:
            (patch,) = fill_with_one_patch([side.side for side in self.sides], self.roughness).patches
            check_patches([patch], self.radius)
        except GeometryError:
            return None, None
        surface = PlannedSurface(patch)
        lines = [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0))]
        paths = []
        for k, (side, line) in enumerate(zip(self.sides, lines, strict=True)):
            ends = self.vertices[k], self.vertices[(k + 1) % 4]
            paths.append([EdgeUse(_plan_side_edge(side, (0.0, 1.0), ends, _plan_line(surface, line, (0.0, 1.0))))])
        return (self._plan_patch(surface, [path[0] for path in paths]),), paths

    def _fill_with_quads(self) -> tuple[tuple[PatchPlan, ...], list[list[EdgeUse]]]:
        """Return one quad for each corner of the hole, and the two edges of each side."""
        quads = fill_with_quads([side.side for side in self.sides], self.roughness).patches
        check_patches(quads, self.radius)
        m = len(quads)
        surfaces = [PlannedSurface(quad) for quad in quads]
        middles = [PlannedVertex(side.side.evaluate_point(MIDDLE)) for side in self.sides]
        centre = PlannedVertex(quads[0](np.ones(1), np.ones(1))[0])
        halves: list[list[EdgeUse]] = []
        spokes: list[EdgeUse] = []
        for i, side in enumerate(self.sides):
            own, following = surfaces[i], surfaces[(i + 1) % m]
            first = _plan_side_edge(
                side,
                (0.0, MIDDLE),
                (self.vertices[i], middles[i]),
                _plan_line(own, ((0, 0), (1, 0)), (0.0, MIDDLE)),
            )
            second = _plan_side_edge(
                side,
                (MIDDLE, 1.0),
                (middles[i], self.vertices[(i + 1) % m]),
                _plan_line(following, ((0, 1), (0, 0)), (MIDDLE, 1.0)),
            )
            halves.append([EdgeUse(first), EdgeUse(second)])
            spokes.append(EdgeUse(_plan_spoke(quads[i], (own, following), (middles[i], centre))))
        patches = tuple(
            self._plan_patch(surfaces[i], [halves[i][0], spokes[i], spokes[i - 1].reverse(), halves[i - 1][1]])
            for i in range(m)
        )
        return patches, halves

    def _plan_patch(self, surface: PlannedSurface, boundary: Sequence[EdgeUse]) -> PatchPlan:
        vertex = self.strips[0].placement.index.vertices.find_number(self.strips[0].vertex)
        spines = tuple(strip.placement.spine_numbers[-strip.end] for strip in self.strips)
        return PatchPlan(vertex, spines, surface, tuple(boundary))


def _plan_line(
    surface: PlannedSurface, ends: tuple[tuple[float, float], tuple[float, float]], span: tuple[float, float]
) -> PlannedPcurve:
    """Return the pcurve that is a straight line over a span."""
    return PlannedPcurve(surface, Curve.bezier(ends, domain=span))


def _plan_spoke(
    quad: Surface, surfaces: tuple[PlannedSurface, PlannedSurface], vertices: tuple[PlannedVertex, PlannedVertex]
) -> NewEdge:
    """Plan the edge between a quad, at its u = 1, and the next one, at its v = 1."""
    whole = (0.0, 1.0)
    pcurves = _plan_line(surfaces[0], ((1, 0), (1, 1)), whole), _plan_line(surfaces[1], ((0, 1), (1, 1)), whole)
    return NewEdge("spoke", quad.isoparametric(u=1.0), whole, vertices, pcurves, 1)


def _plan_side_edge(
    side: HoleSide,
    span: tuple[float, float],
    vertices: tuple[PlannedVertex, PlannedVertex],
    on_patch: PlannedPcurve,
) -> NewEdge:
    """Plan the edge on a span of one side of the hole, in the sense of the side."""
    curve = side.side.to_space_curve()
    if isinstance(side, SectionSide):
        return NewEdge("section", curve, span, vertices, (_plan_strip_pcurve(side, span), on_patch), 1)
    pcurve = build_rail_pcurve(side.support, side.ribbon)
    middle = pcurve(np.array([MIDDLE]))[0]
    placed = (pcurve + find_window_shift(side.support, middle)).clip(*span)
    return NewEdge("corner curve", curve, span, vertices, (PlannedPcurve(side.face_number, placed), on_patch), 1)


def _plan_strip_pcurve(section: SectionSide, span: tuple[float, float]) -> PlannedPcurve:
    """Return the pcurve of a section on its strip, in the sense of the side of the hole."""
    placement = section.strip.placement
    pcurve = section.pcurve.reverse() if section.is_backward else section.pcurve
    return placement.plan_pcurve(placement.strip.map_curve_from_blend(pcurve.clip(*span)))


def _plan_face(side: FaceCurveSide, path: Sequence[EdgeUse]) -> FacePlan:
    """Plan the boundary of a support face along a curve on it; the face is on its right side, seen from outside."""
    uses = reverse_path(path) if side.support.outward > 0 else list(path)
    return FacePlan(side.face_number, added=tuple(uses))


def _make_end(
    section: SectionSide,
    path: Sequence[EdgeUse],
    corners: tuple[PlannedVertex, PlannedVertex],
    plans: tuple[FacePlan, ...],
) -> StripEnd:
    """Return what a strip ends in, from rail 1 to rail 2, of a path in the sense of the hole."""
    strip = section.strip
    along = reverse_path(path) if section.is_backward else list(path)
    ordered = corners[::-1] if section.is_backward else corners
    reach = strip.placement.strip.map_from_blend(np.stack([section.stops, (0.0, 1.0)], axis=1))[:, 0]
    vertex = strip.placement.keep_vertex(strip.vertex)
    return StripEnd(tuple(along), ordered, (float(reach[0]), float(reach[1])), vertex, (), plans)
