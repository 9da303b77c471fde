"""Boundary data that belong to no surface: position and derivatives across, as functions of the parameter along.

Position C(t), first derivative T(t) and second derivative K(t) make an auxiliary surface C + v T + v^2/2 K and a ribbon
on it. So blends between boundary data are computed, measured and proven in the same way as blends between rails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from cqblend.argument_checks import call_user_function, check_integer, check_interval, check_number, to_float_array
from cqblend.blends.pde.tolerances import PDE_TOLERANCES
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import approximate_to_rounding
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import TensorSurface

ComponentFunction: TypeAlias = float | Curve | Callable[[Array], Any]
BoundaryFunction: TypeAlias = Curve | Callable[[Array], Any] | Sequence[ComponentFunction]


@dataclass(frozen=True)
class Boundary:
    """Position and derivatives by v (across) of a blend at one of its sides, as functions of t (along).

    As in You and Zhang's paper, v runs from side 1 to side 2 on both sides: on side 2, derivatives point out of the
    blend.

    Parameters
    ----------
    position
        A Curve of dim 3, a function of arrays of t (n,) that returns (n, 3), or three for x, y and z, each of them a
        number, a Curve of dim 1 or a function that returns (n,). mm.
    first, second
        First and second derivative by v, likewise; as many as the order of the equation takes. mm.
    domain
        Interval of t, where functions are given; (0, 2 pi) by default. Curves have a domain of their own.

    Raises
    ------
    InputError
        If data are of another type or shape, or domains differ.
    GeometryError
        If a function is not smooth.

    Examples
    --------
    >>> ring = Boundary((np.cos, np.sin, 0.0), first=(0.0, 0.0, 1.0))
    >>> ring.closed, ring.curves[0].dim
    (True, 3)
    """

    position: BoundaryFunction
    first: BoundaryFunction | None = None
    second: BoundaryFunction | None = None
    domain: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.position is None:
            raise InputError("a boundary needs a position")
        if self.second is not None and self.first is None:
            raise InputError("a boundary with a second derivative needs the first one, too")
        object.__setattr__(self, "domain", self._resolve_domain())
        self.curves  # noqa: B018  (functions are checked when the boundary is made, not at their first use)

    def _resolve_domain(self) -> tuple[float, float]:
        domains = {
            component.domain
            for given in self._given_data
            for component in _check_components(given)
            if isinstance(component, Curve)
        }
        if self.domain is not None:
            domains.add(check_interval("domain", self.domain))
        if len(domains) > 1:
            raise InputError(f"a boundary has one domain, not {' and '.join(map(str, sorted(domains)))}")
        return domains.pop() if domains else (0.0, 2 * np.pi)

    @property
    def _given_data(self) -> list[BoundaryFunction]:
        return [given for given in (self.position, self.first, self.second) if given is not None]

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Position and derivatives as curves of dim 3, as many as are given."""
        domain = self._resolve_domain()
        curves = []
        for given in self._given_data:
            components = _check_components(given)
            dim = 3 if len(components) == 1 else 1
            curves.append(Curve.stack([_to_curve(component, dim, domain) for component in components]))
        return tuple(curves)

    @cached_property
    def closed(self) -> bool:
        """Whether position and derivatives end as they start, with the same slopes."""
        return all(_is_curve_periodic(curve) for curve in self.curves)

    def rail(self, side: int) -> Rail:
        """Return the data of side 1 or 2 as a rail on the auxiliary surface C + v T + v^2/2 K, v into the blend.

        A blend along it with ``tangents=Combination(..)`` of (0, 1) and ``length="field"`` keeps position and first
        derivative; of the second derivative it keeps the curvature that it gives the surface.

        Raises
        ------
        InputError
            The side is neither, or no first derivative is given.
        GeometryError
            Position and derivative span no tangent plane somewhere.

        Examples
        --------
        >>> Boundary((np.cos, np.sin, 0.0), (0.0, 0.0, 1.0)).rail(1).surface(np.pi / 3, 0.5).round(6).tolist()
        [0.5, 0.866025, 0.5]
        """
        side = check_integer("the side", side, 1, 2)
        if len(self.curves) < 2:
            raise InputError("a boundary is a rail only with its first derivative: it has no tangent plane else")
        return Rail(*self.ribbon(1, side - 1, self).trace, "left")

    def ribbon(self, order: int, side: int, other: Boundary) -> DataRibbon:
        """Return the ribbon of side 0 or 1, with ``order`` cross derivatives.

        Where no derivative is given, the auxiliary surface runs straight to the other side.

        Raises
        ------
        GeometryError
            If order is 1 or 2, and position and first derivative span no tangent plane somewhere.
        """
        order, side = check_integer("the number of directions", order, 0, 2), check_integer("the side", side, 0, 1)
        if not isinstance(other, Boundary):
            raise InputError(f"the other side is a Boundary, not {shown(other)}")
        position, *rest = self.curves
        if not rest:
            rest = [(other.curves[0] - position) * (1.0, -1.0)[side]]
        if order:
            _check_tangent_plane(position, rest[0], side)
        stacked = Curve.stack([position, *rest]) if rest else position  # with one common weight
        jets = [stacked[i : i + 3] * (-1.0 if side and i == 3 else 1.0) for i in range(0, stacked.dim, 3)]
        jets += [jets[0] * 0.0] * (3 - len(jets))
        surface = Surface.from_rows([jets[0], jets[0] + jets[1] * 0.5, jets[0] + jets[1] + jets[2] * 0.5])
        a, b = position.domain
        lifted_rail = Curve([a, b], np.array([[1 - a, a, 1, 0], [1 - b, b, 1, 0]])[..., None])
        first, second = (Curve([a, b], np.array([[0, 0, -s, s]] * 2, float)[..., None]) for s in (1.0, 0.0))
        uv = np.array([[a, 0.0], [b, 0.0]])
        return DataRibbon(
            TensorSurface.from_spline(surface),
            lifted_rail,
            (first, second)[: max(order, 1)],
            uv,
            order,
            homogeneous_jets=tuple(_to_homogeneous(jet, k) for k, jet in enumerate(jets[: order + 1])),
            surface=surface,
        )


