"""The boundary of a face: where paths in its parameter plane cross it, and what lies between two marks on it."""

import cadquery as cq
import numpy as np
import pytest
from OCP.TopExp import TopExp

from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary

NO_PERIODS = (None, None)


def top_of_box() -> FaceBoundary:
    return FaceBoundary(cq.Workplane().box(30, 20, 10).faces(">Z").val().wrapped)


def locate(boundary: FaceBoundary, use: int, parameter: float) -> np.ndarray:
    """Return the point of an edge, from OCCT."""
    return np.array(cq.Edge(boundary.uses[use])._geomAdaptor().Value(parameter).Coord())


def test_uses_follow_each_other_around_the_face():
    boundary = top_of_box()
    at, seen = 0, []
    for _ in boundary.uses:
        seen.append(at)
        following = boundary.find_following(at)
        assert TopExp.LastVertex_s(boundary.uses[at], True).IsSame(TopExp.FirstVertex_s(boundary.uses[following], True))
        assert boundary.find_preceding(BoundaryMark(following, 0.0)) == at
        at = following
    assert at == 0
    assert sorted(seen) == list(range(4))


def test_a_path_crosses_the_edge_that_it_meets_first():
    boundary = top_of_box()
    start = boundary.evaluate_points(0, np.array([0.0]))[0]
    corners = np.array([boundary.evaluate(k, boundary.find_span(k)[0])[0] for k in range(4)])
    middle = corners.mean(axis=0)
    assert (np.abs(start - corners) < 1e-12).all(axis=1).any()
    path = np.array([middle, middle + 0.25 * (corners[1] - corners[0]), middle + (corners[1] - corners[0])])
    found = boundary.find_first_crossing(path, NO_PERIODS)
    assert found is not None
    assert found.use == 1
    assert found.share == pytest.approx(1 + 1 / 3)
    x, y, z = locate(boundary, found.use, found.parameter)
    assert (abs(x) == pytest.approx(15)) != (abs(y) == pytest.approx(10))
    assert z == pytest.approx(5)
    assert boundary.find_first_crossing(path, NO_PERIODS, skipped=(1,)) is None
    assert boundary.find_first_crossing(path[:2], NO_PERIODS) is None


@pytest.mark.parametrize("turns", [-2, 0, 1])
def test_a_path_may_be_whole_periods_away(turns):
    """Around a cylinder with its top cut off slantwise."""
    body = cq.Workplane().circle(5).extrude(20).faces(">Z").workplane(offset=-6).transformed(rotate=(20, 0, 0))
    face = body.split(keepBottom=True).faces("%CYLINDER").val()
    boundary = FaceBoundary(face.wrapped)
    period = 2 * np.pi
    path = np.array([[2.0 + turns * period, -1.0], [2.0 + turns * period, -30.0]])
    found = boundary.find_first_crossing(path, (period, None))
    assert found is not None
    x, y, _ = locate(boundary, found.use, found.parameter)
    assert np.arctan2(y, x) == pytest.approx(2.0, abs=0.02)  # as near as chords of an ellipse are


def test_what_lies_between_two_marks():
    boundary = top_of_box()
    on = [BoundaryMark(k, sum(boundary.find_span(k)) / 2) for k in range(4)]
    assert boundary.list_between(on[0], [on[1]]) == []
    assert boundary.list_between(on[0], [on[2]]) == [1]
    assert boundary.list_between(on[2], [on[0]]) == [3]
    assert boundary.list_between(on[0], [on[3], on[2]]) == [1]
    assert boundary.list_between(on[0], []) is None
    corner = boundary.mark_vertex(1, stops=True)
    assert corner.vertex is not None
    assert boundary.list_between(on[0], [corner]) == [1]
    assert boundary.list_between(corner, [on[0]]) == [2, 3]
    assert boundary.list_until(on[0], [3], backward=False) == [1, 2]
    assert boundary.list_until(on[0], [2], backward=True) == [3]
    assert boundary.list_until(on[0], [9], backward=False) is None


def test_two_marks_on_one_edge():
    """What is between goes if the second comes first, and the edge would fall in two if it does not."""
    boundary = top_of_box()
    first, last = boundary.find_span(0)
    early, late = (BoundaryMark(0, first + share * (last - first)) for share in (0.25, 0.75))
    assert boundary.list_between(late, [early]) == [1, 2, 3]
    assert boundary.list_between(early, [late]) is None
