"""Read-only context of one insertion: a blend surface and the solid that it is put into."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.support_face import SupportFace, build_rail_pcurve
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.shell_editing.realigned_spheres import RealignedSphere, realign_sphere
from cqblend.brep.topology import AncestorMap, ShapeIndex, make_bare_face
from cqblend.splines import Curve


@dataclass(frozen=True)
class BlendPlacement:
    """One blend and the place in one solid where it goes. Made by :func:`place_blend`."""

    solid: TopoDS_Shape
    spine: EdgeSpine  # the blended edges
    support_faces: tuple[TopoDS_Face, TopoDS_Face]  # the support faces, as in the solid
    sides: tuple[SupportFace, SupportFace]  # the support faces in whose parameters the rails are given
    realigned: tuple[RealignedSphere | None, RealignedSphere | None]  # which of these are spheres with a new axis
    blend: BlendSurface
    blend_face: TopoDS_Face  # on the blend surface, without a boundary
    occ_surface: Geom_BSplineSurface  # the blend surface
    rail_curves: tuple[Curve, Curve]  # boundary rows v = 0 and v = 1 of the blend surface
    occ_rail_curves: tuple[Geom_BSplineCurve, Geom_BSplineCurve]  # the same
    rail_pcurves: tuple[Curve, Curve]  # t -> parameters on the support faces
    name_part: Callable[[TopoDS_Shape], str]  # what messages call a part of the solid, such as "edge 3"
    edge_index: ShapeIndex  # of the solid
    face_index: ShapeIndex  # of the solid

    @cached_property
    def vertex_index(self) -> ShapeIndex:
        """The vertices of the solid, numbered."""
        return ShapeIndex(self.solid, TopAbs_VERTEX)

    @cached_property
    def faces_at_edge(self) -> AncestorMap:
        """The faces at each edge of the solid."""
        return AncestorMap(self.solid, TopAbs_EDGE, TopAbs_FACE)

    @property
    def domain(self) -> tuple[float, float]:
        """The rails' parameter range."""
        breaks = self.blend.surface.breaks[0]
        return float(breaks[0]), float(breaks[-1])


def place_blend(
    solid: TopoDS_Shape,
    spine: EdgeSpine,
    sides: tuple[SupportFace, SupportFace],
    blend: BlendSurface,
    name_part: Callable[[TopoDS_Shape], str],
) -> BlendPlacement:
    """Prepare to put a blend between two support faces of a solid, along a chain of edges.

    Support faces on spheres that end at a closed blended edge alone get the rail's axis (:mod:`.realigned_spheres`).
    """
    edge_index, face_index = ShapeIndex(solid, TopAbs_EDGE), ShapeIndex(solid, TopAbs_FACE)
    surface = spline_arrays.surface_from_arrays(*blend.surface.to_bspline())
    first, second = (blend.surface.isoparametric(v=v) for v in (0.0, 1.0))
    realigned: tuple[RealignedSphere | None, RealignedSphere | None] = (None, None)
    if spine.closed:
        realigned = (
            realign_sphere(sides[0], blend.ribbons[0], spine.edges),
            realign_sphere(sides[1], blend.ribbons[1], spine.edges),
        )
    one, other = (side if sphere is None else sphere.side for side, sphere in zip(sides, realigned, strict=True))
    return BlendPlacement(
        solid=solid,
        spine=spine,
        support_faces=(sides[0].face, sides[1].face),
        sides=(one, other),
        realigned=realigned,
        blend=blend,
        blend_face=make_bare_face(surface),
        occ_surface=surface,
        rail_curves=(first, second),
        occ_rail_curves=(
            spline_arrays.curve_from_arrays(*first.to_bspline()),
            spline_arrays.curve_from_arrays(*second.to_bspline()),
        ),
        rail_pcurves=(build_rail_pcurve(one, blend.ribbons[0]), build_rail_pcurve(other, blend.ribbons[1])),
        name_part=name_part,
        edge_index=edge_index,
        face_index=face_index,
    )
