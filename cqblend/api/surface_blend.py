"""Public functions that blend two surfaces along given rails by Hermite sections.

A rail is a curve in the parameter plane of a surface. The surfaces need not touch nor belong to one body. The arguments
are checked here; rails, cross directions and sections are computed by :mod:`cqblend.blends`. OCCT is needed only for
faces and measurements.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from cqblend.api.cross_derivatives import Amount, CrossDerivativeOptions, CrossLength, Tangents, prepare_rails
from cqblend.argument_checks import check_angle, check_choice, check_pair, check_positive, refuse_ignored_options
from cqblend.blend_options import (
    BLEND_DEFAULTS,
    CONTINUITIES,
    EXACT_FORM_IS_EXACT,
    FORMS,
    G0_HAS_NO_CROSS_FIELD,
)
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.rails.rail import Rail
from cqblend.blends.sections import blend_surface
from cqblend.certificate import Certificate
from cqblend.splines import Curve, Surface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face


@dataclass(frozen=True)
class Blend(blend_surface.BlendSurface):
    """A blend surface H(t, v) between two rails, v = 0 on the first and 1 on the second.

    Attributes
    ----------
    surface : Surface
        H, over the domain of the first rail times [0, 1].
    ribbons : tuple of Ribbon
        Rail and cross derivatives on each side, in the surfaces' parameter planes.
    form : {"exact", "compact"}
    rails : tuple of Rail
        The rails, with the sides of them on which the blend lies.
    """

    rails: tuple[Rail, ...]

    @cached_property
    def certificate(self) -> Certificate:
        """How exactly the blend meets its surfaces, measured by OCCT, and proven from the splines' coefficients."""
        from cqblend.brep.verification.blend_certification import certify_surfaces

        return certify_surfaces(self, self.traces)

    @property
    def traces(self) -> list[tuple[Surface, Curve]]:
        """For each side the surface that the blend meets, and the rail as a curve in its parameter plane."""
        return [(rail.surface, rail.curve) for rail in self.rails]

    def face(self) -> TopoDS_Face:
        """Return the face that covers the blend, with the same parameters. Wrap it with ``cadquery.Face(...)``."""
        from cqblend.brep.conversion.spline_conversion import to_face

        return to_face(self.surface)


