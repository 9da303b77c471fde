"""Ends of edges in the border of an open shell."""

import cadquery as cq
import numpy as np
import pytest

from cqblend.brep.selection.picked_edges import select_chains


def border_ends(shell: cq.Shape, selector: str):
    edge = cq.Workplane(shell).edges(selector).val()
    selection = select_chains(shell.wrapped, [edge.wrapped], None, None, follow=True)
    ((found,),) = selection.networks
    return found.chain.cells[0].border_ends


BOX = cq.Workplane().box(30, 20, 10)


def test_the_plane_of_a_planar_border():
    shell = cq.Shell.makeShell(BOX.faces("not >Z").vals())
    found = [end for end in border_ends(shell, "|Z and >X and >Y") if end is not None]
    assert len(found) == 1
    assert found[0].is_planar
    assert np.abs(found[0].normal) == pytest.approx([0, 0, 1], abs=1e-12)
    assert found[0].point == pytest.approx([15, 10, 5])
    assert {cq.Edge(edge).geomType() for edge in found[0].edges} == {"LINE"}


def test_a_border_around_a_curved_cut_is_not_planar():
    body = BOX.val().cut(cq.Solid.makeCylinder(9, 60, (18, -30, 0), (0, 1, 0)))
    shell = cq.Shell.makeShell([cq.Workplane(body).faces(f">{axis}").val() for axis in "ZY"])
    ends = border_ends(shell, "|X and >Z and >Y")
    assert sorted(end.is_planar for end in ends) == [False, True]


@pytest.mark.parametrize("shape", [BOX.val(), BOX.val().Shells()[0], cq.Shell.makeShell(BOX.faces("not <X").vals())])
def test_where_faces_lie_across_there_is_none(shape):
    assert border_ends(shape, "|Z and >X and >Y") == (None, None)
