"""Public functions of the potential method (Lee, Bedi and Dubey): reshape surfaces, and blend two of them.

Two surfaces are reshaped by amounts that a relation couples; the curves in which they intersect make the blend. The
arguments are checked here; the curves are computed by :mod:`cqblend.blends.potential.family_pair` and
:mod:`cqblend.blends.potential.swept_blend`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cqblend.api.reshaping_arguments import DEFAULT_TUNING, check_tuning, group_amounts, resolve_reference
from cqblend.api.surface_blend import Blend
from cqblend.api.tolerances import BLEND_TOLERANCES
from cqblend.argument_checks import (
    check_angle,
    check_choice,
    check_positive,
    is_default,
    refuse_ignored_options,
    to_finite_array,
    to_point,
)
from cqblend.blend_options import BLEND_DEFAULTS, EXACT_FORM_IS_EXACT, FORMS
from cqblend.blends.potential.family_pair import FamilyPair, format_point
from cqblend.blends.potential.implicit_branches import trace_contours
from cqblend.blends.potential.implicit_pair import ImplicitPair
from cqblend.blends.potential.implicit_surface import ImplicitSurface, evaluate_implicit
from cqblend.blends.potential.implicit_sweep import ImplicitSweep, sweep_contour
from cqblend.blends.potential.intersection_branches import IntersectionBranch, find_nearest_approach, trace_branches
from cqblend.blends.potential.offset_family import OffsetFamily
from cqblend.blends.potential.reference_family import ReferenceFamily
from cqblend.blends.potential.relations import Relation, to_relation
from cqblend.blends.potential.surface_family import Family
from cqblend.blends.potential.swept_blend import Sweep, sweep_branch
from cqblend.blends.potential.swept_section import SweptSection, loosen_until_feasible
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import Ribbon, is_faded
from cqblend.blends.sections import blend_surface
from cqblend.certificate import Certificate
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import SplineSurface, TensorSurface

Amounts: TypeAlias = "float | Callable[[Array], Any] | Sequence[Sequence[float | Callable[[Array], Any]]] | None"
"""Offset at s: a factor on s, a function of arrays of s, one of these for each control point, or None for s itself."""

Reference: TypeAlias = "str | ArrayLike | Callable[[Array], Any]"

HALF_WAY = 0.5
"""Parameter x of the relation at which the branches of the intersection are traced."""


@dataclass(frozen=True)
class PotentialBlend(Blend):
    """A blend surface H(t, v) between two reshaped surfaces, v = 0 on surface 1 and 1 on surface 2.

    Attributes
    ----------
    surface : Surface
        H. Where the reshaped surfaces meet along a line of one of their own parameters, t is affine to that.
    ribbons : tuple of Ribbon
    form : {"exact", "compact"}
    rails : tuple of Rail
        On surface 1 where it meets S2(b), on surface 2 where it meets S1(a).
    families : tuple of Family or ImplicitSurface
    relation : Relation
    sweep : Sweep
        The exact intersection curves: ``blend.swept(t, v)``, at the amounts ``blend.amounts(v)``.
    skin : float
        Largest measured distance between H and these curves, mm.
    """

    families: tuple[Family, Family | ImplicitSurface] = field(repr=False)
    relation: Relation
    sweep: Sweep = field(repr=False)
    skin: float

    @cached_property
    def certificate(self) -> Certificate:
        """How exactly the blend meets its surfaces, measured by OCCT, and proven from the splines' coefficients.

        On an implicit surface, gap and angle are those of the rail from f and its gradient; nothing is proven there,
        and there is no jump of curvature.
        """
        from cqblend.brep.verification.blend_certification import certify_surfaces
        from cqblend.brep.verification.implicit_contact import measure_implicit_contact

        certificate, implicit = certify_surfaces(self, self.traces), self.families[1]
        if not isinstance(implicit, ImplicitSurface):
            return certificate
        gap, angle = measure_implicit_contact(self.surface, 1.0, partial(evaluate_implicit, implicit))
        first, second = certificate.rails
        return replace(
            certificate, rails=(first, replace(second, gap=gap, angle=angle, curvature_jump=np.nan)), proofs=()
        )

    def amounts(self, v: ArrayLike) -> Array:
        """Return (s1, s2), (..., 2), by which the surfaces are reshaped at v: (0, b) at 0, (a, 0) at 1.

        Raises
        ------
        InputError
            A v is not between 0 and 1.
        """
        v = to_finite_array("v", v)
        if v.size and not (v.min() >= 0 and v.max() <= 1):
            raise InputError(f"v runs over [0, 1], not to {v.flat[np.abs(v - 0.5).argmax()]:.6g}")
        return self.sweep.curves.pair.s(1 - v)

    @property
    def hermite(self) -> Blend:
        """The Hermite blend of the same ribbons, which follows the intersection curves at the rails only."""
        first, second = (replace(ribbon, order=1) for ribbon in self.ribbons)
        blend = blend_surface.blend_ribbons(
            (first, second), self.form, BLEND_DEFAULTS.tolerance, BLEND_DEFAULTS.angular_tolerance
        )
        return Blend(blend.surface, self.ribbons, blend.form, self.rails)

    def swept(self, t: ArrayLike, v: ArrayLike) -> Array:
        """Return the points (..., 3) in which the reshaped surfaces meet, at t and v = 1 - x, to rounding.

        Raises
        ------
        InputError
            t or v is outside its range.
        """
        t, v = to_finite_array("t", t), to_finite_array("v", v)
        try:
            t, v = np.broadcast_arrays(t, v)
        except ValueError as error:
            raise InputError(f"t of shape {t.shape} and v of shape {v.shape} do not go together") from error
        low, high = self.sweep.domain
        if not (np.all((t >= low) & (t <= high)) and np.all((v >= 0) & (v <= 1))):
            raise InputError(f"t runs over [{low:.9g}, {high:.9g}] and v over [0, 1]")
        x = 1 - v.ravel()
        q = self.sweep.solve_parameters(t.ravel(), x)
        return self.sweep.curves.pair.evaluate_jets(q, x)[0][0].reshape(*t.shape, 3)


def reshape(
    surface: Any,
    by: str = "reference",
    *,
    reference: Reference = "centroid",
    tuning: Sequence[float] = DEFAULT_TUNING,
    amounts: Amounts = None,
    tolerance: float = BLEND_TOLERANCES.default_offset_error,
) -> Family:
    r"""Make a family of surfaces S(u, v; s) out of one, S(u, v; 0).

    By reference, control points move along their vectors from a reference point C, Lee, Bedi and Dubey's eq. 3; by
    normal, points of the surface move along its unit normals:

    .. math:: p_{jk}(s) = p_{jk} + f_{jk}(s) (p_{jk} - C(s)), \qquad
        S(u, v; s) = S + f(u, v; s)\, n, \quad n = \frac{S_u \times S_v}{|S_u \times S_v|}.

    Parameters
    ----------
    surface : Surface or a face
        Normals of a face point out of the material.
    by : {"reference", "normal"}
    reference
        "centroid" of the control points, "extents" for the paper's rule (half of max - min of the control points'
        coordinates, times `tuning`), a point, or a function from an array of s to as many points.
    tuning : three float
        The paper's delta, for "extents" only.
    amounts
        f(s): None for s itself, a factor on s (-1 shrinks, or offsets to the other side), a function of arrays of s, or
        rows of these, one for each control point. By normal, f(u, v; s) is then the spline with these coefficients.
        Functions must be 0 at 0, and smooth.
    tolerance : float
        Accuracy of offset surfaces as splines, relative to the largest amount. Offsets of planes, cylinders, cones,
        spheres and tori are exact. Blends do not use these splines, they evaluate offsets exactly.

    Returns
    -------
    Family
        ``family(s)`` is the surface at s; `cqblend.potential_blend` takes the family.

    Raises
    ------
    InputError
        An argument is of the wrong type or shape, or the reference lies in a plane that it is to move.

    References
    ----------
    T. Lee, S. Bedi, R. N. Dubey: A parametric surface blending method for complex engineering objects, 1993, "Reshaping
    of parametric surfaces".

    Examples
    --------
    >>> import cqblend
    >>> corners = [[[0, 0, 0], [0, 4, 0]], [[4, 0, 0], [4, 4, 0]]]
    >>> square = cqblend.Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), corners)
    >>> cqblend.reshape(square, by="normal")(0.5)(0.5, 0.5).tolist()
    [2.0, 2.0, 0.5]
    >>> cqblend.reshape(square, reference=(2, 2, -2))(0.5)(0, 0).tolist()
    [-1.0, -1.0, 1.0]
    """
    outward = 1.0
    if not isinstance(surface, Surface):
        from cqblend.api.cad_shapes import to_topods_face
        from cqblend.brep.conversion.spline_conversion import find_outward_sign, to_surface

        face = to_topods_face(surface, "surface")
        surface, outward = to_surface(face), find_outward_sign(face)
    if surface.dim != 3:
        raise InputError(f"a surface to reshape has dim 3, not {surface.dim}")
    by = check_choice("by", by, ("reference", "normal"))
    if by == "reference":
        refuse_ignored_options(
            'on by="reference", which is exact', tolerance=(tolerance, BLEND_TOLERANCES.default_offset_error)
        )
    else:
        refuse_ignored_options('on by="normal": normals need none', reference=(reference, "centroid"))
    if tuning is not DEFAULT_TUNING:
        tuning = check_tuning(tuning, has_effect=by == "reference" and is_default(reference, "extents"))
    tolerance = check_positive("tolerance", tolerance)
    poles = surface.to_bspline()[2]
    functions, groups = group_amounts(amounts, poles.shape[:2])
    if by == "normal":
        return OffsetFamily.from_surface(surface, functions, groups, tolerance, outward)
    return ReferenceFamily.from_surface(
        surface, functions, groups, resolve_reference(reference, tuning, poles), tolerance
    )


def potential_blend(
    surface1: Any,
    surface2: Any,
    relation: Any,
    *,
    near: ArrayLike | None = None,
    form: str = "auto",
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    skin: float | None = None,
    crease: float | None = None,
) -> PotentialBlend:
    r"""Blend two surfaces by the curves in which they meet while they are reshaped.

    With the families S1, S2 and a relation (s1, s2)(x) from (a, 0) to (0, b) that touches the axes, the blend is all
    points of

    .. math:: S_1(u_1, v_1; s_1(x)) = S_2(u_2, v_2; s_2(x)), \quad 0 \le x \le 1.

    Its rails are where S1(a) meets surface 2 and where S2(b) meets surface 1: a sets how far it reaches on surface 2, b
    how far on surface 1. It is tangent to both.

    Parameters
    ----------
    surface1, surface2 : Family, Surface or a face
        What `cqblend.reshape` made; surfaces and faces are reshaped from their centroids. Surface 2 may be a
        `cqblend.ImplicitSurface`, whose level sets f = s2 stand for reshaped ones.
    relation
        `cqblend.Conic`, `cqblend.BezierRelation`, or a function x -> (s1, s2), or two, of arrays.
    near : a point, optional
        Which of several intersection curves is meant: that nearest to the point, half-way through the relation.
    form, tolerance, angular_tolerance
        Of the joints, as in `cqblend.hermite_blend`: "exact" keeps rails and tangent planes to rounding, "compact" is
        a spline of least degree within the tolerances (mm and rad).
    skin : float, optional
        Largest distance of the blend from the intersection curves, and of the rails from those at x = 0 and 1, mm.
        By default 1e-5 of the distance between the rails, but not below `tolerance`; ten or a hundred times that where
        surfaces of low continuity would take too many spans. ``blend.skin`` says what it is.
    crease : float, optional
        Largest angle of a crease inside, rad, such as those where the reshaped surfaces have kinks. By default
        `angular_tolerance`, or the angle of the crease that the surface itself has there.

    Raises
    ------
    InputError
        An argument is of the wrong type, the relation does not touch the axes, or an amount does not start at 0.
    GeometryError
        The surfaces do not meet, touch, meet in several curves (give `near`), part while they are reshaped, leave their
        domains, or turn over on themselves; the message names s and the place. Or as in `cqblend.hermite_blend`.
    DegreeError
        The exact form would need a degree above 25.

    Notes
    -----
    Where an amount vanishes, so does the cross derivative on the other surface: the joint stays there as it was. The
    certificate says on how much of the rail (``certificate.rails[i].kept``), and leaves it out of the angle.

    References
    ----------
    T. Lee, S. Bedi, R. N. Dubey: A parametric surface blending method for complex engineering objects, 1993; the
    potential method of C. Hoffmann and J. Hopcroft, 1987.

    Examples
    --------
    >>> import cqblend
    >>> def square(o, u, v):
    ...     o, u, v = map(np.array, (o, u, v))
    ...     corners = [[o, o + v], [o + u, o + u + v]]
    ...     return cqblend.Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), corners)
    >>> floor = cqblend.reshape(square((0, 0, 0), (9, 0, 0), (0, 9, 0)), by="normal")
    >>> wall = cqblend.reshape(square((0, 0, 0), (0, 9, 0), (0, 0, 9)), by="normal")
    >>> blend = cqblend.potential_blend(floor, wall, cqblend.Conic(2, 2, 0))
    >>> radius = np.linalg.norm(blend.surface(0.5, 0.3)[[0, 2]] - [2, 2])
    >>> bool(abs(radius - 2) < 2e-5), blend.certificate.angle < 1e-10
    (True, True)
    """
    pair = to_relation(relation)
    form = check_choice("form", form, FORMS)
    if form == "exact" and skin is not None:
        refuse_ignored_options(
            EXACT_FORM_IS_EXACT + " if the skin is given", tolerance=(tolerance, BLEND_DEFAULTS.tolerance)
        )
    tolerance, angular_tolerance = (
        check_positive("tolerance", tolerance),
        check_positive("angular_tolerance", angular_tolerance),
    )
    skin = None if skin is None else check_positive("skin", skin)
    allowed = CreaseLimit(angular_tolerance, None if crease is None else check_angle("crease", crease))
    if isinstance(surface1, ImplicitSurface):
        raise InputError(
            "the implicit surface is to be surface 2: give the other one first, and change a with b in the relation"
        )
    first_family = surface1 if isinstance(surface1, Family) else reshape(surface1)
    second_family = surface2 if isinstance(surface2, Family | ImplicitSurface) else reshape(surface2)
    swept = _sweep_chosen_branch(first_family, second_family, pair, near)
    blend, section = _blend_within_skin(swept, form, tolerance, angular_tolerance, skin)
    check_creases(blend, allowed, steers=False)
    missed = section.measure_deviation(blend.surface)
    if not missed <= 2 * section.tolerance:
        raise GeometryError(
            f"the blend misses the intersection curves by {missed:.2g} mm, more than {section.tolerance:.2g}: ask for "
            "a larger skin"
        )
    first, second = map(_mark_faded, blend.ribbons)
    if isinstance(swept, ImplicitSweep):
        strip = swept.strip
        rails = _make_rail(first, first_family.primary), _make_rail(second, TensorSurface.from_spline(strip))
    else:
        rails = _make_rail(first, first_family.primary), _make_rail(second, swept.curves.pair.families[1].primary)
    return PotentialBlend(
        blend.surface,
        (first, second),
        blend.form,
        rails,
        (first_family, second_family),
        pair,
        swept,
        missed,
        kind=blend.kind,
    )


def _sweep_chosen_branch(
    first: Family, second: Family | ImplicitSurface, relation: Relation, near: ArrayLike | None
) -> Sweep:
    """Return the surface that the curves sweep which both surfaces have in common, or the one of them near a point."""
    target = to_point(near)
    if near is not None and target is None:
        raise InputError(f"near is a point of three numbers, not {shown(near)}")
    if isinstance(second, ImplicitSurface):
        meeting = ImplicitPair.from_family(first, second, relation)
        return sweep_contour(meeting, _choose_branch(meeting, trace_contours(meeting, HALF_WAY), target), HALF_WAY)
    pair = FamilyPair.from_relation((first, second), relation)
    return sweep_branch(pair, _choose_branch(pair, trace_branches(pair, HALF_WAY), target), HALF_WAY)


def _blend_within_skin(
    swept: Sweep, form: str, tolerance: float, angular_tolerance: float, skin: float | None
) -> tuple[blend_surface.BlendSurface, SweptSection]:
    """Return the blend that follows a swept surface within a skin (mm), by default the smallest feasible one."""
    finest = BLEND_TOLERANCES.finest_skin
    if skin is not None and skin < finest * swept.width:
        raise InputError(
            f"a skin of {skin:.2g} mm is below {finest * swept.width:.2g}, {finest:g} of the distance between the "
            "rails: it would take too many spans"
        )

    def blend_within(allowed: float) -> tuple[blend_surface.BlendSurface, SweptSection]:
        ribbons = swept.fit_ribbons(allowed)
        section = SweptSection.from_sweep(swept, swept.closed, allowed, swept.kinks)
        return section.blend_ribbons(ribbons, form, tolerance, angular_tolerance), section

    return (
        blend_within(skin)
        if skin is not None
        else loosen_until_feasible(blend_within, max(tolerance, BLEND_TOLERANCES.default_skin * swept.width))
    )


def _choose_branch(meeting: FamilyPair, found: list[IntersectionBranch], target: Array | None) -> IntersectionBranch:
    """Return the one branch of the intersection half-way, or that nearest to a point."""
    s1, s2 = meeting.s(HALF_WAY)
    if not found and isinstance(meeting, ImplicitPair):
        raise GeometryError(
            f"the surface does not meet f = {s2:.4g} where it is reshaped by s = {s1:.4g}, half-way: choose other a "
            "and b, another reference, or move them"
        )
    if not found:
        distance, place = find_nearest_approach(meeting, HALF_WAY)
        raise GeometryError(
            f"the reshaped surfaces do not meet at s = ({s1:.4g}, {s2:.4g}), half-way: they come within {distance:.3g} "
            f"mm of each other, at {format_point(place)}; choose other a and b, another reference, or move them"
        )
    if target is not None:
        return min(found, key=lambda one: float(np.linalg.norm(one.points - target, axis=1).min()))
    if len(found) > 1:
        places = ", ".join(
            f"{'closed' if one.closed else 'open'} through {format_point(one.points[len(one.points) // 2])}"
            for one in found
        )
        raise GeometryError(
            f"the reshaped surfaces meet in {len(found)} curves at s = ({s1:.4g}, {s2:.4g}), half-way: {places}; "
            "choose one with near=(x, y, z)"
        )
    return found[0]


def _mark_faded(ribbon: Ribbon) -> Ribbon:
    """Return a ribbon, with order 0 if its cross derivative vanishes somewhere, so that it is not tangent all along."""
    return replace(ribbon, order=0) if is_faded(ribbon, np.linspace(*ribbon.c.domain, 1025)).any() else ribbon


def _make_rail(ribbon: Ribbon, primary: SplineSurface) -> Rail:
    """Return the rail of a ribbon; a periodic surface is repeated as often as the rail runs around it."""
    surface = primary.surface
    c = ribbon.c
    weight = c[0] + c[1]
    plane = Curve.stack([c[1], c[3], weight])
    curve = Curve(plane.breaks, plane.coefs, rational=True, continuity=plane.continuity).reduce()
    for axis, period in enumerate(primary.periods):
        if period is None:
            continue
        low, high = (float(bound[axis]) for bound in curve.bounds())
        a, b = surface.domain[axis]
        before, after = (max(0, int(np.ceil(over / period - 1e-9))) for over in (a - low, high - b))
        if before or after:
            surface = surface.tiled(axis, before, after)
    return Rail(surface, curve)
