"""Read-only context of one strip: a blend surface and the joint of a solid that it is put at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.arc_strip import ArcStrip
from cqblend.blends.network.blend_plan import PlannedPcurve, PlannedSurface, PlannedVertex
from cqblend.blends.network.strip_surface import RailCurve, RevolvedStrip, SplineStrip, StripSurface
from cqblend.blends.network.turned_strip import TurnedStrip
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.blends.sections.revolved_section import find_revolved_section
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.brep.conversion.analytic_pcurves import find_analytic_pcurve, find_circular_pcurve
from cqblend.brep.conversion.support_face import SupportFace, build_rail_pcurve
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.realigned_spheres import realign_sphere
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION, locate_vertex
from cqblend.splines import Curve
from cqblend.surfaces.circle import PlanarCircle
from cqblend.surfaces.quadrics import Sphere

RailPcurves = tuple[Curve | PlanarCircle | None, Curve | PlanarCircle | None]
"""Functions from s to the parameters of the rails on both support faces; None for a rail that is one point."""

CapStations = tuple[float | None, float | None]
"""The t of the flat caps at both ends of an open blend, None for an end on the face across the edge."""


@dataclass(frozen=True)
class PlacedStrip:
    """One blend surface and the two support faces that it goes between."""

    blend: BlendSurface
    sides: tuple[SupportFace, SupportFace]  # the support faces in whose parameters the rails are given
    face_numbers: tuple[int, int]  # of the support faces, in the solid
    spheres: tuple[PlannedSurface | None, PlannedSurface | None]  # which of these are spheres that get a new axis
    strip: StripSurface  # the blend surface, in the parameters in which it goes into the solid
    surface: PlannedSurface  # the same, to be built
    rail_curves: tuple[RailCurve, RailCurve]  # its rows v = 0 and v = 1
    rail_pcurves: RailPcurves

    @property
    def domain(self) -> tuple[float, float]:
        """The parameter range of the strip."""
        return self.strip.domain

    def plan_pcurve(self, curve: Curve, reversed_curve: Curve | None = None) -> PlannedPcurve:
        """Return the pcurve on the blend of an edge that is a curve in the parameters of the strip.

        ``reversed_curve`` is that of its second use, if it is a seam.
        """
        own = self.strip.map_to_surface(curve)
        if reversed_curve is None:
            return PlannedPcurve(self.surface, own)
        other = self.strip.map_to_surface(reversed_curve)
        return PlannedPcurve(self.surface, *((other, own) if self.strip.is_mirrored else (own, other)))

    def get_rail_pcurve(self, i: int) -> Curve | PlanarCircle:
        """Return the parameters on its support face of rail ``i``, which is not a point, as a function of s."""
        pcurve = self.rail_pcurves[i]
        if pcurve is None:
            raise TypeError("a rail that is one point has no pcurve")
        return pcurve

    def get_support(self, i: int) -> int | PlannedSurface:
        """Return what pcurves on support face ``i`` refer to: its number, or the sphere that it gets."""
        sphere = self.spheres[i]
        return self.face_numbers[i] if sphere is None else sphere


@dataclass(frozen=True)
class StripPlacement(PlacedStrip):
    """One blend surface and the joint of a solid where it goes. Made by :func:`place_strip`."""

    joint: Joint

    @property
    def index(self) -> SolidIndex:
        """Facts of the solid."""
        return self.joint.index

    def locate_edge_parameter(self, t: float) -> float:
        """Return the parameter of the strip about where the edge is at t; at the ends of an arc, where it is."""
        if isinstance(self.strip, SplineStrip):
            return t
        first, last = self.blend.ribbons[0].c.domain
        return (t - first) / (last - first) * self.domain[1]

    @cached_property
    def spine_numbers(self) -> tuple[int, ...]:
        """The numbers of the blended edges in the solid."""
        return tuple(map(self.index.edges.find_number, self.joint.spine.edges))

    def ends_in_point(self, end: int) -> bool:
        """Whether the strip ends in a point: its rails meet where they start (``end`` 0) or stop (1).

        Where the joint fades out, they meet as nearly as its faces do at the edge.
        """
        at = np.array([self.domain[end]])
        first, second = (row(at)[0] for row in self.rail_curves)
        slack = self.joint.tolerance if self.joint.fading_ends[end] else 0.0
        return bool(np.linalg.norm(first - second) <= SHELL_EDIT_TOLERANCES.point_end * self.joint.extent + slack)

    def number_face(self, face: TopoDS_Face) -> int:
        """Return the number of a face in the solid."""
        return self.index.faces.find_number(face)

    def keep_vertex(self, vertex: TopoDS_Vertex) -> PlannedVertex:
        """Return a vertex of the solid as one that stays."""
        return PlannedVertex(locate_vertex(vertex), self.index.vertices.find_number(vertex))

    def keep_vertex_at(self, planned: PlannedVertex, near: Sequence[TopoDS_Vertex]) -> PlannedVertex:
        """Return that of some vertices of the solid at which a new one would be, to its tolerance; else the new one."""
        for vertex in near:
            distance = float(np.linalg.norm(locate_vertex(vertex) - planned.point))
            if distance <= max(BRep_Tool.Tolerance_s(vertex), CONFUSION):
                return self.keep_vertex(vertex)
        return planned


def place_strip(
    joint: Joint, blend: BlendSurface, sides: tuple[SupportFace, SupportFace] | None = None
) -> StripPlacement:
    """Prepare to put a blend at a joint; its rails are on the joint's own ``sides`` if no others are given.

    Support faces on spheres that end at a closed blended edge alone get the rail's axis (:mod:`.realigned_spheres`).
    """
    edges = joint.spine.edges if joint.spine.closed else None
    placed = place_between(joint.index, sides or joint.sides, blend, edges)
    return StripPlacement(**{one.name: getattr(placed, one.name) for one in fields(placed)}, joint=joint)


def place_between(
    index: SolidIndex,
    sides: tuple[SupportFace, SupportFace],
    blend: BlendSurface,
    ring: Sequence[TopoDS_Edge] | None,
) -> PlacedStrip:
    """Prepare to put a blend between two support faces.

    ``ring`` are the edges that a closed blend takes the place of, none in an opening; it is None if the blend is open.
    """
    (side1, sphere1), (side2, sphere2) = (
        (side, None) if ring is None else _realign_side(ring, side, ribbon)
        for side, ribbon in zip(sides, blend.ribbons, strict=True)
    )
    strip, pcurves = _describe_strip(blend, (side1, side2))
    first, second = (index.faces.find_number(side.face) for side in sides)
    return PlacedStrip(
        blend=blend,
        sides=(side1, side2),
        face_numbers=(first, second),
        spheres=(sphere1, sphere2),
        strip=strip,
        surface=PlannedSurface(strip.geometry),
        rail_curves=strip.rail_curves,
        rail_pcurves=pcurves,
    )


def _describe_strip(
    blend: BlendSurface, sides: tuple[SupportFace, SupportFace]
) -> tuple[SplineStrip | RevolvedStrip | ArcStrip | TurnedStrip, RailPcurves]:
    """Return the surface of a strip and its rails on the support faces, around an axis if all of it is so."""
    if blend.arc is not None:
        strip = TurnedStrip(blend.arc) if isinstance(blend.arc, TurnedArcs) else ArcStrip(blend.arc)
        one, other = (
            None
            if ribbon.is_point
            else find_analytic_pcurve(side, ribbon, rail, blend.arc.stops, blend.arc.map_to_parameters)
            for side, ribbon, rail in zip(sides, blend.ribbons, strip.rail_curves, strict=True)
        )
        return strip, (one, other)
    section = None if any(ribbon.fades for ribbon in blend.ribbons) else find_revolved_section(blend)
    if section is not None:
        revolved = RevolvedStrip(section)
        first, second = (
            None if ribbon.is_point else find_circular_pcurve(side, ribbon, circle, section.turn)
            for side, ribbon, circle in zip(sides, blend.ribbons, revolved.rail_curves, strict=True)
        )
        if all(
            found is not None or ribbon.is_point for found, ribbon in zip((first, second), blend.ribbons, strict=True)
        ):
            return revolved, (first, second)
    one, other = (
        None if ribbon.is_point else build_rail_pcurve(side, ribbon)
        for side, ribbon in zip(sides, blend.ribbons, strict=True)
    )
    return SplineStrip(blend.surface), (one, other)


def _realign_side(
    ring: Sequence[TopoDS_Edge], side: SupportFace, ribbon: Ribbon
) -> tuple[SupportFace, PlannedSurface | None]:
    """Return a support face with the rail's axis and the sphere that it gets; or as it is, and None."""
    realigned = realign_sphere(side, ribbon, ring)
    if realigned is None or not isinstance(realigned.face_primary, Sphere):
        return side, None
    return realigned, PlannedSurface(realigned.face_primary)
