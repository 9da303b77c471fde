"""The numbers that options of a blend may have: their limits, and checks that bring them to one form.

Light, since ``import cqblend`` loads it.
"""

from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Any, TypeAlias

from cqblend.argument_checks import check_positive
from cqblend.errors import InputError, SizeError, shown

if TYPE_CHECKING:
    from cqblend.blends.potential.relations import Conic
    from cqblend.sizes.size_law import SizeLaw

Size: TypeAlias = "float | SizeLaw"
"""A size after `BlendOptions.to_request`: a number (mm), or a law along the edge that is no number."""

PDE_ORDERS = (2, 4, 6)
"""Orders of partial differential equations that can be solved."""


@dataclass(frozen=True, slots=True)
class OptionLimits:
    """Bounds of what is accepted as an option."""

    min_size: float = 1e-6
    """Smallest radius, width or offset, mm: ten times OCCT's default tolerance. A smaller blend is no larger than the
    tolerance of its edge."""

    max_size: float = 1e9
    """Largest radius, width or offset, mm: above it, neighbouring doubles differ by more than OCCT's default tolerance,
    1e-7 mm."""

    min_bulge: float = 1e-12
    """Smallest bulge: with a smaller one, the cross derivatives are lost in the rounding of the poles."""

    max_bulge: float = 1e6
    """Largest bulge; a section turns back on itself long before."""

    max_terms: int = 100
    """Largest number of terms of a solution across the blend; more than any blend takes."""

    max_modes: int = 500
    """Largest number of modes of a solution along the blend; more than any blend takes."""

    max_collocation_points: int = 500
    """Largest number of collocation points in either direction."""


OPTION_LIMITS = OptionLimits()


def build_relation(a: object, b: object, lam: Any) -> "Conic":
    """Return the relation of a potential section; each of a and b is the other one if it is left out."""
    from cqblend.blends.potential.relations import Conic  # which takes NumPy: ``import cqblend`` does not

    if a is None and b is None:
        raise InputError('section="potential" takes a and b, how far each side is moved (mm): give one or both')
    first = (
        check_size_range("b", check_positive("b", b)) if a is None else check_size_range("a", check_positive("a", a))
    )
    second = first if b is None else check_size_range("b", check_positive("b", b))
    return Conic(first, second, 0.0 if lam is None else lam)


def check_bulge(name: str, value: object) -> float:
    """Return a factor on cross derivatives that neither vanish in rounding nor exceed all that a section can take.

    Raises
    ------
    InputError
        If it is not a number from `OptionLimits.min_bulge` to `OptionLimits.max_bulge`.
    """
    bulge, least, most = check_positive(name, value), OPTION_LIMITS.min_bulge, OPTION_LIMITS.max_bulge
    if not least <= bulge <= most:
        raise InputError(f"{name} must be from {least:g} to {most:g}, not {bulge:g}")
    return bulge


def check_pde_orders(order: object) -> tuple[int, int, int]:
    """Return the orders of partial differential equations for x, y and z: one for all, or three.

    Raises
    ------
    InputError
        If one is not 2, 4 or 6.
    """
    given = tuple(order) if isinstance(order, list | tuple) else (order,) * 3
    if len(given) != 3 or not all(isinstance(n, Integral) and n in PDE_ORDERS for n in given):
        raise InputError(f"order must be 2, 4 or 6, or three of them for x, y and z, not {shown(order)}")
    return int(given[0]), int(given[1]), int(given[2])


_RADIUS_PAIR_MESSAGE = (
    "radius must be a number, not {0}: a pair would mean a radius for each side, but a ball touches both with one; "
    "give width={0} for rails that far from the edge on side 1 and side 2, or radius=cqblend.linear{0} for a radius "
    "that varies along the edge"
)


def check_size(name: str, value: object) -> "Size":
    """Return a length that an edge can be blended with, as a float, or as a law if it varies."""
    if name == "radius" and isinstance(value, tuple | list) and len(value) == 2:
        raise InputError(_RADIUS_PAIR_MESSAGE.format(shown(value)))
    if not callable(value):
        return check_size_range(name, check_positive(name, value))
    from cqblend.sizes.law_checks import check_law  # which takes NumPy: ``import cqblend`` does not

    law = check_law(name, value)
    for size in (law,) if isinstance(law, float) else (law.smallest, law.largest):
        check_size_range(name, size)
    return law


def check_size_range(name: str, size: float) -> float:
    """Return a size (mm) that is neither too small nor too large for any shape."""
    least, most = OPTION_LIMITS.min_size, OPTION_LIMITS.max_size
    if size < least:
        raise SizeError(f"{name} {size:g} mm is below {least:g} mm, ten times OCCT's tolerance; scale the model up")
    if size > most:
        raise InputError(f"{name} {size:g} mm is above {most:g} mm, where doubles are coarser than OCCT's tolerance")
    return size