@dataclass(frozen=True)
class DataRibbon(Ribbon):
    """A ribbon on the auxiliary surface of boundary data.

    ``homogeneous_jets`` are the data themselves, curves of dim 4: they need not be composed from the surface.
    """

    homogeneous_jets: tuple[Curve, ...] = field(kw_only=True)
    surface: Surface = field(kw_only=True)

    def compose_jets(self) -> tuple[Curve, ...]:
        """Return the data."""
        return self.homogeneous_jets

    @property
    def trace(self) -> tuple[Surface, Curve]:
        """The auxiliary surface, and the boundary in its parameter plane."""
        (a, b), _ = self.surface.domain
        return self.surface, Curve.bezier([[a, 0.0], [b, 0.0]], domain=(a, b))


def _check_components(given: object) -> Sequence[ComponentFunction]:
    """Check a position or derivative, and return its components: one of dim 3, or three of dim 1."""
    if isinstance(given, Curve):
        if given.dim != 3:
            raise InputError(f"boundary data are Curves of dim 3, or three of dim 1, not of dim {given.dim}")
        return [given]
    if callable(given):
        return [given]
    parts = list(given) if isinstance(given, list | tuple) or (isinstance(given, np.ndarray) and given.ndim) else []
    if len(parts) != 3:
        raise InputError(f"boundary data are a Curve, a function, or three components, not {shown(given)}")
    for part in parts:
        if isinstance(part, Curve):
            if part.dim != 1:
                raise InputError(f"a component is a Curve of dim 1, not {part.dim}")
        elif not callable(part):
            check_number("a component that is no Curve and no function", part)
    return parts


