"""Contacts against OCCT's evaluation: a ball that rolls along an edge touches both faces, a width is a distance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from kernel_surfaces import Pair, clamped, kernel_surface
from OCP.Geom import (
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_ToroidalSurface,
)
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    compute_inward_directions,
    project_to_intersection,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.errors import GeometryError, SizeError
from cqblend.splines import Surface
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame

UP = np.eye(3)


class Corner(NamedTuple):
    """Two faces of a solid along an edge: primaries with their outward signs, OCCT's surfaces, and the edge."""

    sides: tuple[SupportSurface, SupportSurface]
    kernels: tuple[Geom_Surface, Geom_Surface]
    stations: Stations
    convex: bool


def placed(origin: tuple[float, float, float], z: np.ndarray, x: np.ndarray) -> tuple[gp_Ax3, LocalFrame]:
    axis = gp_Ax3(gp_Pnt(*origin), gp_Dir(*z.tolist()), gp_Dir(*x.tolist()))
    return axis, LocalFrame(np.array(origin, float), np.array([x, np.cross(z, x), z]))


def outward(pair: Pair, uv: np.ndarray, direction: np.ndarray) -> float:
    _, su, sv = pair.jet(uv[:1])[:3]
    return float(np.sign(np.cross(su, sv)[0] @ direction))


def corner(
    one: tuple[Primary, Geom_Surface],
    two: tuple[Primary, Geom_Surface],
    uv: tuple[np.ndarray, np.ndarray],
    out: tuple[np.ndarray, np.ndarray],
    t: np.ndarray,
    *,
    convex: bool,
) -> Corner:
    """Assemble a corner; ``out`` are outward directions of the two faces at the first station."""
    pairs = [Pair("", primary, kernel, ((0, 1), (0, 1))) for primary, kernel in (one, two)]
    sides = [
        SupportSurface(pair.primary, outward(pair, at, direction))
        for pair, at, direction in zip(pairs, uv, out, strict=True)
    ]
    point = pairs[0].jet(uv[0])[0]
    n1, n2 = (side.outward * np.cross(*pair.jet(at)[1:3]) for side, pair, at in zip(sides, pairs, uv, strict=True))
    tangent = np.cross(n1, n2) * (1 if convex else -1)  # face 1 lies to the left of the edge, seen from outside
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return Corner((sides[0], sides[1]), (one[1], two[1]), Stations(t, point, tangent, uv), convex)


def wedge(angle: float, *, convex: bool) -> Corner:
    """Two planes that meet along the z axis at a material angle: below pi the edge is convex."""
    opening = angle if convex else 2 * math.pi - angle
    a, first = placed((0.0, 0.0, 0.0), UP[1], UP[0])
    direction = np.array([math.cos(opening), math.sin(opening), 0])
    normal = np.array([-math.sin(opening), math.cos(opening), 0])
    b, second = placed((0.0, 0.0, 0.0), normal, direction)
    t = np.linspace(0, 1, 5)
    z = 10 * t
    uv = []
    for frame in (first, second):
        uv.append(np.column_stack([z[:, None] * UP[2]]) @ frame.axes[:2].T)
    return corner(
        (Plane(first), Geom_Plane(a)),
        (Plane(second), Geom_Plane(b)),
        (uv[0], uv[1]),
        (-UP[1], normal),
        t,
        convex=convex,
    )


def rim(kind: str, *, convex: bool) -> Corner:
    """A plane at z = 2 that cuts a surface of revolution about z.

    Convex: the material is below the plane and inside; concave: below the plane or inside.
    """
    axis, frame = placed((0.0, 0.0, 0.0), UP[2], UP[0])
    at, where = placed((0.0, 0.0, 2.0), UP[2], UP[0])
    t = np.arange(24) / 24
    u = 2 * np.pi * t
    name = kind.removeprefix("left-handed ")
    if name != kind:
        axis.YReverse()
        frame = LocalFrame(frame.origin, frame.axes * np.array([[1], [-1], [1]]))
        u = -u
    if name == "cylinder":
        primary, kernel, v, radius = Cylinder(frame, 8.0), Geom_CylindricalSurface(axis, 8.0), 2.0, 8.0
    elif name == "cone":
        primary, kernel = Cone(frame, 8.0, 0.4, 1.0), Geom_ConicalSurface(axis, 0.4, 8.0)
        v, radius = 2 / math.cos(0.4), 8 + 2 * math.tan(0.4)
    elif name == "sphere":
        primary, kernel = Sphere(frame, 8.0, UP[2], True), Geom_SphericalSurface(axis, 8.0)
        v, radius = math.asin(0.25), math.sqrt(60)
    else:
        primary = RevolvedEllipse.from_ellipse(frame, np.array([[7.0, 0, 0], [3, 0, 0], [0, 0, 3]]))
        kernel, v = Geom_ToroidalSurface(axis, 7.0, 3.0), math.asin(2 / 3)
        radius = 7 + 3 * math.cos(v)
    plane = Plane(where), Geom_Plane(at)
    ring = radius * np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)], -1)
    uv = (ring, np.column_stack([u, np.full(len(t), v)]))
    return corner(plane, (primary, kernel), uv, (UP[2], UP[0]), t, convex=convex)


