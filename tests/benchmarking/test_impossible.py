"""Witnesses that no rolling-ball blend exists, on bodies where the largest radius is known in closed form."""

import math

import cadquery as cq
import pytest
from OCP.TopAbs import TopAbs_EDGE
from places import ROOT

from benchmarks.impossible import find_witness


def rod():
    """A rod of radius 5: its rim takes balls up to that."""
    return cq.Workplane().circle(5).extrude(20), ">Z"


def witness(part, selector, radius, **options):
    edge = part.edges(selector).val()
    return find_witness(part.val().wrapped, edge.wrapped, radius, **options)


def nearest(x, y, z):
    return cq.selectors.NearestToPointSelector((x, y, z))


def plate():
    """At a right angle the contact is one radius below the edge, on a side that is 2 high."""
    return cq.Workplane().box(30, 20, 2), ">Z and >Y", 2.0, "narrow face"


def rim_of_rod():
    return *rod(), 5.0, "curvature"


def floor_of_bore():
    """A ball in the corner between floor and wall of a blind bore is no larger than the bore."""
    bore = cq.Workplane().box(30, 30, 16).faces(">Z").workplane().circle(5).cutBlind(-12)
    return bore, nearest(0, 0, -4), 5.0, "curvature"


def rim_of_bore():
    """Outside of a bore there is room: what is in the way is its floor, 6 below."""
    bore = cq.Workplane().box(30, 30, 16).faces(">Z").workplane().circle(5).cutBlind(-6)
    return bore, nearest(0, 0, 8), 6.0, "narrow face"


def foot_on_narrow_ledge():
    """The contact on the ledge is one radius from the wall, the ledge 4 wide."""
    stairs = cq.Workplane().box(30, 20, 10).union(cq.Workplane().box(30, 16, 10).translate((0, 2, 10)))
    return stairs, nearest(0, -6, 5), 4.0, "narrow face"


def corner_of_thin_walls():
    """Of a corner between walls 1 thick, the arc leaves the material once R (sqrt 2 - 1) is above sqrt 2."""
    box = cq.Workplane().box(30, 30, 30).faces("<Z").shell(-1)
    return box, ">Z and >Y", math.sqrt(2) / (math.sqrt(2) - 1), "thin material"


def rounded_rim():
    """The top of a box goes on round its uprights, of radius 3, and so does the blend."""
    return cq.Workplane().box(30, 20, 10).edges("|Z").fillet(3), ">Z and >Y", 3.0, None


def channel_with_a_beam():
    """A beam runs 1 above the floor of a channel and 1 beside its wall: larger balls' arcs would end inside it."""
    outline = [(0, 0), (30, 0), (30, 10), (25, 10), (25, 5), (5, 5), (5, 10), (0, 10)]
    channel = cq.Workplane("XZ").polyline(outline).close().extrude(20)
    end, beam = cq.Workplane().box(30, 2, 10, centered=False), cq.Workplane().box(3, 20, 3, centered=False)
    body = channel.union(end).union(beam.translate((6, -20, 6)))
    return body, nearest(5, -10, 5), math.sqrt(2) / (math.sqrt(2) - 1), "narrow space"


BODIES = (
    plate,
    rim_of_rod,
    floor_of_bore,
    rim_of_bore,
    foot_on_narrow_ledge,
    corner_of_thin_walls,
    rounded_rim,
    channel_with_a_beam,
)


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.__name__)
def test_there_is_a_witness_just_above_the_largest_radius_and_none_just_below(body):
    part, selector, largest, kind = body()
    assert witness(part, selector, 0.99 * largest) is None
    found = witness(part, selector, 1.01 * largest)
    assert found is not None
    assert kind in (None, found.kind), str(found)


def test_no_edge_of_a_chain_but_the_one_that_is_impossible_alone():
    part, selector, radius, _ = rounded_rim()
    assert witness(part, selector, 1.5 * radius, chain=False) is None
    found = witness(part, selector, 1.5 * radius)
    number = [edge.geomType() for edge in part.val().Edges()][found.edge - 1]
    assert number == "CIRCLE", str(found)


def test_the_numbers_of_a_witness_are_those_of_the_body():
    part, selector, _, _ = plate()
    assert "the contact is 0.5 mm outside face" in str(witness(part, selector, 2.5))
    part, selector, _, _ = rim_of_rod()
    assert "by radius 5 < 6" in str(witness(part, selector, 6.0))


def test_rails_may_go_on_over_smooth_edges():
    """A side in two halves, one tangent plane: what is beyond the smooth edge serves as well."""
    arc = cq.Workplane("XZ").moveTo(0, 0).lineTo(20, 0).lineTo(20, 3).tangentArcPoint((14, 9), relative=False)
    part = arc.lineTo(0, 9).close().extrude(30)
    edge = nearest(20, -15, 0)
    assert witness(part, edge, 2.9) is None
    assert witness(part, edge, 4.0) is None


@pytest.mark.parametrize("angle", [0.5, 179.8])
def test_no_ball_fits_a_knife_or_a_smooth_edge(angle):
    tip = math.radians(angle)
    wedge = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (20 * math.cos(tip), 20 * math.sin(tip))]).close().extrude(10)
    found = witness(wedge, nearest(0, -5, 0), 0.5)
    assert found is not None
    assert found.kind == "no solid angle"


def test_ends_are_no_witness():
    """Near an end that is cut off obliquely a contact lies outside the face, and that is how blends end."""
    part = cq.Workplane().polyline([(0, 0), (30, 0), (24, 10), (6, 10)]).close().extrude(8)
    assert witness(part, nearest(15, 10, 8), 3.0) is None


def test_nothing_of_the_library_is_used():
    """What judges the library must share nothing with it."""
    for name in ("impossible", "touching_balls", "tangent_chains", "real_edges", "tables"):
        text = (ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")
        assert "import cqblend" not in text
        assert "from cqblend" not in text


def test_edges_between_fewer_than_two_faces_have_none():
    cylinder = cq.Workplane().circle(5).extrude(20)
    (seam,) = (edge for edge in cylinder.val().Edges() if edge.geomType() == "LINE")
    assert seam.wrapped.ShapeType() == TopAbs_EDGE
    assert find_witness(cylinder.val().wrapped, seam.wrapped, 1.0) is None
