"""The way around the end of a blend: over which faces, in which order, and exactly on both surfaces."""

import math
from itertools import pairwise

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt
from OCP.ShapeAnalysis import ShapeAnalysis_Surface

from cqblend.blend_options import BlendOptions
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.shell_editing.end_crossings import BlendEnd
from cqblend.brep.shell_editing.end_path import EndPath, find_end_path
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import StripPlacement, place_strip
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.strip_context import StripContext


def place(body: cq.Shape, at: tuple[float, float, float], radius: float, reach: float = 0.3) -> StripPlacement:
    """Return a blend of the edge whose middle is nearest to a point, longer than the edge by a share at both ends."""
    edge = min(body.Edges(), key=lambda one: (one.Center() - cq.Vector(*at)).Length)
    selection = select_chains(body.wrapped, [edge.wrapped], None, None, follow=False)
    chain = selection.networks[0][0].chain
    assert chain is not None
    context = StripContext(chain.cells[0], choose_section_method(BlendOptions(radius, section="hermite").to_request()))
    return place_strip(context.joint, context.make_blend((-reach, 1 + reach)))


def find_path(placement: StripPlacement, *at: float) -> EndPath:
    """Return the way around the end that is nearest to a point."""
    ends = [np.array(BRep_Tool.Pnt_s(vertex).Coord()) for vertex in placement.joint.spine.vertices]
    end = min((0, 1), key=lambda k: np.linalg.norm(ends[k] - at))
    return find_end_path(BlendEnd(placement, end))


def describe(placement: StripPlacement, path: EndPath) -> list[tuple[float, float, float]]:
    """Return the outward normals of the faces of a way, in its order from rail 1 to rail 2, turned to start above."""
    normals = []
    for piece in path.pieces:
        face = cq.Face(placement.index.faces[placement.number_face(piece.side.face)])
        normals.append(tuple(round(x, 6) + 0.0 for x in face.normalAt().toTuple()))
    first = path.crossings[0].point
    return normals if first[2] > path.crossings[-1].point[2] else normals[::-1]


def check_curves(placement: StripPlacement, path: EndPath) -> None:
    """Check that the pieces start where others stop, and lie on both surfaces, measured by OCCT."""
    stops = [piece.cut.ends for piece in path.pieces]
    for before, after in pairwise(stops):
        assert np.abs(before[1] - after[0]).max() < 1e-9
    for piece in path.pieces:
        t = np.linspace(*piece.cut.span, 23)
        points = piece.cut.curve(t)
        surface = ShapeAnalysis_Surface(BRep_Tool.Surface_s(piece.side.face))
        for point in points.tolist():
            surface.ValueOfUV(gp_Pnt(*point), 1e-9)
            assert surface.Gap() < 1e-8
        assert np.abs(placement.strip(*piece.cut.on_strip(t).T) - points).max() < 1e-8


def test_around_a_step():
    """Down the wall, out over the tread, and down at the end."""
    body = cq.Workplane().box(30, 20, 10).cut(cq.Workplane().box(4, 20, 2).translate((13, 0, 4))).val()
    placement = place(body, (0, 10, 5), 4)
    path = find_path(placement, 15, 10, 5)
    assert describe(placement, path) == [(1, 0, 0), (0, 0, 1), (1, 0, 0)]
    check_curves(placement, path)
    tread = path.pieces[1].cut
    assert np.ptp(tread.on_strip(np.linspace(*tread.span, 9))[:, 1]) < 1e-12  # the tread runs along the edge


def test_around_a_rib():
    """Along the face of the rib that the blend meets first, over its top, down its other face, and out below."""
    rib = cq.Workplane().box(2, 8, 14, centered=(True, True, False)).translate((11, 12, 0))
    body = cq.Workplane().rect(32, 22).extrude(20, taper=7).union(rib).val()
    tilt = 10 * math.tan(math.radians(7))
    placement = place(body, (16 - tilt, 11 - tilt, 10), 5)
    path = find_path(placement, 16, 11, 0)
    assert describe(placement, path) == [(-1, 0, 0), (0, 0, 1), (1, 0, 0), (0, 0, -1)]
    check_curves(placement, path)


def test_through_a_vertex():
    """The rail meets the corner of a chamfer."""
    body = cq.Workplane().box(30, 20, 10).edges(">X and >Y and |Z").chamfer(2).val()
    placement = place(body, (0, 10, 5), 2)
    path = find_path(placement, 15, 10, 5)
    (normal,) = describe(placement, path)
    assert normal[:2] == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)), abs=1e-6)
    assert sum(crossing.vertex is not None for crossing in path.crossings) == 1
    check_curves(placement, path)


def test_a_rail_that_does_not_leave_its_face_must_be_longer():
    """The wall of a rounded box turns away from the blend at its foot."""
    body = cq.Workplane().box(60, 60, 6).union(cq.Workplane().box(30, 20, 20).edges("|Z").fillet(4)).val().Solids()[0]
    placement = place(body, (0, -10, 3), 2)
    with pytest.raises(RailsTooShortError) as raised:
        find_path(placement, 11, -10, 3)
    low, high = raised.value.needed_domain
    assert low < -0.31 or high > 1.31
