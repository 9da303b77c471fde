"""Public function that blends surfaces along rails, or boundary data, by partial differential equations.

The method is You and Zhang's. The arguments are checked here; the equations are solved by
:mod:`cqblend.blends.pde.pde_settings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from cqblend.api.cross_derivatives import Amount, CrossDerivativeOptions, CrossLength, Tangents, prepare_rails
from cqblend.api.surface_blend import Blend
from cqblend.api.tolerances import BLEND_TOLERANCES
from cqblend.argument_checks import check_angle, check_choice, check_count, check_count_or_auto, check_positive
from cqblend.blend_numbers import OPTION_LIMITS, check_pde_orders
from cqblend.blend_options import BLEND_DEFAULTS, FORMS
from cqblend.blends.pde.boundary_data import Boundary, DataRibbon
from cqblend.blends.pde.pde_settings import BASIS_NAMES, PdeSettings, SideSetup
from cqblend.blends.pde.solution import EndSections, Solution
from cqblend.blends.pde.varying_equation import VaryingParameters
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import is_periodic
from cqblend.certificate import Certificate
from cqblend.errors import InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array

END_SECTION_SAMPLES = 65
"""Number of Chebyshev points across a blend at which an end section is sampled."""


@dataclass(frozen=True)
class PdeBlend(Blend):
    """A blend surface H(t, v) between two sides, v = 0 on the first and 1 on the second.

    Attributes
    ----------
    surface : Surface
        H, over the domain of the first side times [0, 1].
    ribbons : tuple of Ribbon
        Rail and cross derivatives on each side.
    form : {"exact", "compact"}
    rails : tuple of Rail
        The rails, with the sides of them on which the blend lies; none between boundary data.
    solution : Solution
        The solution of the equations, which the surface follows within its tolerance, except for the error of the basis
        along the rails: callable at (t, v), with its ``residual``, ``terms``, ``basis`` and ``equations``.
    known : tuple of int
        Highest order of the derivatives that are given on each side.
    """

    solution: Solution = field(repr=False)
    known: tuple[int, int] = (2, 2)

    @cached_property
    def certificate(self) -> Certificate:
        """How exactly the blend meets its sides, measured by OCCT, and proven from the splines' coefficients.

        On boundary data, the angle is that to the plane of their first derivatives, the jump that to the curvature of
        their second derivatives; nan where these are not given.
        """
        from cqblend.brep.verification.blend_certification import certify_surfaces

        certificate = certify_surfaces(self, self.traces)
        records = tuple(
            replace(
                record,
                angle=record.angle if order > 0 else np.nan,
                curvature_jump=record.curvature_jump if order > 1 else np.nan,
            )
            for record, order in zip(certificate.rails, self.known, strict=True)
        )
        return replace(certificate, rails=records)

    @property
    def traces(self) -> list[tuple[Surface, Curve]]:
        """For each side the surface, or the strip made of the boundary data, and the rail in its parameter plane."""
        strips = [ribbon.trace for ribbon in self.ribbons if isinstance(ribbon, DataRibbon)]
        return strips or super().traces


def pde_blend(
    side1: Rail | Boundary,
    side2: Rail | Boundary,
    *,
    order: int | Sequence[int] = 4,
    parameters: VaryingParameters = None,
    terms: int | str = "auto",
    basis: str = "auto",
    modes: int | str = "auto",
    points: int | tuple[int, int] | str = "auto",
    minimise: str = "auto",
    ends: tuple[Boundary, Boundary] | None = None,
    tangents: Tangents | tuple[Tangents, Tangents] = "perpendicular",
    bulge: Amount | tuple[Amount, Amount] = 1.0,
    length: CrossLength | tuple[CrossLength, CrossLength] = None,
    form: str = "auto",
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    steer: float = BLEND_DEFAULTS.steer,
    crease: float | None = None,
) -> PdeBlend:
    r"""Blend two surfaces, or two sets of boundary data, by partial differential equations.

    Between the sides, x, y and z each solve an equation of order n = 2, 4 or 6 (You and Zhang, eq. 1 to 6),

    .. math:: a f_{vv} + b f_{ww} = 0, \quad
        a f_{vvvv} + b f_{vvww} + c f_{wwww} = 0, \quad
        a f_{v^6} + b f_{v^4 w^2} + c f_{v^2 w^4} + d f_{w^6} = 0,

    with v from 0 on side 1 to 1 on side 2, and w along: t itself for boundary data, the rails' common length, scaled to
    [0, 2 pi] on closed and to [0, 1] on open ones, for rails. (The paper's u and v are v and w here.)

    Parameters
    ----------
    side1, side2 : two Rail or two Boundary
        Rails give position and derivatives by their ribbons.
    order : int or three of them
        2 keeps the position on both sides, 4 the first derivative too, 6 the second: G0, G1, G2. Three are for x, y
        and z: (2, 2, 4) is the paper's eq. 4, (2, 2, 6) its eq. 5, (4, 4, 6) its eq. 6. A mix is as smooth as its
        lowest order.
    parameters
        Shape parameters (a, b), (a, b, c) or (a, b, c, d), or three such tuples for x, y and z. A number s stands for
        the powers of :math:`\partial_v^2 + s^2 \partial_w^2`: the larger, the less of the rails' shape reaches the
        middle. None is that with the s for which v and w count in lengths: Laplace's equation and its powers. Any of
        them may be a smooth function of arrays of w, above 0 (for those between the first and the last, not below): it
        stands inside the derivatives along, :math:`\sum_i (c_i(w) f_{v^{n-2i} w^i})_{w^i} = 0`. A function s(w) alone
        stands for the powers of Laplace's operator on a strip of width s(w), :math:`c_i = \binom{n/2}{i} s^{2i+1-n}`,
        and "local" is that with the distance of the rails at w: where the distance varies much, sections then do not
        fold.
    terms : int or "auto"
        Polynomials across beyond those that carry the boundary data; by default as many as the solution takes within
        `tolerance`, on open rails as many as keep the degree across at 9.
    basis : {"auto", "trigonometric", "bspline", "polynomial"}
        Functions g_j along. By default waves on closed sides, B-splines of degree order + 1 on open ones.
    modes : int or "auto"
        Number of waves, or of spans, or the degree of the polynomials; by default the fewest that hold the data,
        between open boundary data as many as the solution takes within `tolerance`: ``blend.solution.change`` (mm) is
        what more of them, or more terms, would change.
    points : int, pair of int or "auto"
        Collocation points across (and along) at which the residual is minimised; by default Gauss's, so many that the
        sum is the integral.
    minimise : {"auto", "residual", "energy"}
        What the solution makes least: the sum of squares of the residual, as in the paper, or the energy whose least
        value solves the equations. By default the residual on closed sides and between `ends`, else the energy: at the
        corners of open blends solutions are singular, and the residual misleads.
    ends : pair of Boundary, optional
        The end sections of open boundary data: position and derivatives by w (the ``first``, ``second`` of each), as
        functions of v from 0 to 1. By default Hermite's sections (their position).
    tangents, bulge, length, steer
        Of rails, as in `cqblend.hermite_blend`.
    form : {"auto", "exact", "compact"}
        "exact" keeps the sides to rounding; "compact" is a spline of least degree within the tolerances. Inside, both
        are the solution within `tolerance`.
    tolerance, angular_tolerance : float
        mm and rad.
    crease : float, optional
        Largest angle of a crease inside, as in `cqblend.hermite_blend`, rad.

    Raises
    ------
    InputError
        An argument is of the wrong type or out of range, the parameters are degenerate, the sides do not match (in
        kind, domain or closedness), there are fewer derivatives than the order takes, or fewer collocation points than
        unknowns.
    GeometryError
        The sides are one curve or points, they span no tangent planes, the tolerance takes too many spans, or as in
        `cqblend.hermite_blend`.
    DegreeError
        The exact form would need a degree above 25.

    References
    ----------
    L. You, J. Zhang: Effects of different order PDEs on blending surfaces, sections 2 and 3.

    Examples
    --------
    >>> import numpy as np, cqblend
    >>> low = cqblend.Boundary((lambda t: 2 * np.cos(t), lambda t: 2 * np.sin(t), 0), (0, 0, 3))
    >>> high = cqblend.Boundary((np.cos, np.sin, 2), (0, 0, 3))
    >>> blend = cqblend.pde_blend(low, high, order=4, parameters=(1, 2, 1))
    >>> blend.certificate.angle < 1e-10, blend.certificate.residual < 1e-9
    (True, True)
    """
    wanted = PdeSettings(
        check_pde_orders(order),
        parameters,
        check_count_or_auto("terms", terms, OPTION_LIMITS.max_terms),
        check_choice("basis", basis, BASIS_NAMES),
        check_count_or_auto("modes", modes, OPTION_LIMITS.max_modes),
        _check_points(points),
        check_choice("minimise", minimise, ("auto", "residual", "energy")),
    )
    highest = max(wanted.halves) - 1
    form = check_choice("form", form, FORMS)
    tolerance, angular_tolerance = (
        check_positive("tolerance", tolerance),
        check_positive("angular_tolerance", angular_tolerance),
    )
    allowed = CreaseLimit(angular_tolerance, None if crease is None else check_angle("crease", crease))
    blend_ribbons = partial(wanted.blend_ribbons, form=form, tolerance=tolerance, angular_tolerance=angular_tolerance)
    options = CrossDerivativeOptions(tangents, bulge, length, steer)
    if isinstance(side1, Boundary) and isinstance(side2, Boundary):
        options.refuse_given("between boundary data, which have derivatives of their own")
        closed = _check_match(side1, side2, wanted)
        first, second = side1.ribbon(highest, 0, side2), side2.ribbon(highest, 1, side1)
        sections = _check_ends(ends, wanted, closed, (side1, side2))
        blend, solution = blend_ribbons((first, second), setup=SideSetup(closed, by_length=False, ends=sections))
        rails: tuple[Rail, ...] = ()
        known = len(side1.curves) - 1, len(side2.curves) - 1
    else:
        if isinstance(side1, Boundary) or isinstance(side2, Boundary):
            raise InputError("a blend takes two rails or two boundaries, not one of each: they do not match")
        if ends is not None:
            raise InputError("ends are those of boundary data: blends along rails end in Hermite sections")
        rails, ribbons = prepare_rails((side1, side2), (highest, highest), options)
        if rails[0].closed != rails[1].closed:
            raise InputError("one rail is closed, the other open: they do not match; clip the closed one")
        blend, solution = blend_ribbons(ribbons, setup=SideSetup(rails[0].closed and all(map(is_periodic, ribbons))))
        known = (2, 2)
    check_creases(blend, allowed, ("side 1", "side 2"), steers=bool(rails))
    return PdeBlend(
        blend.surface, blend.ribbons, blend.form, rails, solution, known, kind=blend.kind, residual=blend.residual
    )


def _check_match(side1: Boundary, side2: Boundary, wanted: PdeSettings) -> bool:
    """Check that both sides have one domain, and the derivatives that the order needs; return if they are closed."""
    if side1.domain != side2.domain:
        raise InputError(f"the sides run over {side1.domain} and {side2.domain}: they do not match; give one domain")
    if side1.closed != side2.closed:
        state = "first" if side1.closed else "second"
        raise InputError(f"the {state} side is closed, the other open: they do not match")
    for name, side in (("first", side1), ("second", side2)):
        if len(side.curves) < max(wanted.halves):
            needs = ("position", "first derivative", "second derivative")[len(side.curves)]
            raise InputError(f"an equation of order {max(wanted.order)} needs the {needs} on the {name} side")
    return side1.closed


def _check_ends(given: Any, wanted: PdeSettings, closed: bool, sides: tuple[Boundary, Boundary]) -> EndSections | None:
    """Return the end sections sampled at Chebyshev points, after checking that they meet the sides at the corners."""
    if given is None:
        return None
    if closed:
        raise InputError("closed sides have no end sections: leave ends out")
    if not isinstance(given, list | tuple) or len(given) != 2 or not all(isinstance(one, Boundary) for one in given):
        raise InputError(f"ends are two Boundary, functions of v, not {shown(given)}")
    v = (1 - np.cos(np.pi * (np.arange(END_SECTION_SAMPLES) + 0.5) / END_SECTION_SAMPLES)) / 2
    half, jets = max(wanted.halves), list[Array]()
    for one in given:
        if one.domain != (0.0, 1.0):
            raise InputError(f"end sections run over v from 0 to 1, not {one.domain}: give domain=(0, 1)")
        if len(one.curves) < half:
            raise InputError(f"an equation of order {max(wanted.order)} needs {half} sets of data on each end section")
        _check_corners(one, sides, len(jets), wanted.halves)
        jets.append(np.stack([curve(v) for curve in one.curves[:half]]))
    return EndSections(v, np.stack(jets))


def _check_corners(section: Boundary, sides: tuple[Boundary, Boundary], end: int, halves: tuple[int, int, int]) -> None:
    """Raise InputError where an end section does not meet a side, in position or in the first derivative across."""
    for number, side in enumerate(sides):
        assert side.domain is not None
        t, v = side.domain[end], float(number)
        size = np.abs(np.concatenate([one.curves[0](one.curves[0].breaks) for one in sides])).max()
        for k, curve in enumerate(side.curves[:2]):
            apart = np.linalg.norm((section.curves[0](v, k) - curve(t))[np.array(halves) > k])
            if apart > BLEND_TOLERANCES.corner * size:
                raise InputError(
                    f"ends[{end}] misses side {number + 1} at t = {t:.6g} by {apart:.2g} in "
                    f"{('position', 'the first derivative')[k]}: ends are functions of v, from side 1 to side 2"
                )


def _check_points(value: object) -> tuple[int | None, int | None]:
    if isinstance(value, list | tuple) and len(value) == 2:
        return check_count("points[0]", value[0], OPTION_LIMITS.max_collocation_points), check_count(
            "points[1]", value[1], OPTION_LIMITS.max_collocation_points
        )
    return check_count_or_auto("points", value, OPTION_LIMITS.max_collocation_points), None
