"""Tolerances and limits of converting faces, edges and curves between OCCT and splines."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ConversionTolerances:
    """Tolerances and limits of :mod:`cqblend.brep.conversion`."""

    offset_surface_error: float = 1e-9
    """Largest error of an offset surface or curve, relative to its size: the only conversions that are not exact."""
    largest_arc: float = 2 * math.pi / 3
    """Angle (rad; hyperbolic angle on a hyperbola) above which a conic becomes several rational quadratic arcs."""
    arc_count: float = 1e-9
    """Part of :attr:`largest_arc` by which rounding may make the last arc too long, so that no further one is begun."""
    bound_snap: float = 1e-9
    """Distance, relative to a surface's parameter range, at which the bound of a face counts as that of the surface."""
    unbounded: float = 1e50
    """A parameter bound beyond is infinite to OCCT."""
    pcurve: float = 1e-11
    """Largest error of a fitted pcurve, in rad or parameters of the spline: it turns normals by as much."""
    rail_pcurve_share: float = 0.2
    """Share of it that the fit of a rail's pcurve may miss at its test points, few as they are."""
    pcurve_refinements: int = 12
    """How often the spans of a fitted pcurve are halved at most."""
    equal_derivatives: float = 1e-9
    """Difference, relative to 1 + magnitude, at which the derivatives left and right of a break are made equal."""
    seam: float = 1e-6
    """Distance from a seam, relative to the period, at which parameters lie on it."""
    whole_surface: float = 0.999
    """Part of a closed surface's parameter range from which on a face covers the whole of it, and is closed, too."""
    planar_edge: float = 1e-9
    """Distance of an edge's points from a plane, relative to the sphere's radius, at which it is an arc of a circle."""
    centred_edge: float = 0.1
    """Distance of the edge's middle from the sphere's centre, relative to the radius, at which it runs around it."""
    planarity: float = 1e-9
    """Distance of poles from a plane, relative to their extent, at which a spline surface or curve is planar."""
    loop_slack: float = 1e-2
    """How far, relative to the face, a loop may pass its surface's domain, or edge uses in a loop be apart.

    Tolerant shapes from files need it. Loops are clipped to the domain; the gap of an edge tells what that costs.
    """
    parameter_range: float = 1e-9
    """Difference of an edge's ranges in space and on a face, relative to the range, from which on they disagree."""
    area: float = 1e-5
    """Relative error of a face's area that OCCT is asked for."""
    degenerate_normal: float = 1e-12
    """Length of Su x Sv, relative to the largest speeds, up to which a surface has no normal."""

    rail_angles: int = 17
    """Number of places at which a circular or straight rail is compared with its image on the face."""

    circular_rail: float = 1e-13
    """Relative to the radius: largest distance between the two; a hundredth of what fitted pcurves are off."""

    straight_rail: float = 1e-13
    """The same of a straight rail, relative to its distance from the origin."""

    parameter_line: float = 1e-15
    """Relative to the parameters: by how much a rail along a parameter line may seem to leave it."""

    circle_position: float = 1e-14
    """Relative to the distance from the origin: how much rounding adds to it."""

    circular_speed: float = 1e-9
    """Relative: by how much the speed along a parameter may differ from that along a circle by its angle."""


CONVERSION_TOLERANCES = ConversionTolerances()
