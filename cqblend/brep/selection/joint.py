"""Joints: edges between two faces of a solid or a shell, read as a spine and two support faces.

A joint is what one blend face takes the place of: which body, which edges, which faces on which side, and the queries
about them that need the topology.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_IN, TopAbs_ON, TopAbs_OUT
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    compute_inward_directions,
    project_to_intersection,
)
from cqblend.brep.bodies import is_solid
from cqblend.brep.conversion.support_face import SupportFace, read_support_face
from cqblend.brep.measurement.nearest_side import measure_height
from cqblend.brep.selection.border_ends import BorderEnd, find_border_end
from cqblend.brep.selection.edge_ends import find_continuing_edge, find_edge_in_plane, find_neighbour_faces
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shape_kinds import find_shape_kind
from cqblend.brep.topology import (
    CONFUSION,
    find_vertex_uv,
    locate_vertex,
)
from cqblend.errors import GeometryError, TopologyError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths


@dataclass(frozen=True, eq=False)
class Joint:
    """An edge, or a chain of edges, between two faces of one solid or shell, ready to be blended.

    ``edge_number`` and ``face_numbers`` are numbers in the maps of the *input* shape, for messages and certificates;
    ``lookup_number`` returns those of other faces, edges and vertices, 0 if they are not in the input. ``is_backward``
    tells that the picked edge has the sense opposite to the spine's. The rails run on ``sides``: the faces at the edge,
    or, past smooth edges, faces beyond; then ``faces_at_edge`` are those at the edge.
    """

    index: SolidIndex
    spine: EdgeSpine
    sides: tuple[SupportFace, SupportFace]
    edge_number: int
    face_numbers: tuple[int, int]
    lookup_number: Callable[[TopoDS_Shape], int] | None = None
    is_backward: bool = False
    faces_at_edge: tuple[SupportFace, SupportFace] | None = None

    @property
    def edge_sides(self) -> tuple[SupportFace, SupportFace]:
        """The faces at the edge."""
        return self.sides if self.faces_at_edge is None else self.faces_at_edge

    @property
    def solid(self) -> TopoDS_Shape:
        """The solid, or the shell that bounds none, that the edge is part of."""
        return self.index.solid

    @property
    def name(self) -> str:
        """What messages call the edge: by its number in the input."""
        return f"edge {self.edge_number}"

    @property
    def rank(self) -> int:
        """The lowest number of its edges in the solid, which does not depend on what was picked."""
        return min(map(self.index.edges.find_number, self.spine.edges))

    @property
    def primaries(self) -> tuple[Primary, Primary]:
        """The two primary surfaces."""
        return self.sides[0].primary, self.sides[1].primary

    @cached_property
    def tolerance(self) -> float:
        """The largest tolerance of the edges (mm)."""
        return float(max(BRep_Tool.Tolerance_s(edge) for edge in self.spine.edges))

    @cached_property
    def is_convex(self) -> bool:
        """Whether blending removes material; in a shell, whether the blend lies on the inner side of its faces."""
        return bool(compute_inward_directions(self.edge_sides, self.locate_stations(np.array([0.5])))[2][0] > 0)

    @property
    def is_closed(self) -> bool:
        """Whether its edges close."""
        return self.spine.closed

    @property
    def extent(self) -> float:
        """The diagonal of the solid's bounding box (mm)."""
        return self.index.extent

    def locate_stations(self, t: Array) -> Stations:
        """Return the spine's stations at t; an arc of a circle is extended along it, any other along its tangents.

        Their native parameters are those on the faces at the edge.
        """
        return self.spine.extend_along_circle(self.spine.locate_stations(t, self.edge_sides), self.edge_sides)

    def locate_on_surfaces(self, t: Array) -> Stations:
        """Return the stations at t on the intersection of the surfaces of both faces at the edge."""
        return project_to_intersection(self.edge_sides, self.locate_stations(t), self.spine.length)

    @cached_property
    def fading_ends(self) -> tuple[bool, bool]:
        """Whether the two faces become tangent to each other at t = 0 and at t = 1."""
        if self.spine.closed:
            return False, False
        uses = self.spine.edges[0], self.spine.edges[-1]
        angles = [self.index.measure_dihedral_angles(use) for use in uses]
        first, last = (
            one is None or abs(one.find_end_angle(use, end)) < SELECT_TOLERANCES.smooth_angle
            for end, (use, one) in enumerate(zip(uses, angles, strict=True))
        )
        return first, last

    def find_fading_limit(self, end: int) -> float:
        """Return the t next to an end, at which the joint fades out, where its faces meet at a measurable angle.

        Raises
        ------
        GeometryError
            If they do not in the half of the joint at this end.
        """
        shares = np.geomspace(*SELECT_TOLERANCES.fading_range, SELECT_TOLERANCES.fading_samples)
        t = shares if end == 0 else 1 - shares
        stations = self.locate_stations(np.sort(t))
        n1, n2 = (side.primary.evaluate_normals(uv) for side, uv in zip(self.edge_sides, stations.uv, strict=True))
        sine = measure_lengths(cross_product(n1, n2))[:: 1 if end == 0 else -1]
        if sine[-1] < SELECT_TOLERANCES.fading_sine:
            raise GeometryError(
                f"the faces are nearly tangent to each other over half of the edge, at {sine[-1]:.2g} rad"
            )
        return float(t[np.argmax(sine >= SELECT_TOLERANCES.fading_sine)])

    def to_face_parameters(self, contacts: Contacts) -> list[Array]:
        """Return contacts in the own parameters (n, 2) of both faces, in their windows."""
        return [
            side.wrap_to_window(side.to_face_parameters(uv)) for side, uv in zip(self.sides, contacts.uv, strict=True)
        ]

    def classify_contacts(self, contacts: Contacts, side_index: int) -> Array:
        """Return which contacts (n,) of one side, 0 or 1, are inside its face."""
        side = self.sides[side_index]
        classifier = self.index.get_classifier(side.face, SELECT_TOLERANCES.contact_boundary)
        found = []
        for point in side.wrap_to_window(side.to_face_parameters(contacts.uv[side_index])):
            state = classifier.Perform(gp_Pnt2d(*point.tolist()))
            found.append(state == TopAbs_IN or (state == TopAbs_ON and side.is_at_seam(point)))
        return np.array(found)

    def name_part(self, part: TopoDS_Shape) -> str:
        """Return the name of a face, edge or vertex in messages: kind and number in the input, or "a new" kind."""
        number = 0 if self.lookup_number is None else self.lookup_number(part)
        return f"{find_shape_kind(part)} {number}" if number else f"a new {find_shape_kind(part)}"

    def find_face_number(self, face: TopoDS_Face) -> int:
        """Return the number of a face in the input, 0 if it is not in it."""
        return 0 if self.lookup_number is None else self.lookup_number(face)

    def choose_rail_start(self, contacts: Contacts) -> float:
        """Return the t, of contacts around a closed joint, that is farthest from seams and knot lines of both faces."""
        clearance = np.full(len(contacts.t), np.inf)
        for side, uv in zip(self.sides, self.to_face_parameters(contacts), strict=True):
            for axis, width in enumerate(np.ptp(side.bounds, axis=1)):
                lines = np.append(side.bounds[axis], side.face_primary.inner_knot_lines(axis))
                clearance = np.minimum(clearance, np.abs(uv[:, axis, None] - lines).min(axis=1) / width)
        return float(contacts.t[np.argmax(clearance)])

    def find_vertex_number(self, end: int) -> int:
        """Return the number in the input of the vertex at t = ``end``, 0 or 1; 0 if it is new."""
        return 0 if self.lookup_number is None else self.lookup_number(self.spine.vertices[end])

    def name_end(self, end: int) -> str:
        """Return the name in messages of the vertex at t = ``end``, 0 or 1, with the other faces that meet there."""
        vertex = self.spine.vertices[end]
        x, y, z = locate_vertex(vertex).tolist()
        others = [self.name_part(face) for face in find_neighbour_faces(self.index, vertex, self.edge_sides)]
        beside = f", beside {', '.join(others)}" if others else ""
        return f"{self.name_part(vertex)} at ({x:.4g}, {y:.4g}, {z:.4g}){beside}"

    @cached_property
    def border_ends(self) -> tuple[BorderEnd | None, BorderEnd | None]:
        """What lies at both ends of the edge where these are in the border of an open shell; None at other ends."""
        if is_solid(self.solid):
            return None, None
        first, last = (find_border_end(self.index, self.spine, end, self.edge_sides) for end in (0, 1))
        return first, last

    def find_continuing_edge(self, end: int) -> TopoDS_Edge | None:
        """Return the edge that continues this one tangentially past t = ``end``, 0 or 1; None if there is none."""
        return find_continuing_edge(self.index, self.spine.vertices[end], self.spine.edges[-end])

    def list_end_planes(self, end: int) -> list[tuple[Array, Array]]:
        """Return point and normal of every face, or of the border, across the edge at t = ``end``, 0 or 1."""
        border = self.border_ends[end]
        if border is not None:
            return [(border.point, border.normal)]
        vertex, planes = self.spine.vertices[end], []
        point = locate_vertex(vertex)
        for face in find_neighbour_faces(self.index, vertex, self.edge_sides):
            side = read_support_face(face, point[None])
            planes.append((point, side.face_primary.evaluate_normals(find_vertex_uv(vertex, side.face)[None])[0]))
        return planes

    def read_end_face(self, end: int) -> SupportFace | None:
        """Return the one face across the edge at t = ``end``, 0 or 1; None if there is not exactly one."""
        vertex = self.spine.vertices[end]
        across = find_neighbour_faces(self.index, vertex, self.edge_sides)
        return read_support_face(across[0], locate_vertex(vertex)[None]) if len(across) == 1 else None

    def check_end_cap(self, contacts: Contacts, stations: Stations, end: int) -> None:
        """Check that a blend can end in a flat cap at the one t of contacts and stations, towards ``end`` (0 or 1).

        Each border of the cap, from the edge to a contact, must be inside its face or, at the end of the edge, along a
        border of the face. Behind the cap there must be material if the edge is convex, none if it is concave.

        Raises
        ------
        TopologyError
            If the cap is not possible.
        """
        if self.faces_at_edge is not None:
            raise TopologyError("a rail has gone on over a smooth edge, across which flat caps are not built")
        if self.border_ends[end] is not None:
            raise TopologyError("the edge ends in the border of an open shell, which a flat cap would close in part")
        vertex, direction = self.spine.vertices[end], stations.tangents[0]
        at_end = contacts.t[0] == end
        legs = np.zeros(3)
        for side, number, uv, foot in zip(self.sides, self.face_numbers, contacts.uv, stations.uv, strict=True):
            corner = side.primary.jet(uv)[0, 0]
            legs += corner - stations.points[0]
            if at_end and find_edge_in_plane(side.face, vertex, self.spine.edges, direction, corner) is not None:
                continue
            classifier = self.index.get_classifier(side.face, SELECT_TOLERANCES.face_boundary)
            on_edge = self.spine.evaluate_pcurves(contacts.t, side.face)
            start, stop = (
                side.unwrap_near(side.to_face_parameters(foot), on_edge),
                side.unwrap_near(side.to_face_parameters(uv), on_edge),
            )
            for share in (0.05, 0.25, 0.5, 0.75, 1.0):
                for point in (start + share * (stop - start)).tolist():
                    if classifier.Perform(gp_Pnt2d(*point)) != TopAbs_IN:
                        raise TopologyError(f"a wall across the edge leaves face {number}")
        behind = (
            stations.points[0]
            + SELECT_TOLERANCES.cap_probe_share * legs
            + SELECT_TOLERANCES.cap_probe_step * np.linalg.norm(legs) * direction * (1 if end else -1)
        )
        if not self._lies_inside(behind, wanted=self.is_convex):
            raise TopologyError(
                f"behind a cap there, the solid {'has no material' if self.is_convex else 'is in the way'}"
            )

    def _lies_inside(self, point: Array, *, wanted: bool) -> bool:
        """Whether a point (3,) lies strictly inside the solid, or, if that is not ``wanted``, strictly outside.

        In a shell that bounds no solid, the nearest face tells.
        """
        if not is_solid(self.solid):
            height = measure_height(point, self.index.faces)
            return height < -CONFUSION if wanted else height > CONFUSION
        classifier = BRepClass3d_SolidClassifier(self.solid, gp_Pnt(*point.tolist()), CONFUSION)
        return bool(classifier.State() == (TopAbs_IN if wanted else TopAbs_OUT))


def make_joint(
    index: SolidIndex,
    spine: EdgeSpine,
    faces: tuple[TopoDS_Face, TopoDS_Face],
    edge_number: int,
    face_numbers: tuple[int, int],
    lookup_number: Callable[[TopoDS_Shape], int],
) -> Joint:
    """Read the faces at a spine, of which the first is to its left, and return the joint between them.

    ``edge_number``, ``face_numbers`` and ``lookup_number`` are those of :class:`Joint`.
    """
    points = spine.evaluate_points(np.linspace(0, 1, SELECT_TOLERANCES.spine_samples)[: -1 if spine.closed else None])
    edge_is_circular = spine.closed or spine.measure_arc_angle() is not None
    first, second = (read_support_face(face, points, edge_is_circular=edge_is_circular) for face in faces)
    return Joint(index, spine, (first, second), edge_number, face_numbers, lookup_number)