def wave(*, convex: bool) -> Corner:
    """A wavy B-spline sheet, the top of a block, and the block's side plane y = 0."""
    greville = np.array([0, 1, 2, 3, 4, 5]) * 4.0
    x, y = np.meshgrid(greville, greville - 10, indexing="ij")
    poles = np.stack([x, y, 1.5 * np.sin(x / 3) * np.cos(y / 4)], -1)
    knots = (clamped(3, [1 / 3, 2 / 3]), clamped(3, [1 / 3, 2 / 3]))
    primary = TensorSurface.from_spline(Surface.from_bspline((3, 3), knots, poles))
    kernel = kernel_surface((3, 3), knots, poles)
    a, frame = placed((0.0, 0.0, 0.0), UP[1], UP[2])
    t = np.linspace(0, 1, 9)
    uv = np.column_stack([np.linspace(0.2, 0.8, 9), np.full(9, 0.5)])
    for _ in range(30):  # onto y = 0
        jet = Pair("", primary, kernel, ((0, 1), (0, 1))).jet(uv)
        uv[:, 1] -= jet[0, :, 1] / jet[2, :, 1]
    on_plane = Pair("", primary, kernel, ((0, 1), (0, 1))).jet(uv)[0] @ frame.axes[:2].T
    side = UP[1] if convex else -UP[1]  # concave: the block stands in front, the sheet goes on as a floor
    return corner((primary, kernel), (Plane(frame), Geom_Plane(a)), (uv, on_plane), (UP[2], side), t, convex=convex)


KINDS = ("cylinder", "cone", "sphere", "torus")
CORNERS = {
    **{
        f"{'convex' if c else 'concave'} wedge of {a:g}": wedge(a, convex=c)
        for a in (0.6, math.pi / 2, 2.4)
        for c in (True, False)
    },
    **{
        f"{'convex' if c else 'concave'} {hand}{kind} rim": rim(hand + kind, convex=c)
        for kind in KINDS
        for hand in ("", "left-handed ")
        for c in (True, False)
    },
    "convex wave": wave(convex=True),
    "concave wave": wave(convex=False),
}
every = pytest.mark.parametrize("joint", CORNERS.values(), ids=CORNERS.keys())


def jets(joint: Corner, contacts: Contacts) -> list[np.ndarray]:
    return [
        Pair("", side.primary, kernel, ((0, 1), (0, 1))).jet(uv)
        for side, kernel, uv in zip(joint.sides, joint.kernels, contacts.uv, strict=True)
    ]


def outward_normals(joint: Corner, found: list[np.ndarray]) -> list[np.ndarray]:
    normals = [side.outward * np.cross(jet[1], jet[2]) for side, jet in zip(joint.sides, found, strict=True)]
    return [n / np.linalg.norm(n, axis=1, keepdims=True) for n in normals]


def swapped(joint: Corner) -> Corner:
    """Call the second face the first: the edge then runs the other way round."""
    stations = joint.stations
    turned = Stations(stations.t, stations.points, -stations.tangents, stations.uv[::-1])
    return Corner(joint.sides[::-1], joint.kernels[::-1], turned, joint.convex)


