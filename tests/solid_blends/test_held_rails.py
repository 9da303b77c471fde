"""Rails held on an edge: the ball rolls along it and touches the other face; the face between goes."""

from __future__ import annotations

import subprocess
import sys

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepExtrema import BRepExtrema_DistShapeShape

import cqblend
from cqblend.brep.step_files import read_step, write_step
from cqblend.errors import InputError, SelectionError, SizeError, TopologyError, UnsupportedError

STEP = cq.Workplane("XZ").polyline([(0, 0), (40, 0), (40, 6), (20, 6), (20, 8), (0, 8)]).close().extrude(20).val()
PLATE = cq.Workplane().polyline([(0, 0), (30, -4), (30, 24), (0, 20)]).close().extrude(3).val()
GROOVE = (
    cq.Workplane("XZ")
    .polyline([(0, 0), (40, 0), (40, 10), (25, 10), (25, 4), (22, 2), (0, 2)])
    .close()
    .extrude(20)
    .val()
)
DISC = cq.Workplane().circle(20).extrude(4).faces(">Z").workplane().circle(12).extrude(2).val()
HALF = cq.Workplane().moveTo(-12, 0).threePointArc((0, 12), (12, 0)).close().extrude(3).val()
TAPER = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (30, 5), (0, 3)]).close().extrude(12).val()
LEDGE = (
    cq.Workplane("XZ")
    .spline([(0, 1), (7, 1.6), (14, 1), (20, 1.2)])
    .lineTo(20, 6)
    .lineTo(0, 6)
    .close()
    .extrude(9)
    .val()
)
ROUNDED = cq.Workplane().box(30, 12, 10).edges("|Y and >X and <Z").fillet(7).val()
ELLIPSE = cq.Workplane().ellipse(14, 9).extrude(3).val()

CASES = {
    # body, a point near the blended edge and one near the held one, radius
    "step": (STEP, (20, -10, 8), (20, -10, 6), 5),
    "oblique ends": (PLATE, (30, 10, 3), (30, 10, 0), 5),
    "groove": (GROOVE, (25, -10, 4), (22, -10, 2), 8),
    "disc": (DISC, (-12, 0, 6), (-12, 0, 4), 5),
    "half disc": (HALF, (0, 12, 3), (0, 12, 0), 5),
    "taper": (TAPER, (15, 0, 4), (15, 0, 0), 6),
    "spline": (LEDGE, (10, 0, 6), (10, 0, 1.2), 7),
    "smooth edge": (ROUNDED, (15, 0, 5), (15, 0, 2), 6),
    "ellipse": (ELLIPSE, (-14, 0, 3), (-14, 0, 0), 5),
}


def edge_at(body: cq.Shape, point: tuple[float, float, float]) -> cq.Edge:
    return min(body.Edges(), key=lambda edge: (edge.positionAt(0.5) - cq.Vector(*point)).Length)


def blend(name: str, **options: object) -> tuple[cq.Shape, cq.Edge, float, cqblend.BlendResult]:
    body, near, far, radius = CASES[name]
    held = edge_at(body, far)
    return body, held, radius, cqblend.blend_edges(body, edge_at(body, near), radius, hold=held, **options)


def distance(shape: cq.Shape, point: cq.Vector) -> float:
    return BRepExtrema_DistShapeShape(cq.Vertex.makeVertex(*point.toTuple()).wrapped, shape.wrapped).Value()


@pytest.mark.parametrize("name", CASES)
def test_the_blend_runs_from_the_held_edge_and_the_face_between_is_gone(name):
    body, held, _, result = blend(name)
    verification = cqblend.verify(result.shape, result.faces)
    assert verification.ok, verification.problems
    assert len(result.shape.Faces()) == len(body.Faces())  # one gone, one new
    (face,) = result.faces
    (own,) = (edge for edge in face.Edges() if max(distance(edge, held.positionAt(s)) for s in (0.2, 0.5, 0.9)) < 1e-6)
    assert own.Length() == pytest.approx(held.Length(), rel=1e-9)
    assert len(own.ancestors(result.shape, "Face").Faces()) == 2
    rails = result.certificate.rails
    assert sorted(rail.held for rail in rails) == [False, True]
    for rail in rails:
        assert rail.gap < 1e-7
        assert rail.angle > 0.1 if rail.held else rail.angle < 1e-6
    assert result.certificate.angle < 1e-6
    assert "G0, held on the edge of face" in str(result.certificate)


