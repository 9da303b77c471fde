"""Tolerances and limits of trimmed faces and their borders."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrimTolerances:
    """Tolerances and limits of patches, of the vertices along edges, and of loops mapped to the plane.

    Attributes
    ----------
    coplanar_angle
        Rad: largest angle between the normals of faces that lie in one plane.
    coplanar_distance
        Mm: largest distance of the vertices and knots of one face's edges from the other's plane.
    plane_window_margin
        Relative to the outer loop's polygon, whose edges may bulge: by how much a plane's parameter window is larger on
        every side.
    tangent_step
        Relative to the first or last piece of an edge: step by which its direction at the vertex is measured.
    closed_side_gap
        Relative to the size of a bare surface: opposite sides that are closer together are one edge, and a side that is
        smaller is a point.
    line_snap
        Relative to the extent of a parameter, or of an edge's range: points closer to a cut line are on it, crossings
        closer together are one.
    crossing_distance
        Relative to the extent of a parameter, or to its value: distance of a crossing from its line that is rounding.
    line_crossing_merge
        Relative to the flat tolerance: crossings of an edge with lines that are closer together, mm, are one.
    shortest_segment
        Relative to the range of an edge: shorter segments between vertices are not halved any more.
    max_edge_vertices
        Vertices along one edge at most.
    max_sagitta_ratio
        Largest sagitta of an arc between neighbouring vertices, relative to its chord: that of an arc of 60 degrees.
    smallest_cell
        Relative to the bounding rectangle of a trimmed domain: cells of less area are rounding.
    oblique_extent
        Relative to the extent of the parameters: a stretch of an edge along which both change by more follows neither
        rails nor rulings.
    straight_excess
        Relative: an arc that is longer than its chord by no more is straight, because the rest is rounding.
    inward_offset
        Relative to a chord: how far to the inner side the middle of a curve has to be before its arc bows inwards.
    joint_gap
        Mm: largest gap between an exact curve and the vertices of its run; a tenth of the tolerance of OCCT's vertices.
    stationary_rail_step
        Relative to the length of a rail: it does not move where it moves by less.
    edge_vertex_merge
        Relative to the parameter range of a run along a rail: nodes closer to its ends are left out.
    """

    coplanar_angle: float = 1e-9
    coplanar_distance: float = 1e-7
    plane_window_margin: float = 0.1
    tangent_step: float = 1e-4
    closed_side_gap: float = 1e-9
    line_snap: float = 1e-9
    crossing_distance: float = 1e-15
    line_crossing_merge: float = 1e-3
    shortest_segment: float = 1e-9
    max_edge_vertices: int = 20_000
    max_sagitta_ratio: float = 0.13
    smallest_cell: float = 1e-13
    oblique_extent: float = 1e-6
    straight_excess: float = 1e-13
    inward_offset: float = 1e-9
    joint_gap: float = 1e-8
    stationary_rail_step: float = 1e-13
    edge_vertex_merge: float = 1e-9


TRIM_TOLERANCES = TrimTolerances()