@every
def test_convex_and_concave_are_told_apart_and_directions_lead_into_the_faces(joint):
    for one in (joint, swapped(joint)):
        into1, into2, turn = compute_inward_directions(one.sides, one.stations)
        assert ((turn > 0) == joint.convex).all()
        n1, n2 = outward_normals(one, jets(one, Contacts(None, None, one.stations.uv, None)))
        assert np.abs(np.abs(turn) - np.linalg.norm(np.cross(n1, n2), axis=1)).max() < 1e-13
        for into, other in ((into1, 1), (into2, 0)):
            n = outward_normals(one, jets(one, Contacts(None, None, one.stations.uv, None)))
            away = (into * n[other]).sum(
                1
            )  # into a face means below the other one at a convex edge, above at a concave
            assert (away < 0).all() == joint.convex


@every
def test_ball_touches_both_faces_on_the_right_side(joint):
    radius = 0.7
    contacts = solve_ball_contacts(joint.sides, joint.stations, radius)
    found = jets(joint, contacts)
    sign = -1 if joint.convex else 1  # the ball is in the material at a convex edge
    centre = [jet[0] + sign * radius * n for jet, n in zip(found, outward_normals(joint, found), strict=True)]
    assert np.abs(centre[0] - centre[1]).max() < 1e-12
    offset = centre[0] - joint.stations.points
    assert np.abs((offset * joint.stations.tangents).sum(1)).max() < 1e-12
    assert np.linalg.norm(offset, axis=1).min() > radius


@every
def test_a_radius_for_each_station(joint):
    radii = np.linspace(0.2, 1.1, len(joint.stations.t))
    contacts = solve_ball_contacts(joint.sides, joint.stations, radii)
    found = jets(joint, contacts)
    sign = -1 if joint.convex else 1
    centre = [jet[0] + sign * radii[:, None] * n for jet, n in zip(found, outward_normals(joint, found), strict=True)]
    assert np.abs(centre[0] - centre[1]).max() < 1e-12
    assert np.abs(((centre[0] - joint.stations.points) * joint.stations.tangents).sum(1)).max() < 1e-12


@every
def test_equal_radii_and_widths_are_the_number_bit_for_bit(joint):
    count = len(joint.stations.t)
    one, many = (solve_ball_contacts(joint.sides, joint.stations, r) for r in (0.7, np.full(count, 0.7)))
    first, both = (
        solve_setback_contacts(joint.sides, joint.stations, widths)
        for widths in ((0.4, 0.9), (np.full(count, 0.4), np.full(count, 0.9)))
    )
    for number, array in ((one, many), (first, both)):
        assert all(np.array_equal(a, b) for a, b in zip(number.uv, array.uv, strict=True))
        assert np.array_equal(number.cross_lengths, array.cross_lengths)


@every
def test_widths_for_each_station(joint):
    widths = np.linspace(0.2, 0.9, len(joint.stations.t)), np.linspace(0.8, 0.3, len(joint.stations.t))
    contacts = solve_setback_contacts(joint.sides, joint.stations, widths)
    for jet, width in zip(jets(joint, contacts), widths, strict=True):
        assert np.abs(np.linalg.norm(jet[0] - joint.stations.points, axis=1) - width).max() < 1e-12


def test_a_ball_that_does_not_fit_is_named_with_its_radius_and_place():
    joint = wave(convex=False)
    radii = np.where(joint.stations.t < 1, 90.0, 0.5)
    with pytest.raises(SizeError, match=r"no ball of radius 90 touches both faces at t = 0 of the edge") as caught:
        solve_ball_contacts(joint.sides, joint.stations, radii)
    assert (caught.value.value, caught.value.place) == (90.0, 0.0)


@every
def test_cross_derivatives_are_as_long_as_a_cubic_arc_asks(joint):
    radius = 0.7
    contacts = solve_ball_contacts(joint.sides, joint.stations, radius)
    n1, n2 = outward_normals(joint, jets(joint, contacts))
    opening = np.arccos(np.clip((n1 * n2).sum(1), -1, 1))
    assert np.abs(contacts.cross_lengths - 4 * radius * np.tan(opening / 4)).max() < 1e-7 * radius


@every
def test_swapping_the_sides_swaps_the_contacts(joint):
    there, back = (solve_ball_contacts(one.sides, one.stations, 0.5) for one in (joint, swapped(joint)))
    for i in (0, 1):
        assert np.abs(there.uv[i] - back.uv[1 - i]).max() < 1e-12


