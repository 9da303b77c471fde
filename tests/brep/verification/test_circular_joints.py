"""Proofs of blends around an axis read the finished faces: what is moved there, they see."""

from __future__ import annotations

import cadquery as cq
import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Plane
from OCP.gp import gp_Vec
from OCP.TopoDS import TopoDS
from round_solids import find_corner, find_rails

import cqblend
from cqblend.brep.shell_editing.plan_application import BuiltStrip
from cqblend.brep.verification.circular_joints import prove_revolved_strip

ROD = cq.Solid.makeCylinder(5, 10)


def blend_rim(shape: cq.Shape) -> tuple[cqblend.BlendResult, BuiltStrip]:
    """Blend a rim, and collect the faces and edges of the strip from the finished solid."""
    result = cqblend.blend_edges(shape, find_corner(shape, cq.Vector(0, 0, 10)), 0.7, section="hermite")
    rails = find_rails(result)
    blend = rails[0][0].wrapped
    sides: list[list] = [[], []]
    for _, face, edge in rails:
        sides[round(BRep_Tool.CurveOnSurface_s(edge.wrapped, blend, 0.0, 1.0).Value(0.0).Y())].append((face, edge))
    faces = tuple(TopoDS.Face_s(side[0][0].wrapped) for side in sides)
    edges = tuple([TopoDS.Edge_s(edge.wrapped) for _, edge in side] for side in sides)
    no_poles, not_held = (None, None), (False, False)
    return result, BuiltStrip(TopoDS.Face_s(blend), None, faces, edges, no_poles, (), 0, not_held)


def test_the_certificate_has_the_proof_of_the_finished_faces():
    result, strip = blend_rim(ROD)
    again, proof = prove_revolved_strip(strip, (1, 1)), result.certificate.proof
    assert (again.gap, again.angle) == (proof.gap, proof.angle)
    assert len(proof.sides) == 2


def test_a_rail_in_several_pieces_has_one_bound():
    """The rim of a rod that is cut along: its wall has a seam, at which the rail is split."""
    cutter = cq.Solid.makeBox(20, 20, 20, cq.Vector(-10, -24, -5))
    body = cq.Workplane(ROD.rotate(cq.Vector(), cq.Vector(0, 0, 1), 90)).cut(cq.Workplane(cutter)).val()
    result, strip = blend_rim(body)
    assert len(result.certificate.proof.sides) == 2
    pieces = [prove_revolved_strip(strip, (1, 1)).angle, result.certificate.proof.angle]
    assert pieces[0] == pytest.approx(pieces[1], rel=1e-12)


@pytest.mark.parametrize("by", [1e-9, 1e-6])
def test_a_wall_that_is_moved_afterwards_shows_in_the_proof(by):
    """In place: it is a body of its own."""
    _, strip = blend_rim(cq.Solid.makeCylinder(5, 10))
    before = prove_revolved_strip(strip, (1, 1))
    surfaces = map(BRep_Tool.Surface_s, strip.trimmed_faces)
    (wall,) = (surface for surface in surfaces if not isinstance(surface, Geom_Plane))
    wall.Translate(gp_Vec(by, 0, 0))
    proof = prove_revolved_strip(strip, (1, 1))
    assert before.gap < 3e-13
    assert by <= proof.gap < 2 * by + 1e-12


def test_the_order_decides_whether_curvature_is_bounded():
    _, strip = blend_rim(ROD)
    assert prove_revolved_strip(strip, (1, 1)).curvature_jump is None
    jump = prove_revolved_strip(strip, (2, 2)).curvature_jump
    assert jump is not None
    assert jump > 0.1  # the blend is G1 only
