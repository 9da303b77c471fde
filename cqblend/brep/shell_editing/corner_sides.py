"""The sides of the hole that blends leave at a corner: where their strips end, and curves on the faces between them.

The ends of the strips that meet go around the vertex counter-clockwise, seen from outside of the solid; so do the sides
of the hole. Of a strip that starts at the vertex, side 0 is the one towards the next strip, else side 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.TopoDS import TopoDS_Vertex

from cqblend.blends.corners.corner_side import CornerSide, make_face_side, make_strip_side
from cqblend.blends.corners.face_curve import CurveEnd, build_face_curve, choose_velocities
from cqblend.blends.corners.rail_crossing import (
    RailCrossing,
    build_end_section,
    build_square_section,
    cross_end_tangents,
    cross_rails,
)
from cqblend.blends.corners.setbacks import choose_setback, fit_setback
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.strip_end import PlacedEnd, StripsTooShortError
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import locate_vertex
from cqblend.errors import GeometryError, SizeError, TopologyError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.tensor_surface import SplineSurface


class CornerStrip:
    """A strip that ends at a corner."""

    def __init__(self, placed: PlacedEnd) -> None:
        self.placement = placed.placement
        self.end = placed.end

    @property
    def surface(self) -> Surface:
        """The strip as a spline H(t, v), with the parameter t of its rails."""
        return self.placement.blend.surface

    @property
    def following(self) -> int:
        """Which of its sides is towards the next strip."""
        return self.end

    @property
    def preceding(self) -> int:
        """Which of its sides is towards the strip before."""
        return 1 - self.end

    @cached_property
    def rails(self) -> tuple[Curve, Curve]:
        """Its rails in space."""
        return self.surface.isoparametric(v=0.0), self.surface.isoparametric(v=1.0)

    @property
    def vertex(self) -> TopoDS_Vertex:
        """The vertex."""
        return self.placement.joint.spine.vertices[self.end]

    @cached_property
    def vertex_point(self) -> Array:
        """The point of the vertex."""
        return locate_vertex(self.vertex)

    @cached_property
    def arms(self) -> Array:
        """The vectors (2, 3) from the vertex to both rails."""
        at = np.array([float(self.end)])
        return np.stack([rail(at)[0] for rail in self.rails]) - self.vertex_point

    @property
    def width(self) -> float:
        """The larger of its widths at the vertex."""
        return float(np.linalg.norm(self.arms, axis=1).max())

    @property
    def radius(self) -> float:
        """The radius of the ball that touches both faces at the lesser of its widths."""
        first, second = self.arms / np.linalg.norm(self.arms, axis=1)[:, None]
        angle = np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)
        return float(np.linalg.norm(self.arms, axis=1).min() * np.tan(angle / 2))

    @property
    def length(self) -> float:
        """The length (mm) of its edge."""
        return float(self.placement.joint.spine.length)

    def measure_from_vertex(self, t: float) -> float:
        """Return how far (mm, along its edge) a parameter is from the vertex, negative past it."""
        return (t if self.end == 0 else 1.0 - t) * self.length

    def locate_from_vertex(self, distance: float) -> float:
        """Return the parameter at a distance (mm, along the edge) from the vertex."""
        share = distance / self.length
        return share if self.end == 0 else 1.0 - share

    def point_to_vertex(self, rail: int, t: float) -> Array:
        """Return the unit tangent (3,) of a rail in the direction of the vertex."""
        tangent = self.rails[rail](np.array([t]), 1)[0] * (1.0 if self.end else -1.0)
        return np.asarray(tangent / np.linalg.norm(tangent))

    def locate_on_face(self, rail: int, t: float) -> Array:
        """Return the own parameters (2,) of its support face at t of a rail."""
        side = self.placement.sides[rail]
        return side.to_face_parameters(self.placement.blend.ribbons[rail].find_native_parameters(np.array([t])))[0]


@dataclass(frozen=True)
class SectionSide:
    """The side of a hole in which a strip ends.

    ``pcurve`` is the curve (t(v), v) on [0, 1] in the parameters of the strip's spline, from rail 1 to rail 2; the side
    runs the same way if the strip stops at the vertex, else backwards. ``stops`` are its t on both rails.
    """

    strip: CornerStrip
    pcurve: Curve
    side: CornerSide

    @property
    def stops(self) -> tuple[float, float]:
        """The parameters t at which it is on both rails."""
        first, last = self.pcurve(np.array([0.0, 1.0]))[:, 0]
        return float(first), float(last)

    def measure_gap(self, point: Array) -> float:
        """Return how far (mm) a vertex is from the nearer one of its ends."""
        return float(np.linalg.norm(self.side.evaluate_ends() - point, axis=1).min())

    @property
    def is_backward(self) -> bool:
        """Whether it runs from rail 2 to rail 1."""
        return self.strip.end == 0


@dataclass(frozen=True)
class FaceCurveSide:
    """The side of a hole on the support face between two strips: a curve of lifted parameters there."""

    support: SupportFace
    face_number: int
    ribbon: Ribbon
    side: CornerSide


HoleSide = SectionSide | FaceCurveSide


def require_faces_between(strips: Sequence[CornerStrip]) -> None:
    """Raise TopologyError unless every strip and the next one have the face between them in common."""
    for one, other in zip(strips, [*strips[1:], strips[0]], strict=True):
        first = one.placement.face_numbers[one.following]
        if first != other.placement.face_numbers[other.preceding]:
            raise TopologyError("the blends at the corner do not meet on the faces between them")


def cross_all_rails(strips: Sequence[CornerStrip]) -> list[RailCrossing]:
    """Return where the rails of every strip and the next one cross."""
    return [
        cross_rails((one.rails[one.following], other.rails[other.preceding]), (one.end, other.end))
        for one, other in zip(strips, [*strips[1:], strips[0]], strict=True)
    ]


def list_crossing_sections(strips: Sequence[CornerStrip], crossings: Sequence[RailCrossing]) -> list[Curve]:
    """Return the curves in the parameter planes of all strips that end where their rails cross those of others."""
    pcurves = []
    for k, strip in enumerate(strips):
        before, after = crossings[k - 1], crossings[k]
        stops, directions = np.empty(2), np.empty((2, 3))
        stops[strip.preceding], directions[strip.preceding] = before.parameters[1], before.tangents[0]
        stops[strip.following], directions[strip.following] = after.parameters[0], after.tangents[1]
        pcurves.append(build_end_section(strip.surface, stops, directions))
    return pcurves


def list_setback_sections(
    strips: Sequence[CornerStrip], setbacks: Sequence[float | None], attempt: int = 0
) -> list[Curve]:
    """Return the curves in the parameter planes of all strips that end before the vertex, each at one t.

    ``setbacks`` are the distances (mm) from the vertex that are asked for, by strip, None for the rule of thumb
    of an ``attempt``.

    Raises
    ------
    SizeError
        If an edge is too short, or a setback that is asked for ends past where rails cross.
    """
    pcurves, crossings = [], _estimate_crossings(strips)
    for k, (strip, asked) in enumerate(zip(strips, setbacks, strict=True)):
        ahead = [strip.measure_from_vertex(t) for t in (crossings[k - 1][1], crossings[k][0])]
        name = strip.placement.joint.name
        if asked is None:
            try:
                distance = fit_setback(choose_setback(strip.width, ahead, attempt), strip.length)
            except SizeError as error:
                raise error.with_details(shape=name) from error
        elif asked <= max(ahead):
            raise SizeError(
                f"setback {asked:.4g} ends where the rails have crossed already, {max(ahead):.4g} mm from the vertex",
                kind="setback",
                shape=name,
                value=max(ahead),
            )
        else:
            distance = asked
        pcurves.append(build_square_section(strip.locate_from_vertex(distance)))
    return pcurves


def require_reach(strips: Sequence[CornerStrip], pcurves: Sequence[Curve]) -> None:
    """Raise StripsTooShortError unless all strips are long enough for the curves that they are to end in."""
    reaches = [(float(pcurve.coefs[:, 0].min()), float(pcurve.coefs[:, 0].max())) for pcurve in pcurves]
    domains = [strip.surface.domain[0] for strip in strips]
    if all(low <= first and last <= high for (first, last), (low, high) in zip(reaches, domains, strict=True)):
        return
    needed = []
    for strip, (first, last) in zip(strips, reaches, strict=True):
        farthest = np.array([[last if strip.end else first, 0.0]])
        needed.append(float(strip.placement.strip.map_from_blend(farthest)[0, 0]))
    raise StripsTooShortError(needed)


def _estimate_crossings(strips: Sequence[CornerStrip]) -> list[tuple[float, float]]:
    """Return the parameters of every strip and of the next one at which their rails cross, or would if they went on."""
    found = []
    for one, other in zip(strips, [*strips[1:], strips[0]], strict=True):
        rails, ends = (one.rails[one.following], other.rails[other.preceding]), (one.end, other.end)
        try:
            t = cross_rails(rails, ends).parameters
        except GeometryError:
            t = cross_end_tangents(rails, ends)
        found.append((float(t[0]), float(t[1])))
    return found


def settle_compact_ends(strips: Sequence[CornerStrip], pcurves: Sequence[Curve]) -> list[Curve]:
    """Return square end sections, of compact strips at the very ends of these, if they end before the vertex.

    Raises
    ------
    StripsTooShortError
        If some do not, and must be made to end at the given sections.
    """
    needed: list[float | None] = []
    settled = []
    for strip, pcurve in zip(strips, pcurves, strict=True):
        stop = strip.surface.domain[0][strip.end]
        is_compact = strip.placement.blend.form == "compact"
        is_before = strip.measure_from_vertex(stop) > SHELL_EDIT_TOLERANCES.least_setback * strip.width
        needed.append(float(pcurve.coefs[0, 0, 0]) if is_compact and not is_before else None)
        settled.append(build_square_section(stop) if is_compact and is_before else pcurve)
    if any(one is not None for one in needed):
        raise StripsTooShortError(needed, exactly=True)
    return settled


def measure_roughness(strips: Sequence[CornerStrip]) -> float:
    """Return by how much sides may fail to agree that end inside of strips: those of the compact form are not exact."""
    is_compact = any(strip.placement.blend.form == "compact" for strip in strips)
    return SHELL_EDIT_TOLERANCES.compact_sides if is_compact else 0.0


def choose_dimension(strips: Sequence[CornerStrip], *, on_faces: bool) -> int:
    """Return 3 where everything at a corner is polynomial, with weights 1, else 4; faces count if sides run on them."""
    plain = all(not strip.surface.rational for strip in strips)
    if on_faces:
        primaries = [side.primary for strip in strips for side in strip.placement.sides]
        plain = plain and all(
            isinstance(one, Plane) or (isinstance(one, SplineSurface) and not one.rational) for one in primaries
        )
    return 3 if plain else 4


def make_section_side(strip: CornerStrip, pcurve: Curve, dim: int) -> SectionSide:
    """Return the side in which a strip ends."""
    side = make_strip_side(strip.surface, pcurve, dim).level_weights()
    return SectionSide(strip, pcurve, side.reverse() if strip.end == 0 else side)


def make_face_curve_side(one: SectionSide, other: SectionSide, dim: int) -> FaceCurveSide:
    """Return the side on the face between a strip and the next one, from the end of the one to that of the other."""
    strips = one.strip, other.strip
    rails = one.strip.following, other.strip.preceding
    t = one.stops[rails[0]], other.stops[rails[1]]
    first = strips[0].placement.sides[rails[0]]
    points = np.stack([strip.rails[rail](np.array([at]))[0] for strip, rail, at in zip(strips, rails, t, strict=True)])
    directions = np.stack([strips[0].point_to_vertex(rails[0], t[0]), -strips[1].point_to_vertex(rails[1], t[1])])
    is_reflex = bool(strips[0].arms[rails[0]] @ -strips[1].point_to_vertex(rails[1], t[1]) < 0)
    velocities = choose_velocities(points, directions, is_reflex=is_reflex)
    own = [strip.locate_on_face(rail, at) for strip, rail, at in zip(strips, rails, t, strict=True)]
    own[1] = first.unwrap_near(own[1][None], own[0][None])[0]
    uv = first.to_working_parameters(np.stack(own))
    curve = build_face_curve(first.primary, CurveEnd(uv[0], velocities[0]), CurveEnd(uv[1], velocities[1]))
    return FaceCurveSide(
        first,
        strips[0].placement.face_numbers[rails[0]],
        Ribbon(first.primary, curve, (), uv),
        make_face_side(first.primary, curve, dim).level_weights(),
    )
