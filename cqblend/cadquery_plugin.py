"""``Workplane.blend``, and its registration on CadQuery.

Exists so that blends read like fillets in a chain of CadQuery calls. It must stay importable without CadQuery: CadQuery
comes to it, through an import hook, and what a blend needs is imported when one is made.
"""

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cqblend.errors import SelectionError
from cqblend.request import STEER

if TYPE_CHECKING:
    from cqblend.front import BlendResult


def blend(
    self: Any,
    radius: float | None = None,
    *,
    width: float | tuple[float, float] | None = None,
    continuity: str | tuple[str, str] | None = None,
    tangents: str | tuple[str, str] = "perpendicular",
    bulge: float | tuple[float, float] = 1.0,
    steer: float = STEER,
    section: str = "hermite",
    form: str = "auto",
    tolerance: float = 1e-7,
    angular_tolerance: float = 1e-5,
    first: Any = None,
    report: "Callable[[BlendResult], object] | None" = None,
) -> Any:
    """Blend the selected edges of the solid in the chain.

    As `Workplane.fillet`: the edges of all objects on the stack are blended, and the solid that they belong to must be
    on the stack or in its parents. The parameters are those of `cqblend.blend_edges`; give either `radius` or `width`.

    Parameters
    ----------
    report : callable, optional
        Is called with the `cqblend.BlendResult`: shape, blend faces and certificate.

    Returns
    -------
    Workplane
        With the blended solid on its stack.

    Raises
    ------
    SelectionError
        No edge is selected, or one does not belong to the solid, is a seam, degenerate or smooth already.
    CqblendError
        Whatever else `cqblend.blend_edges` raises.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> part = cadquery.Workplane().box(30, 20, 10).edges("|Z and >X and >Y")
    >>> part.blend(2, report=lambda result: print(result.certificate.form)).solids().size()
    exact
    1
    """
    from cqblend.front import blend_edges

    edges = self.edges().vals()
    if not edges:
        raise SelectionError("no edge is selected: put .edges(...) before .blend(...)")
    result = blend_edges(
        self,
        edges,
        radius,
        width=width,
        continuity=continuity,
        tangents=tangents,
        bulge=bulge,
        steer=steer,
        section=section,
        form=form,
        tolerance=tolerance,
        angular_tolerance=angular_tolerance,
        first=first,
    )
    if report is not None:
        report(result)
    return self.newObject([result.shape])


def register(cadquery: ModuleType) -> None:
    """Give ``cadquery.Workplane`` its blend; one that is there already is overwritten."""
    cadquery.Workplane.blend = blend
