"""Several edges in one call: networks that cannot be blended are left out whole, or nothing is returned."""

from __future__ import annotations

import cadquery as cq
import pytest

import cqblend
from cqblend.errors import SelectionError, SizeError, UnsupportedError


def stepped_plate() -> cq.Workplane:
    """Return a plate with a wide hole, a narrow one whose rim has no room, and a boss."""
    plate = cq.Workplane().box(40, 20, 6).faces(">Z").workplane().center(-12, 0).hole(8)
    plate = plate.faces(">Z").workplane(origin=(0, 0, 0)).center(4, 0).hole(3)
    return plate.union(cq.Workplane().center(7.6, 0).circle(2).extrude(8))


def rims(body: cq.Workplane) -> list[cq.Edge]:
    found = [edge for edge in body.edges("%CIRCLE").vals() if abs(edge.Center().z - 3) < 1e-6]
    return sorted(found, key=lambda edge: edge.Center().x)


def test_an_error_of_one_edge_is_raised_with_its_name_and_nothing_is_blended():
    body = stepped_plate()
    edges = rims(body)
    assert len(edges) == 3
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, edges, 1)
    number = body.val().Edges().index(edges[1]) + 1
    assert caught.value.shape in {f"edge {number}", f"edge {body.val().Edges().index(edges[2]) + 1}"}


def test_networks_that_fail_are_left_out_and_recorded():
    body = stepped_plate()
    edges = rims(body)
    result = cqblend.blend_edges(body, edges, 1, on_error="skip")
    numbers = [body.val().Edges().index(edge) + 1 for edge in edges]
    left_out = {number for one in result.skipped for number in one.edges}
    assert left_out
    assert left_out < set(numbers)
    assert len(result.faces) == len(numbers) - len(left_out)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, result.faces).ok
    assert {rail.edge for rail in result.certificate.rails} == set(numbers) - left_out
    for one in result.skipped:
        assert one.kind == "too large"
        assert f"edge {one.edges[0]}" in one.message
        assert f"passed over: {one.message}" in str(result.certificate)


def test_edges_that_touch_are_left_out_together():
    box = cq.Workplane().box(30, 20, 10)
    corner = [*box.edges("|Z and >X and >Y").vals(), *box.edges(">Z and >X").vals()]
    alone = box.edges("|Z and <X and <Y").vals()
    sizes = {corner[0]: 2.0, alone[0]: 2.0, corner[1]: 11.0}
    result = cqblend.blend_edges(box, list(sizes), sizes, on_error="skip")
    number = {edge: box.val().Edges().index(edge) + 1 for edge in (*corner, *alone)}
    (left_out,) = result.skipped
    assert set(left_out.edges) == {number[edge] for edge in corner}
    assert left_out.kind == "too large"
    assert len(result.faces) == 1
    assert {rail.edge for rail in result.certificate.rails} == {number[alone[0]]}


def test_blends_that_do_not_fit_together_are_told_and_the_later_one_is_left_out():
    box = cq.Workplane().box(30, 20, 10)
    edges = box.edges("|Z and >X").vals()
    with pytest.raises(SizeError, match="together with the blend of edge"):
        cqblend.blend_edges(box, edges, 11)
    result = cqblend.blend_edges(box, edges, 11, on_error="skip")
    assert len(result.faces) == len(result.skipped) == 1
    assert result.shape.isValid()


def test_where_nothing_is_left_to_blend_the_error_is_raised():
    box = cq.Workplane().box(30, 20, 10)
    with pytest.raises(SizeError):
        cqblend.blend_edges(box, box.edges("|Z"), 30, on_error="skip")
    with pytest.raises(UnsupportedError):
        cqblend.blend_edges(box, box.edges(">Z"), 1, hold=box.edges("<Z and >X").vals(), on_error="skip")
    with pytest.raises(SelectionError):
        cqblend.blend_edges(box, cq.Workplane().box(1, 1, 1).edges(), 1, on_error="skip")


@pytest.mark.parametrize("order", [1, -1])
def test_the_result_does_not_depend_on_the_order_of_the_picks(order):
    body = cq.Workplane().box(20, 20, 5).faces(">Z").workplane().rarray(6, 6, 2, 2).hole(3)
    edges = [*body.faces(">Z").edges("%CIRCLE").vals(), *body.edges("|Z and >X").vals()]
    result = cqblend.blend_edges(body, edges[::order], 0.8)
    assert len(result.faces) == 6
    assert result.shape.isValid()
    whole = cqblend.blend_edges(body, edges, 0.8)
    assert result.shape.Volume() == pytest.approx(whole.shape.Volume(), rel=1e-12)


def test_edges_of_several_solids_of_a_compound():
    first = cq.Workplane().box(10, 10, 10)
    second = cq.Workplane().box(10, 10, 10).translate((30, 0, 0))
    both = cq.Compound.makeCompound([first.val(), second.val()])
    edges = cq.Workplane(both).edges("|Z and >Y").vals()
    result = cqblend.blend_edges(both, edges, 2)
    assert len(result.faces) == 4
    assert len(result.shape.Solids()) == 2
    assert result.shape.isValid()


def test_a_blend_that_runs_into_another_one_names_it():
    work = cq.Workplane().box(40, 20, 6).faces(">Z").workplane()
    plate = work.pushPoints([(-10, 0), (12, 0), (17, 0)]).hole(4)
    rims = sorted(plate.faces(">Z").edges("%CIRCLE").vals(), key=lambda edge: edge.Center().x)
    numbers = [plate.val().Edges().index(edge) + 1 for edge in rims]
    result = cqblend.blend_edges(plate, rims, 0.8, on_error="skip")
    (left_out,) = result.skipped
    assert left_out.edges == (numbers[2],)
    assert f"together with the blend of edge {numbers[1]}" in left_out.message
    assert len(result.faces) == 2
    assert result.shape.isValid()


def test_the_certificate_lists_what_was_blended_and_the_share_of_what_was_meant():
    body = stepped_plate()
    edges = rims(body)
    numbers = {edge: body.val().Edges().index(edge) + 1 for edge in edges}
    whole = cqblend.blend_edges(body, edges, 0.04).certificate
    assert set(whole.blended) == set(numbers.values())
    assert whole.coverage == 1
    result = cqblend.blend_edges(body, edges, 1, on_error="skip")
    left_out = {number for one in result.skipped for number in one.edges}
    certificate = result.certificate
    assert set(certificate.blended) == set(numbers.values()) - left_out
    done = sum(edge.Length() for edge in edges if numbers[edge] not in left_out)
    assert certificate.coverage == pytest.approx(done / sum(edge.Length() for edge in edges), rel=1e-6)


def test_all_pieces_of_a_joint_are_listed_as_blended():
    """Of a row of boxes, whose faces are united, one piece of a long edge is picked."""
    row = cq.Workplane().box(10, 10, 5).union(cq.Workplane().box(10, 10, 5).translate((10, 0, 0)), clean=False)
    body = row.val().Solids()[0]
    pieces = [e for e in body.Edges() if abs(e.Center().y + 5) < 1e-6 and abs(e.Center().z - 2.5) < 1e-6]
    numbers = sorted(body.Edges().index(edge) + 1 for edge in pieces)
    assert len(numbers) == 2
    for picked in (pieces[0], pieces[1], pieces):
        certificate = cqblend.blend_edges(body, picked, 1).certificate
        assert sorted(certificate.blended) == numbers
        assert certificate.coverage == 1
