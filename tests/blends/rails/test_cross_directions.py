"""The direction in which a ball of varying radius leaves its rail, and the length of the derivative there."""

import numpy as np
import pytest

from cqblend.blends.rails.cross_directions import (
    BallField,
    RailStations,
    compute_unit_directions,
    measure_arc_lengths,
    perpendicular_field,
)
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame

FRAME = LocalFrame(np.array([1.0, 2.0, 3.0]), np.eye(3))
SURFACES = {
    "plane": (Plane(FRAME), lambda t: np.stack([5 * t, np.sin(t)], -1)),
    "cylinder": (Cylinder(FRAME, 6.0), lambda t: np.stack([t, 2 * np.sin(t)], -1)),
    "torus": (
        RevolvedEllipse.from_ellipse(FRAME, np.array([[9.0, 0, 0], [3, 0, 0], [0, 0, 3]])),
        lambda t: np.stack([t, 0.5 + t**2], -1),
    ),
}
T = np.linspace(0.1, 0.9, 9)


def measure_radii(t):
    return 1 + 0.5 * np.sin(2 * t)


def differentiate(function, t, step=1e-3):
    """Return a derivative by central differences of fourth order."""
    return (8 * (function(t + step) - function(t - step)) - function(t + 2 * step) + function(t - 2 * step)) / (
        12 * step
    )


def make_stations(primary, path, sign):
    """Return stations along a path in the parameters; the other contact is on the side of ``sign`` times the normal."""
    jet = primary.jet(path(T))
    normals = sign * np.cross(jet[1], jet[2])
    velocity = differentiate(lambda t: primary.jet(path(t))[0], T)
    aside = np.cross(velocity, normals)
    return RailStations(T, jet, velocity, aside, aside + 0.2 * normals)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("name", SURFACES)
def test_it_is_square_to_the_path_of_the_centre_and_to_the_normal(name, sign):
    primary, path = SURFACES[name]

    def locate_centre(t):
        jet = primary.jet(path(t))
        normal = np.cross(jet[1], jet[2])
        return jet[0] + sign * measure_radii(t)[:, None] * normal / np.linalg.norm(normal, axis=1, keepdims=True)

    stations = make_stations(primary, path, sign)
    unit = compute_unit_directions(BallField(measure_radii), stations)
    centre_rate = differentiate(locate_centre, T)
    centre_rate /= np.linalg.norm(centre_rate, axis=1, keepdims=True)
    assert np.abs((unit * centre_rate).sum(axis=1)).max() < 1e-9
    assert np.abs((unit * stations.normals).sum(axis=1)).max() < 1e-13
    assert (unit * stations.towards_blend).sum() > 0


def test_along_a_plane_it_is_perpendicular_if_the_radius_is_constant():
    stations = make_stations(*SURFACES["plane"], 1)
    ball, plain = (
        compute_unit_directions(field, stations)
        for field in (BallField(lambda t: np.full_like(t, 2.0)), perpendicular_field)
    )
    assert np.abs(ball - plain).max() < 1e-14


@pytest.mark.parametrize("angle", [1e-6, 0.3, 1.5, 2.5, 3.0])
def test_lengths_are_those_of_arcs(angle):
    radius, start = 2.0, 0.7
    tangent = np.array([[-np.sin(start), np.cos(start), 0.0]])
    ends = radius * np.array([[np.cos(a), np.sin(a), 0.0] for a in (start, start + angle)])
    (found,) = measure_arc_lengths(tangent, ends[1:] - ends[:1])
    assert found == pytest.approx(4 * radius * np.tan(angle / 4), rel=1e-9)