@pytest.mark.parametrize("name", ["step", "groove", "disc", "half disc", "oblique ends"])
def test_arcs_are_exact_and_of_the_radius(name):
    """Points of the face lie on one ball's surface: on planes that is a cylinder, around an axis a torus."""
    _, _, radius, result = blend(name, section="arc")
    (face,) = result.faces
    assert face.geomType() == ("TORUS" if "disc" in name else "CYLINDER")
    adaptor = face._geomAdaptor()
    found = adaptor.Torus().MinorRadius() if "disc" in name else adaptor.Cylinder().Radius()
    assert found == pytest.approx(radius, rel=1e-12)
    assert cqblend.verify(result.shape, result.faces).ok


def test_the_volume_is_that_of_the_segment():
    """Of the step: a triangle between contact, edge and held edge, less the segment of the ball's circle."""
    body, _, radius, result = blend("step", section="arc")
    reach = np.sqrt(2 * radius * 2 - 2**2)  # from the wall to where the ball touches the top
    chord = np.hypot(reach, 2)
    opening = 2 * np.arcsin(chord / 2 / radius)
    lost = 20 * (reach * 2 / 2 - radius**2 / 2 * (opening - np.sin(opening)))
    assert body.Volume() - result.shape.Volume() == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize("name", ["taper", "spline", "ellipse"])
def test_sections_follow_a_ball_that_passes_through_the_held_edge(name):
    """A point in the middle of the blend is as far from the ball's centre as the held edge and the contact are."""
    _, held, radius, result = blend(name)
    (face,) = result.faces
    rail = max(face.Edges(), key=lambda edge: edge.distance(held))  # the other edges touch it
    for share in (0.2, 0.5, 0.8):
        contact = rail.positionAt(share)
        normal = face.normalAt(contact)
        centres = [contact + normal * (sign * radius) for sign in (-1, 1)]
        assert min(abs(distance(held, centre) - radius) for centre in centres) < 1e-4 * radius


def test_continuity_on_the_other_side_and_the_compact_form():
    for options in ({"continuity": "G2"}, {"form": "compact"}, {"continuity": "G2", "form": "compact"}):
        result = blend("step", **options)[3]
        assert cqblend.verify(result.shape, result.faces).ok
        free = next(rail for rail in result.certificate.rails if not rail.held)
        assert free.angle < 1e-5
        if "continuity" in options:
            assert free.curvature_jump < 1e-4


def test_the_input_stays_and_the_order_of_sides_does_not_matter():
    body, near, far, radius = CASES["step"]
    held, edge = edge_at(body, far), edge_at(body, near)
    faces = list(edge.ancestors(body, "Face").Faces())
    volumes = [cqblend.blend_edges(body, edge, radius, hold=held, first=face).shape.Volume() for face in faces]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-12)
    assert len(body.Faces()) == 8
    assert body.isValid()


def test_wires_workplanes_and_shells():
    body, near, far, radius = CASES["disc"]
    wire = cq.Wire.assembleEdges([edge_at(body, far)])
    assert cqblend.blend_edges(body, edge_at(body, near), radius, hold=wire).certificate.valid
    part = cq.Workplane(PLATE).edges(">X and >Z").blend(5, hold=cq.Workplane(PLATE).edges(">X and <Z"))
    assert part.val().isValid()
    shell = cq.Shell.makeShell([face for face in STEP.Faces() if face.Center().z > 0])
    result = cqblend.blend_edges(shell, edge_at(shell, (20, -10, 8)), 5, hold=edge_at(shell, (20, -10, 6)))
    assert result.shape.ShapeType() == "Shell"
    assert cqblend.verify(result.shape, result.faces).ok