def _to_curve(component: ComponentFunction, dim: int, domain: tuple[float, float]) -> Curve:
    """Return a Curve, a function or a number as a Curve of dimension ``dim``."""
    if isinstance(component, Curve):
        return component
    if callable(component):
        function = _wrap_function(component, dim)
        return approximate_to_rounding(function, domain, closed=_is_function_periodic(function, domain))
    return Curve(domain, np.full((1, 1, 1), float(component)))


def _wrap_function(function: Callable[[Array], Any], dim: int) -> Callable[[Array], Array]:
    """Return a function whose values have the shape (n, dim) and are finite; it raises InputError else."""
    expected = "(n, 3)" if dim == 3 else "(n,) as a component"

    def call_checked(t: Array) -> Array:
        given = call_user_function("boundary data that are a function take an array of parameters t", function, t)
        values = to_float_array("what a function of boundary data returns", given)
        if dim == 1 and values.shape in ((), (1,), (len(t),), (len(t), 1)):
            values = np.broadcast_to(values.reshape(-1), len(t))[:, None]
        if values.shape != (len(t), dim):
            raise InputError(f"boundary data that are a function return {expected}, not shape {values.shape}")
        if not np.isfinite(values).all():
            raise InputError(f"boundary data are not finite at t = {t[~np.isfinite(values).all(axis=1)][0]:.6g}")
        return values

    return call_checked


def _is_function_periodic(function: Callable[[Array], Array], domain: tuple[float, float]) -> bool:
    """Whether value and slope of a function at the end are those at its start."""
    a, b = domain
    h = PDE_TOLERANCES.slope_step * (b - a)
    values = function(np.array([a, a + h, a + 2 * h, b - 2 * h, b - h, b]))
    size = np.abs(function(np.linspace(a, b, 33))).max() + np.abs(values).max()
    slopes = [values[:3].T @ [-1.5, 2, -0.5], values[3:].T @ [0.5, -2, 1.5]]
    gaps = np.abs(values[0] - values[-1]).max(), np.abs(slopes[0] - slopes[1]).max() / PDE_TOLERANCES.slope_step
    return bool(gaps[0] <= PDE_TOLERANCES.closing_gap * size and gaps[1] <= PDE_TOLERANCES.function_slope_gap * size)


def _is_curve_periodic(curve: Curve) -> bool:
    """Whether a curve ends as it starts, with its slope."""
    (a, b), size = curve.domain, np.abs(curve(curve.breaks)).max()
    (first, first_slope), (last, last_slope) = curve.jet(np.array([a, b]), 1).swapaxes(0, 1)
    return bool(
        np.abs(first - last).max() <= PDE_TOLERANCES.closing_gap * size
        and np.abs(first_slope - last_slope).max() * (b - a) <= PDE_TOLERANCES.curve_slope_gap * max(size, 1e-300)
    )


def _check_tangent_plane(position: Curve, first: Curve, side: int) -> None:
    """Raise GeometryError where position and first derivative span no tangent plane."""
    t = np.linspace(*position.domain, 1025)
    rate, vector = position(t, 1), first(t)
    area = np.linalg.norm(np.cross(rate, vector), axis=1)
    size = np.linalg.norm(rate, axis=1).max() * np.linalg.norm(vector, axis=1).max()
    if not area.min() > PDE_TOLERANCES.tangent_area * size:
        raise GeometryError(
            f"position and first derivative of side {side + 1} span no tangent plane at t = {t[area.argmin()]:.6g}: "
            "one of them vanishes, or they are parallel"
        )


def _to_homogeneous(jet: Curve, order: int) -> Curve:
    """Return a jet as a homogeneous curve of dim 4: (w X, w), and (w X', 0) for derivatives."""
    coefs = jet.coefs.copy() if jet.rational else np.concatenate([jet.coefs, np.ones_like(jet.coefs[:, :1])], axis=1)
    if order:
        coefs[:, 3] = 0.0
    return Curve(jet.breaks, coefs, continuity=jet.continuity)
