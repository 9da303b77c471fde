"""Read-only context of one strip: a blend surface and the joint of a solid that it is put at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from OCP.TopoDS import TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.blend_plan import PlannedSurface, PlannedVertex
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion.support_face import SupportFace, build_rail_pcurve
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.realigned_spheres import realign_sphere
from cqblend.brep.topology import locate_vertex
from cqblend.splines import Curve
from cqblend.surfaces.quadrics import Sphere

CapStations = tuple[float | None, float | None]
"""The t of the flat caps at both ends of an open blend, None for an end on the face across the edge."""


@dataclass(frozen=True)
class StripPlacement:
    """One blend surface and the joint of a solid where it goes. Made by :func:`place_strip`."""

    joint: Joint
    blend: BlendSurface
    sides: tuple[SupportFace, SupportFace]  # the support faces in whose parameters the rails are given
    spheres: tuple[PlannedSurface | None, PlannedSurface | None]  # which of these are spheres that get a new axis
    surface: PlannedSurface  # the blend surface
    rail_curves: tuple[Curve, Curve]  # boundary rows v = 0 and v = 1 of the blend surface
    rail_pcurves: tuple[Curve, Curve]  # t -> parameters on the support faces

    @property
    def index(self) -> SolidIndex:
        """Facts of the solid."""
        return self.joint.index

    @property
    def domain(self) -> tuple[float, float]:
        """The rails' parameter range."""
        breaks = self.blend.surface.breaks[0]
        return float(breaks[0]), float(breaks[-1])

    @cached_property
    def spine_numbers(self) -> tuple[int, ...]:
        """The numbers of the blended edges in the solid."""
        return tuple(map(self.index.edges.find_number, self.joint.spine.edges))

    @cached_property
    def face_numbers(self) -> tuple[int, int]:
        """The numbers of the support faces in the solid."""
        first, second = (self.index.faces.find_number(side.face) for side in self.joint.sides)
        return first, second

    def get_support(self, i: int) -> int | PlannedSurface:
        """Return what pcurves on support face ``i`` refer to: its number, or the sphere that it gets."""
        sphere = self.spheres[i]
        return self.face_numbers[i] if sphere is None else sphere

    def number_face(self, face: TopoDS_Face) -> int:
        """Return the number of a face in the solid."""
        return self.index.faces.find_number(face)

    def keep_vertex(self, vertex: TopoDS_Vertex) -> PlannedVertex:
        """Return a vertex of the solid as one that stays."""
        return PlannedVertex(locate_vertex(vertex), self.index.vertices.find_number(vertex))


def place_strip(joint: Joint, blend: BlendSurface) -> StripPlacement:
    """Prepare to put a blend at a joint.

    Support faces on spheres that end at a closed blended edge alone get the rail's axis (:mod:`.realigned_spheres`).
    """
    (side1, sphere1), (side2, sphere2) = (
        _realign_side(joint, side, ribbon) for side, ribbon in zip(joint.sides, blend.ribbons, strict=True)
    )
    first, second = (blend.surface.isoparametric(v=v) for v in (0.0, 1.0))
    one, other = (build_rail_pcurve(side, ribbon) for side, ribbon in zip((side1, side2), blend.ribbons, strict=True))
    return StripPlacement(
        joint=joint,
        blend=blend,
        sides=(side1, side2),
        spheres=(sphere1, sphere2),
        surface=PlannedSurface(blend.surface),
        rail_curves=(first, second),
        rail_pcurves=(one, other),
    )


def _realign_side(joint: Joint, side: SupportFace, ribbon: Ribbon) -> tuple[SupportFace, PlannedSurface | None]:
    """Return a support face with the rail's axis and the sphere that it gets; or as it is, and None."""
    realigned = realign_sphere(side, ribbon, joint.spine.edges) if joint.spine.closed else None
    if realigned is None or not isinstance(realigned.face_primary, Sphere):
        return side, None
    return realigned, PlannedSurface(realigned.face_primary)
