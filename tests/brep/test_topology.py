"""Maps of shapes, and chains of segments, edge by edge."""

import cadquery as cq
import pytest
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX

from cqblend.brep.topology import AncestorMap, ShapeIndex, chain_segments, drop_duplicate_shapes, is_among

BOX = cq.Workplane().box(1, 2, 3).val().wrapped


class TestShapeIndex:
    def test_numbers_start_at_one_and_orientation_is_ignored(self):
        index = ShapeIndex(BOX, TopAbs_FACE)
        assert len(index) == 6
        assert [index.find_number(face.Reversed()) for face in index] == [1, 2, 3, 4, 5, 6]

    def test_foreign_shapes(self):
        other = next(iter(ShapeIndex(cq.Workplane().box(1, 1, 1).val().wrapped, TopAbs_FACE)))
        index = ShapeIndex(BOX, TopAbs_FACE)
        assert other not in index
        assert index.find_number(other) == 0
        assert index[1] in index

    def test_several_shapes_are_numbered_together(self):
        faces = list(ShapeIndex(BOX, TopAbs_FACE))
        assert len(ShapeIndex.from_shapes(faces[:2], TopAbs_VERTEX)) == 8
        assert len(ShapeIndex.from_shapes([*faces, *faces], TopAbs_FACE)) == 6


def test_ancestors_come_once_each():
    faces_at = AncestorMap(BOX, TopAbs_EDGE, TopAbs_FACE)
    edges = ShapeIndex(BOX, TopAbs_EDGE)
    assert all(edge in faces_at and len(faces_at(edge)) == 2 for edge in edges)
    seam = next(edge for edge in cq.Workplane().cylinder(1, 1).edges().vals() if edge.geomType() == "LINE").wrapped
    assert seam not in faces_at
    assert faces_at(seam) == []


def test_duplicates_go_and_the_first_stays():
    faces = list(ShapeIndex(BOX, TopAbs_FACE))
    found = drop_duplicate_shapes([faces[2], faces[0], faces[2].Reversed()])
    assert [face.IsEqual(other) for face, other in zip(found, [faces[2], faces[0]], strict=True)] == [True, True]
    assert is_among(faces[2].Reversed(), found)
    assert not is_among(faces[1], found)


class TestChainSegments:
    def test_head_to_tail(self):
        assert chain_segments([1, 3, 5, 2], [2, 1, 6, 3]) == [[0, 3, 1], [2]]
        assert chain_segments([], []) == []

    def test_both_ways_the_first_that_fits_is_taken(self):
        assert chain_segments([2, 1, 3], [3, 2, 4], both_ways=True) == [[1, 0, 2]]
        assert chain_segments([2, 1, 3], [3, 2, 4]) == [[0, 2], [1]]

    @pytest.mark.parametrize(("until_closed", "expected"), [(True, [[0, 1], [2, 3]]), (False, [[0, 1, 2, 3]])])
    def test_a_figure_of_eight(self, until_closed, expected):
        starts, stops = [1, 2, 1, 3], [2, 1, 3, 1]
        assert chain_segments(starts, stops, lambda i, k: 0.0, until_closed=until_closed) == expected

    def test_of_several_the_nearest_follows(self):
        starts, stops = [1, 2, 2], [2, 1, 1]
        assert chain_segments(starts, stops, lambda i, k: abs(k - 2.0))[0][:2] == [0, 2]
