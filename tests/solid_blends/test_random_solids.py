"""Everyday bodies, each with something in it that once went wrong: found by attacking the library as a user would."""

import cadquery as cq
import pytest
from OCP.BRepCheck import BRepCheck_Analyzer

import cqblend
from cqblend.errors import CqblendError, GeometryError, SelectionError, SizeError


def sound(body: cq.Shape, edge: cq.Edge, *, grows: bool = False, **size: object) -> cqblend.BlendResult:
    result = cqblend.blend_edges(body, edge, **size)
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    assert cqblend.verify(result.shape, result.faces).ok
    box, before = result.shape.BoundingBox(), body.BoundingBox()
    assert box.DiagonalLength <= before.DiagonalLength * (1 + 1e-6)
    assert (result.shape.Volume() > body.Volume()) == grows
    return result


def edge_at(body: cq.Shape, *point: float) -> cq.Edge:
    return min(body.Edges(), key=lambda edge: (edge.positionAt(0.5) - cq.Vector(*point)).Length)


# A blend must not run through faces it has nothing to do with.


@pytest.mark.parametrize("radius", [4, 6])
def test_a_blend_larger_than_a_wall_is_refused(radius):
    body = cq.Workplane().box(20, 20, 20).faces(">Z").shell(-1).val()
    with pytest.raises(SizeError, match="edge"):
        cqblend.blend_edges(body, edge_at(body, 10, 0, -10), radius)


def test_a_blend_within_a_wall_is_fine():
    body = cq.Workplane().box(20, 20, 20).faces(">Z").shell(-1).val()
    sound(body, edge_at(body, 10, 0, -10), radius=1)


def test_a_blend_into_a_void_is_refused():
    body = cq.Solid.makeBox(20, 20, 20, cq.Vector(-10, -10, -10)).cut(cq.Solid.makeSphere(1.2, cq.Vector(8, 0, 8)))
    with pytest.raises(SizeError, match="edge"):
        cqblend.blend_edges(body, edge_at(body, 10, 0, 10), 5)
    sound(body, edge_at(body, 10, 0, 10), radius=1.5)


# Widths may differ.


@pytest.mark.parametrize("width", [(1, 3), (1, 4), (1, 15), (4, 1)])
def test_unequal_widths_stay_inside_the_body(width):
    body = cq.Workplane().box(20, 20, 20).val()
    result = sound(body, edge_at(body, 10, 10, 0), width=width)
    assert result.faces[0].BoundingBox().xmax <= 10 + 2e-7  # a box around a face is as much larger as its tolerance
    assert result.faces[0].BoundingBox().ymax <= 10 + 2e-7  # a box around a face is as much larger as its tolerance


@pytest.mark.parametrize("width", [(3, 0.5), (0.5, 3)])
def test_unequal_widths_on_a_rim(width):
    body = cq.Solid.makeCylinder(5, 10)
    sound(body, edge_at(body, -5, 0, 10), width=width)


def test_a_bulge_that_makes_sections_loop_is_refused():
    body = cq.Workplane().box(20, 20, 20).val()
    with pytest.raises(GeometryError, match="smaller bulge"):
        cqblend.blend_edges(body, edge_at(body, 10, 10, 0), 3, bulge=5)
    sound(body, edge_at(body, 10, 10, 0), radius=3, bulge=1.5)


# Ends, seams and chains.


def test_the_rim_of_a_pocket():
    """It ends at corners that turn inwards: in the planes of the walls there, which grow by what they bound of it."""
    body = cq.Workplane().box(30, 30, 10).faces(">Z").workplane().rect(10, 10).cutBlind(-5).val()
    result = sound(body, edge_at(body, 0, 5, 5), radius=0.5)
    assert [end.kind for end in result.certificate.ends] == ["natural", "natural"]
    assert result.certificate.coverage == 1


def test_a_border_that_was_a_seam():
    body = cq.Solid.makeCylinder(6, 10).cut(cq.Solid.makeBox(30, 30, 30, cq.Vector(-15, 0, -10)))
    for z in (0, 10):
        sound(body, edge_at(body, 0, -6, z), radius=0.7)


def test_the_middle_of_an_edge_on_a_seam():
    body = cq.Solid.makeCylinder(6, 10).cut(cq.Solid.makeBox(30, 30, 6, cq.Vector(3, -15, 5)))
    arcs = [edge for edge in body.Edges() if edge.geomType() == "CIRCLE" and abs(edge.Center().z - 5) < 1e-6]
    assert arcs
    sound(body, arcs[0], radius=0.4)


def test_a_chain_does_not_turn_corners():
    """Half a cone: its two straight edges meet at the apex, between the same two faces."""
    body = (
        cq.Workplane().add(cq.Solid.makeCone(8, 0, 12)).cut(cq.Workplane().box(30, 30, 30).translate((15, 0, 0))).val()
    )
    with pytest.raises(CqblendError) as caught:  # there is no room at the apex, which is another matter
        cqblend.blend_edges(body, edge_at(body, 0, 4, 6), 0.5)
    assert "t = 0.5" not in str(caught.value)


def test_a_body_far_from_the_origin():
    plate = cq.Workplane().box(40, 40, 10).faces(">Z").workplane().circle(8).extrude(15).val()
    body = plate.translate(cq.Vector(1e5, 0, 0))
    result = cqblend.blend_edges(body, edge_at(body, 1e5 - 8, 0, 5), 2)
    assert result.certificate.angle < 1e-8


def test_what_remains_of_an_edge_must_be_an_edge():
    body = cq.Workplane().box(20, 20, 10).val()
    with pytest.raises(SizeError):
        cqblend.blend_edges(body, edge_at(body, 10, 0, 5), 9.9999999)


def test_an_edge_of_two_solids_is_refused():
    left = cq.Solid.makeBox(10, 10, 10)
    right = cq.Solid.makeBox(10, 10, 10, cq.Vector(10, 0, 0))
    glued = cq.Workplane().add(left).add(right)
    compound = cq.Compound.makeCompound(glued.vals())
    shared = compound.fuse(glue=True) if hasattr(compound, "fuse") else compound
    doubled = [e for e in shared.Edges() if sum(any(e.isSame(o) for o in s.Edges()) for s in shared.Solids()) == 2]
    if doubled:
        with pytest.raises(SelectionError, match="2 solids"):
            cqblend.blend_edges(shared, doubled[0], 1)