def test_what_cannot_be_held_is_refused():
    edge, held = edge_at(STEP, (20, -10, 8)), edge_at(STEP, (20, -10, 6))
    with pytest.raises(SizeError, match=r"too small to be held on edge [0-9]+: .* touches face [0-9]+ before it"):
        cqblend.blend_edges(STEP, edge, 1.5, hold=held)
    with pytest.raises(SizeError, match="the rail reaches the end of face"):
        cqblend.blend_edges(STEP, edge, 120, hold=held)
    with pytest.raises(SelectionError, match="not an edge of a face beside"):
        cqblend.blend_edges(STEP, edge, 5, hold=edge_at(STEP, (40, -10, 0)))
    with pytest.raises(SelectionError, match="not those of one face beside"):
        cqblend.blend_edges(STEP, edge, 5, hold=[held, edge_at(STEP, (0, -10, 8))])
    with pytest.raises(TopologyError, match="has other edges than these two and one at each end"):
        cqblend.blend_edges(STEP, edge, 5, hold=edge_at(STEP, (20, 0, 7)))
    with pytest.raises(UnsupportedError, match="on one edge, not on 2"):
        cqblend.blend_edges(STEP, edge, 5, hold=[held, edge_at(STEP, (20, 0, 7))])
    notched = cq.Workplane(PLATE).cut(cq.Workplane().box(4, 4, 2).translate((30, 10, 0))).val()
    with pytest.raises((TopologyError, SelectionError)):
        cqblend.blend_edges(notched, edge_at(notched, (30, 10, 3)), 5, hold=edge_at(notched, (30, 3, 0)))
    slot = cq.Workplane().slot2D(30, 16).extrude(2).val()
    with pytest.raises(UnsupportedError, match="chain=False"):
        cqblend.blend_edges(slot, edge_at(slot, (0, 8, 2)), 4, hold=edge_at(slot, (0, 8, 0)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 3}, "hold takes a radius"),
        ({"radius": 5, "continuity": ("G1", "G2")}, "give one, not a pair"),
        ({"radius": 5, "tangents": "chord"}, "tangents has no effect with hold"),
        ({"radius": 5, "ends": "flat"}, "ends cannot be flat"),
        ({"radius": 5, "section": "pde"}, "hold is no option of section"),
        ({"section": "potential", "a": 2}, "hold is no option of section"),
        ({"radius": 5, "hold": []}, "hold is empty"),
        ({"radius": 5, "hold": 7}, "hold must be edges"),
        ({"radius": 5, "hold": STEP.Faces()[0]}, "hold must be edges"),
    ],
)
def test_options_that_have_no_meaning_with_hold_are_refused(options, message):
    body, near, far, _ = CASES["step"]
    with pytest.raises(InputError, match=message):
        cqblend.blend_edges(body, edge_at(body, near), **{"hold": edge_at(body, far), **options})
    if options.get("radius") and len(options) == 1:
        cqblend.max_size(body, edge_at(body, near), hold=edge_at(body, far))


def test_the_largest_size_is_not_looked_for():
    body, near, far, _ = CASES["step"]
    with pytest.raises(InputError, match="leave hold out"):
        cqblend.max_size(body, edge_at(body, near), hold=edge_at(body, far))


def test_the_command_line(tmp_path):
    write_step(STEP.wrapped, tmp_path / "in.step")
    command = [sys.executable, "-m", "cqblend", "blend", tmp_path / "in.step", tmp_path / "out.step", "--radius=5"]
    points = ["--near", "20,-10,8", "--hold", "20,-10,6"]
    done = subprocess.run([*command, *points], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "held on edge" in done.stdout
    assert "G0, held" in done.stdout
    back = cq.Shape.cast(read_step(tmp_path / "out.step"))
    assert back.isValid()
    assert back.Volume() == pytest.approx(blend("step")[3].shape.Volume(), rel=1e-9)


def test_shapes_of_build123d():
    build123d = pytest.importorskip("build123d")
    plate = build123d.Box(30, 20, 3)
    low, high = (
        group.sort_by(build123d.Axis.X)[-1]
        for group in plate.edges().filter_by(build123d.Axis.Y).group_by(build123d.Axis.Z)
    )
    result = cqblend.blend_edges(plate, high, 5, hold=build123d.ShapeList([low]))
    assert type(result.shape) is build123d.Part
    assert len(result.shape.faces()) == 6
    assert result.certificate.valid
