"""Proofs of blends around an axis bound what OCCT and long doubles measure, are near to it, and see what is off.

A share of the random joints runs with the tests; ``PROOF_FUZZ=320 pytest`` on this file runs as many.
"""

from __future__ import annotations

import os
from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from proof_witness import Measured
from round_solids import KINDS, find_corner, find_rails, is_turned, measure_joint, place_at_random, revolve_outline

import cqblend
from cqblend.blends.quality.circular_joint_proof import AngularLine, TurnedProfile, prove_circular_joint
from cqblend.blends.quality.smoothness_proof import Proof
from cqblend.surfaces.circle import PlanarCircle
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.vectors import LocalFrame

SEEDS = range(int(os.environ.get("PROOF_FUZZ", "27")))
HALF_TURN = float(np.pi)


def blend_random_corner(seed: int) -> cqblend.BlendResult | None:
    """Blend the corner of a random solid of revolution, none if its interior has a crease."""
    rng = np.random.default_rng([77, seed])
    size, away = float(rng.choice([0.05, 1, 10, 100])), float(rng.choice([0, 0, 10, 100, 1000]))
    turn = float(rng.choice([360, 360, rng.uniform(60, 300)]))
    solid = revolve_outline(KINDS[seed % len(KINDS)], size, rng, turn).val()
    solid, corner = (
        place_at_random(shape, size * away, np.random.default_rng([78, seed]))
        for shape in (solid, cq.Vertex.makeVertex(0, 0, 0))
    )
    radius = size * rng.uniform(0.05, 0.12)
    kind = rng.choice(["radius", "width", "potential", "pde"], p=[0.5, 0.3, 0.1, 0.1])
    if kind == "potential":
        options = {"section": "potential", "a": radius, "b": radius * rng.uniform(0.5, 1)}
    elif kind == "pde":
        options = {"section": "pde", "radius": radius}
    else:
        continuity = [("G1", "G1"), ("G2", "G2"), ("G1", "G2"), ("G3", "G3")][rng.integers(4)]
        options = {"radius": radius} if kind == "radius" else {"width": (radius, radius * rng.uniform(0.5, 1))}
        options |= {
            "section": "hermite",
            "continuity": continuity,
            "bulge": 1.0 if rng.random() < 0.8 else rng.uniform(0.4, 1.2),
        }
    try:
        return cqblend.blend_edges(solid, find_corner(solid, corner.Center()), **options)
    except cqblend.errors.GeometryError:  # a crease inside, which interiors may have
        assert kind in ("potential", "pde")
        return None


def measure_rails(result: cqblend.BlendResult) -> list[Measured]:
    """Measure the blend face at all circles that it shares with smooth neighbours."""
    found = []
    for blend, face, edge in find_rails(result):
        if isinstance(BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 1.0), Geom2d_Circle | Geom2d_Line):
            found += measure_joint(blend.wrapped, face.wrapped, edge.wrapped)
    return [one for one in found if one.angle < 1e-3]


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_measured_above_what_is_proven(seed):
    result = blend_random_corner(seed)
    if result is None or not is_turned(result):
        return
    proof, measured = result.certificate.proof, measure_rails(result)
    assert len(measured) >= 4  # two rails, measured twice
    assert max(one.gap for one in measured) <= proof.gap
    assert max(one.angle for one in measured) <= proof.angle
    for side in proof.sides:
        assert side.angle <= proof.angle < 1e-9
    if proof.curvature_jump is not None:
        assert max(one.curvature_jump for one in measured) <= proof.curvature_jump


def test_most_of_the_random_joints_are_surfaces_of_revolution():
    made = [blend_random_corner(seed) for seed in range(9)]
    kinds = [is_turned(one) for one in made if one is not None]
    assert sum(kinds) >= 6


@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_near_the_origin_is_proven_to_a_few_hundred_roundings(kind):
    solid = revolve_outline(kind, 10.0, np.random.default_rng(3)).val()
    proof = cqblend.blend_edges(solid, find_corner(solid, cq.Vector()), 0.7, section="hermite").certificate.proof
    assert proof.gap < 3e-13
    assert proof.angle < 1e-13


def prove_quarter(support, rail, end: int = 1, order: int = 2) -> Proof:
    """Prove a quarter of an ellipse-like cubic that leaves z = 0 at radius 4 outwards and ends at radius 5 upwards."""
    poles = np.array([[4.0, 0, 0], [4.5, 0, 0], [5, 0, 0.5], [5, 0, 1.0]])
    knots = np.repeat([0.0, 1.0], 4)
    strip = TurnedProfile(np.zeros(3), np.array([0.0, 0, 1]), (3, knots, poles, None))
    return prove_circular_joint(strip, end, support, rail, HALF_TURN, order)


def tilt(angle: float) -> np.ndarray:
    """Return axes that are turned about x."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, cos, sin], [0, -sin, cos]])


WALL = AngularLine(np.array([0.0, 1.0]), 1.0)
CIRCLE = PlanarCircle(np.zeros(2), np.eye(2), 4.0)


@pytest.mark.parametrize("by", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("flat", [True, False])
def test_an_axis_that_is_tilted_shows_in_gap_and_angle(by, flat):
    support = Plane(LocalFrame(np.zeros(3), tilt(by))) if flat else Cylinder(LocalFrame(np.zeros(3), tilt(by)), 5.0)
    proof = prove_quarter(support, CIRCLE if flat else WALL, 0 if flat else 1)
    assert by <= proof.angle < 3 * by + 1e-13
    assert (4 if flat else 1) * by <= proof.gap < 20 * by + 1e-13


@pytest.mark.parametrize("by", [1e-12, 1e-9, 1e-6])
def test_an_axis_that_is_moved_shows_in_the_gap(by):
    cylinder = Cylinder(LocalFrame(np.array([by, 0, 0]), np.eye(3)), 5.0)
    proof = prove_quarter(cylinder, WALL)
    assert by <= proof.gap < 2 * by + 1e-13
    assert proof.angle < 1e-13


def test_frames_that_are_not_orthonormal_show():
    skewed = np.eye(3)
    skewed[1, 0] = 1e-9
    assert prove_quarter(Cylinder(LocalFrame(np.zeros(3), skewed), 5.0), WALL).angle >= 1e-9


def test_the_jump_of_curvature_is_that_of_the_sections():
    """The wall is a cylinder; the profile's own curvature at its end, 2/3 |P1 P2 x ..| / |P2 P3|^3, is the jump."""
    proof = prove_quarter(Cylinder(LocalFrame(np.zeros(3), np.eye(3)), 5.0), WALL)
    assert proof.curvature_jump == pytest.approx(2 / 3 * 0.5 * 0.5 / 0.5**3, rel=1e-12)
    assert prove_quarter(Plane(LocalFrame(np.zeros(3), np.eye(3))), CIRCLE, 0, order=1).curvature_jump is None


def test_an_end_that_stands_across_its_support_is_no_joint():
    proof = prove_quarter(Plane(LocalFrame(np.array([0, 0, 1.0]), np.eye(3))), replace(CIRCLE, radius=5.0), 1)
    assert proof.angle == np.pi
    assert proof.curvature_jump is None
