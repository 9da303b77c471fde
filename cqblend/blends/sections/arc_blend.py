"""Fills a blend by the arcs of its rolling ball, where that is exact all along: between straight or circular ribbons.

As a spline, an arc is rational and quadratic. In homogeneous coordinates the tangents C1 + k T1 and C2 + k T2 of the
rails meet in a point A, the same k at both, and with h half the opening of the arc the rows of the net across are C1,
A cos h, C2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.arc_section import ArcSection
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.hermite_section import Jets
from cqblend.blends.sections.revolved_section import find_revolved_section
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.blends.sections.turned_arcs import find_turned_arcs
from cqblend.errors import UnsupportedError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.surfaces.quadrics import Cylinder, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame, cross_product, measure_lengths, normalise_vectors


def blend_by_arcs(ribbons: tuple[Ribbon, Ribbon], radius: float) -> BlendSurface:
    """Blend two ribbons of a rolling ball by its arcs.

    Raises
    ------
    UnsupportedError
        If that is not exact: the message says why.
    """
    if not all(ribbon.light and not ribbon.fades for ribbon in ribbons):
        raise UnsupportedError("the rails are neither straight nor circles about one axis")
    if any(ribbon.is_point for ribbon in ribbons) and not _have_equal_chords(ribbons):
        turned = find_turned_arcs(ribbons, radius)
        return BlendSurface(turned.make_surface(), ribbons, "exact", kind="arc", arc=turned)
    blend = blend_ribbons(ribbons, "exact", np.inf, np.inf, _build_rational_arcs)
    return replace(blend, kind="arc", arc=_find_ball_surface(blend, radius))


def _have_equal_chords(ribbons: tuple[Ribbon, Ribbon]) -> bool:
    """Whether both rails are equally far apart all along."""
    breaks = ribbons[0].c.breaks
    t = np.interp(np.arange(2 * len(breaks) - 1) / 2, np.arange(len(breaks)), breaks)
    first, second = (ribbon.primary.jet(ribbon.find_native_parameters(t))[0] for ribbon in ribbons)
    chords = measure_lengths(second - first)
    return bool(np.ptp(chords) <= SECTION_TOLERANCES.arc_deviation * max(np.abs(first).max(), np.abs(second).max()))


def _build_rational_arcs(sides: tuple[Jets, Jets]) -> Surface:
    """Return the rational surface of arcs that leave both rails in the direction of their first jets."""
    together = align_breaks([jet for side in sides for jet in side[:2]])
    largest = max(jet.degree for jet in together)
    first, tangent1, second, tangent2 = (jet.elevate(largest - jet.degree).coefs for jet in together)
    chord, difference = second - first, tangent1 - tangent2
    factor = float((chord * difference).sum() / (difference * difference).sum())
    apexes = first + factor * tangent1, second + factor * tangent2
    miss, size = np.abs(apexes[0] - apexes[1]).max(), max(np.abs(apex).max() for apex in apexes)
    if not miss <= SECTION_TOLERANCES.arc_deviation * size:
        raise UnsupportedError("the tangents at both rails do not meet, so that no arc joins them")
    directions = normalise_vectors(np.stack([tangent1[0, :3, 0], tangent2[0, :3, 0]]))
    cosine = float(measure_lengths(directions[0] - directions[1])) / 2
    rows = np.stack([first, cosine * (apexes[0] + apexes[1]) / 2, second], axis=1)[..., None]
    continuity = np.min([jet.continuity for jet in together], axis=0)
    breaks = (together[0].breaks, np.array([0.0, 1.0]))
    return Surface(breaks, rows, rational=True, continuity=(continuity, np.empty(0, int)))


@dataclass(frozen=True)
class _FirstArc:
    """The arc at the first t: its ends (2, 3), the tangents there into the blend (2, 3), its centre and its opening.

    ``along`` is the unit tangent of the rails.
    """

    ends: Array
    tangents: Array
    along: Array
    centre: Array
    opening: float


def _find_first_arc(blend: BlendSurface, radius: float) -> _FirstArc:
    """Return the arc at the first t."""
    t = np.array(blend.surface.domain[0][:1])
    jets = [np.stack([jet(t) for jet in ribbon.jets[:2]]) for ribbon in blend.ribbons]
    ends, tangents = np.stack([dehomogenise_jets(jet)[:, 0] for jet in jets], axis=1)
    tangents, along = normalise_vectors(tangents), normalise_vectors(blend.surface(t, np.full(1, 0.5), 1, 0)[0])
    normals = cross_product(along, tangents)
    inward = normals * np.sign((normals * (ends[::-1] - ends)).sum(axis=1))[:, None]
    first, second = tangents
    half = np.arctan2(measure_lengths(first + second), measure_lengths(first - second))
    return _FirstArc(ends, tangents, along, (ends + radius * inward).mean(axis=0), 2 * float(half))


def _find_ball_surface(blend: BlendSurface, radius: float) -> ArcSection:
    """Return the cylinder, torus or sphere that a blend by arcs is.

    Raises
    ------
    UnsupportedError
        If it is none of them, to rounding.
    """
    arc = _find_first_arc(blend, radius)
    found = _find_cylinder(blend, arc, radius) if blend.surface.degree[0] == 1 else _find_torus(blend, arc, radius)
    s, v = (grid.ravel() for grid in np.meshgrid(np.linspace(0, found.length, 9), np.linspace(0, 1, 5)))
    points = blend.surface(*found.map_to_spline(s, v).T)
    off = np.abs(found.surface.jet(found.map_to_surface(s, v))[0] - points).max()
    if not off <= SECTION_TOLERANCES.arc_deviation * max(radius, float(np.abs(points).max())):
        raise UnsupportedError(f"its sections are off the arcs of one ball by {off:.2g} mm")
    return found


def _find_cylinder(blend: BlendSurface, arc: _FirstArc, radius: float) -> ArcSection:
    """Return the cylinder that a ball leaves behind whose rails are straight."""
    low, high = blend.surface.domain[0]
    rulings = np.diff(blend.surface.grid(np.array([low, high]), np.array([0.0, 1.0])), axis=0)[0]
    length = float(measure_lengths(rulings).mean())
    along = normalise_vectors(rulings.sum(axis=0))
    arm = arc.ends[0] - arc.centre
    x = normalise_vectors(arm - (arm @ along) * along)
    sense = float(np.sign(cross_product(x, arc.tangents[0]) @ along))  # angles grow from rail 1 to rail 2
    axis = sense * along
    surface = Cylinder(LocalFrame(arc.centre, np.stack([x, cross_product(axis, x), axis])), radius)
    across = np.array([arc.opening, 0.0])
    stops, breaks = np.array([0.0, length]), np.array([low, high])
    return ArcSection(surface, radius, np.zeros(2), np.array([0.0, sense]), across, stops, breaks)


def _find_torus(blend: BlendSurface, arc: _FirstArc, radius: float) -> ArcSection:
    """Return the torus or sphere that a ball leaves behind whose rails are circles about one axis."""
    turned = find_revolved_section(blend)
    if turned is None:
        raise UnsupportedError("the rails are no circles about one axis")
    frame = turned.frame
    centre, first, tangent = (
        (vector - at) @ frame.axes.T
        for vector, at in ((arc.centre, frame.origin), (arc.ends[0], arc.centre), (arc.tangents[0], 0.0))
    )
    major, height = float(centre[0]), float(centre[2])
    start, sense = float(np.arctan2(first[2], first[0])), float(np.sign(first[0] * tangent[2] - first[2] * tangent[0]))
    is_sphere = abs(major) <= SECTION_TOLERANCES.arc_deviation * max(radius, abs(height))
    if major < 0 and not is_sphere:
        raise UnsupportedError(f"the ball's centre would be {-major:.3g} mm beyond the axis")
    if not is_sphere and not turned.closed and major < radius:
        if major < radius * (1 - SECTION_TOLERANCES.arc_deviation):
            raise UnsupportedError(
                f"the ball's centre goes around the axis at {major:.3g} mm, less than its radius: that torus crosses "
                "itself, and STEP files do not keep its edges exactly"
            )
        major = radius  # but for rounding, it touches itself
    placed = LocalFrame(frame.origin + height * frame.axes[2], frame.axes)
    surface = Sphere(placed, radius, frame.axes[2]) if is_sphere else RevolvedEllipse.from_radii(placed, major, radius)
    stop = start + sense * arc.opening
    if is_sphere:  # OCCT knows no latitudes beyond the poles
        start, stop = (float(np.clip(latitude, -np.pi / 2, np.pi / 2)) for latitude in (start, stop))
    elif min(start, stop) < -SECTION_TOLERANCES.arc_deviation:  # its booleans miss intersections at angles below 0
        start, stop = start + 2 * np.pi, stop + 2 * np.pi
    across = np.array([0.0, stop - start])
    along = np.array([1.0, 0.0])
    return ArcSection(surface, radius, np.array([0.0, start]), along, across, turned.angles, turned.breaks)