def hermite_blend(
    rail1: Rail,
    rail2: Rail,
    *,
    tangents: Tangents | tuple[Tangents, Tangents] = "perpendicular",
    continuity: str | tuple[str, str] = "G1",
    bulge: Amount | tuple[Amount, Amount] = 1.0,
    length: CrossLength | tuple[CrossLength, CrossLength] = None,
    form: str = "auto",
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    steer: float = BLEND_DEFAULTS.steer,
    crease: float | None = None,
) -> Blend:
    r"""Blend two surfaces along given rails.

    In homogeneous coordinates, with the ribbons' jets C, T, K, .. of both sides (T into the blend), the Hermite
    interpolant across; for G1 on both sides Kim and Elber's eq. (4),

    .. math:: H(t, v) = h_{00}(v) C_1(t) + h_{01}(v) C_2(t) + h_{10}(v) T_1(t) - h_{11}(v) T_2(t).

    Parameters
    ----------
    rail1, rail2
        The surfaces may be the same, touch or be apart. If the rails' domains differ, the second one's is changed to
        the first one's. A rail without a side has its blend towards the other rail.
    tangents
        Cross directions, for both sides or a pair: "perpendicular" (T2), "parametric" (T1), "chord" (T3),
        :class:`Guide` (T4) or :class:`Combination` (T5).
    continuity
        "G0", "G1", "G2" or "G3", for both sides or a pair.
    bulge
        Factor on the length of the cross derivative, for both sides or a pair: a number, a curve of dim 1 or a function
        of t.
    length
        Length of the cross derivative before `bulge`, mm: None for the distance of the rails, "field" for the length of
        the paper's unnormalised field, or as `bulge`.
    form
        "exact", "compact" or "auto", as in `cqblend.blend_edges`.
    tolerance, angular_tolerance
        Accuracy of the compact form, mm and rad.
    steer
        Largest angle by which directions are turned next to a knot line that the rail crosses, so that the blend has no
        crease inside, rad.
    crease
        Largest angle of a crease inside that steering leaves, rad. None for `angular_tolerance`, or the angle of the
        crease that the surface itself has there.

    Raises
    ------
    InputError
        An argument is of the wrong type, out of range or unknown.
    GeometryError
        A cross direction vanishes or runs along its rail, G3 is asked of a surface that is not G3 or G2 of one whose
        curvature jumps, or the blend has a crease inside; messages name the parameter t.
    DegreeError
        The exact form would need a degree above 25.

    Notes
    -----
    Rails, directions and lengths are the caller's, and may make a surface that folds over itself:
    ``blend.certificate.valid`` tells.

    Examples
    --------
    >>> import cqblend
    >>> corners = [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]]
    >>> plane = cqblend.Surface.from_bspline((1, 1), ([0, 0, 9, 9], [0, 0, 9, 9]), corners)
    >>> rails = [cqblend.Rail(s, cqblend.Curve.bezier([[1, 1], [8, 1]])) for s in (plane, plane + [0, -3, 4])]
    >>> blend = cqblend.hermite_blend(*rails, continuity="G2")
    >>> blend.surface.degree, blend.form
    ((1, 5), 'exact')
    """
    orders = check_pair("continuity", continuity, partial(check_choice, built=CONTINUITIES))
    options = CrossDerivativeOptions(tangents, bulge, length, steer)
    if orders == ("G0", "G0"):
        options.refuse_given(G0_HAS_NO_CROSS_FIELD)
    rails, ribbons = prepare_rails((rail1, rail2), (int(orders[0][1]), int(orders[1][1])), options)
    form = check_choice("form", form, FORMS)
    if form == "exact":
        refuse_ignored_options(EXACT_FORM_IS_EXACT, tolerance=(tolerance, BLEND_DEFAULTS.tolerance))
    tolerance, angular_tolerance = (
        check_positive("tolerance", tolerance),
        check_positive("angular_tolerance", angular_tolerance),
    )
    allowed = CreaseLimit(angular_tolerance, None if crease is None else check_angle("crease", crease))
    blend = blend_surface.blend_ribbons(ribbons, form, tolerance, angular_tolerance)
    check_creases(blend, allowed)
    return Blend(blend.surface, blend.ribbons, blend.form, rails)


def curve_on(face: Any, edge: Any) -> Curve:
    """Return an edge of a face as a curve in the parameter plane of ``cqblend.to_surface(face)``.

    Parameters
    ----------
    face, edge : cadquery, build123d or TopoDS face and edge
        The edge as it is oriented in the face, if it is a seam.

    Raises
    ------
    SelectionError
        The edge is not one of the face.
    GeometryError
        Its curve in the parameter plane cannot be followed.
    """
    from cqblend.api.cad_shapes import to_topods_edge, to_topods_face
    from cqblend.brep.conversion import pcurves

    return pcurves.read_edge_pcurve(to_topods_face(face, "face"), to_topods_edge(edge))


def projected(surface: Any, curve: Any, *, tolerance: float = 1e-7) -> Curve:
    """Project a curve in space onto a surface: return the curve of the foot points in the parameter plane.

    Parameters
    ----------
    surface : Surface or a face
    curve : Curve of dim 3 or an edge
    tolerance : float
        Largest distance between the surface's curve and the foot points, mm.

    Raises
    ------
    GeometryError
        A point of the curve has no foot inside the surface; the message names t.
    """
    from cqblend.api.cad_shapes import to_topods_edge, to_topods_face
    from cqblend.brep.conversion import pcurves, spline_conversion

    if not isinstance(surface, Surface):
        surface = spline_conversion.to_surface(to_topods_face(surface, "surface"))
    if not isinstance(curve, Curve):
        curve = to_topods_edge(curve)
    return pcurves.project_to_parameters(surface, curve, check_positive("tolerance", tolerance))