@every
def test_widths_are_distances_in_the_station_plane(joint):
    widths = (0.4, 0.9)
    contacts = solve_setback_contacts(joint.sides, joint.stations, widths)
    into = compute_inward_directions(joint.sides, joint.stations)[:2]
    found = jets(joint, contacts)
    for jet, width, direction in zip(found, widths, into, strict=True):
        offset = jet[0] - joint.stations.points
        assert np.abs(np.linalg.norm(offset, axis=1) - width).max() < 1e-12
        assert np.abs((offset * joint.stations.tangents).sum(1)).max() < 1e-12
        assert ((offset * direction).sum(1) > 0).all()
    chord = np.linalg.norm(found[1][0] - found[0][0], axis=1)
    for reach, width in zip(contacts.cross_lengths, widths, strict=True):
        assert np.abs(reach - chord * 2 * width / sum(widths)).max() < 1e-13
        assert (reach / 3 < width).all()


@every
def test_stations_off_by_a_tolerance_are_moved_onto_both_surfaces(joint):
    shaken = np.random.default_rng(3)
    uv = [at + 1e-6 * shaken.normal(size=at.shape) for at in joint.stations.uv]
    stations = replace(joint.stations, uv=(uv[0], uv[1]))
    exact = project_to_intersection(joint.sides, stations, 10.0)
    one, two = jets(joint, Contacts(None, None, exact.uv, None))
    assert np.abs(one[0] - two[0]).max() < 1e-13
    assert np.abs(exact.points - one[0]).max() < 1e-13
    assert np.abs(((exact.points - joint.stations.points) * joint.stations.tangents).sum(1)).max() < 1e-13
    n1, n2 = outward_normals(joint, [one, two])
    assert np.abs((exact.tangents * n1).sum(1)).max() < 1e-13
    assert np.abs((exact.tangents * n2).sum(1)).max() < 1e-13
    assert ((exact.tangents * joint.stations.tangents).sum(1) > 0.9).all()


@pytest.mark.parametrize("angle", [0.6, math.pi / 2, 2.4])
def test_ball_between_planes_touches_at_the_tangent_length(angle):
    contacts = solve_ball_contacts((joint := wedge(angle, convex=True)).sides, joint.stations, 1.3)
    for jet in jets(joint, contacts):
        length = np.linalg.norm(jet[0] - joint.stations.points, axis=1)
        assert np.abs(length - 1.3 / math.tan(angle / 2)).max() < 1e-13


def test_ball_on_a_cylinder_rim_touches_where_the_torus_of_a_fillet_does():
    joint = rim("cylinder", convex=True)
    plane, cylinder = jets(joint, solve_ball_contacts(joint.sides, joint.stations, 1.5))
    assert np.abs(np.hypot(plane[0, :, 0], plane[0, :, 1]) - 6.5).max() < 1e-13
    assert np.abs(cylinder[0, :, 2] - 0.5).max() < 1e-13


# Sizes that do not fit.


def test_ball_that_touches_nothing_is_refused_with_its_number():
    joint = wave(convex=False)
    with pytest.raises(SizeError, match=r"no ball of radius 90 touches both faces at t = [0-9.]+ of the edge"):
        solve_ball_contacts(joint.sides, joint.stations, 90.0)


def test_width_beyond_a_sphere_is_refused_with_its_number():
    joint = rim("sphere", convex=True)
    with pytest.raises(SizeError, match=r"no point of the face lies at width 20 from the edge at t = 0"):
        solve_setback_contacts(joint.sides, joint.stations, (1.0, 20.0))


def test_edge_that_changes_between_convex_and_concave_is_refused():
    joint = wedge(math.pi / 2, convex=True)
    direction = joint.stations.tangents * np.array([1, 1, 1, -1, -1])[:, None]
    with pytest.raises(GeometryError, match="between convex and concave"):
        solve_ball_contacts(joint.sides, replace(joint.stations, tangents=direction), 1.0)


def test_surfaces_that_do_not_cross_are_named_with_the_place():
    _, frame = placed((0.0, 0.0, 0.0), UP[2], UP[0])
    _, above = placed((0.0, 0.0, 1.0), UP[2], UP[0])
    uv = np.zeros((3, 2))
    t = np.array([0.0, 0.5, 1.0])
    stations = Stations(t, np.zeros((3, 3)), np.tile(UP[0], (3, 1)), (uv, uv))
    with pytest.raises(GeometryError, match="do not cross cleanly at t = 0"):
        project_to_intersection((SupportSurface(Plane(frame), 1.0), SupportSurface(Plane(above), 1.0)), stations, 1.0)
