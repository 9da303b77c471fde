"""``Workplane.blend`` and ``Workplane.unroll``, and their registration on CadQuery.

Exists so that blends and patterns read like fillets in a chain of CadQuery calls. It must stay importable without
CadQuery: CadQuery comes to it, through an import hook, and what a blend needs is imported when one is made.
"""

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cqblend.blend_options import DEFAULT_STEER
from cqblend.checks import check_callback
from cqblend.errors import SelectionError

if TYPE_CHECKING:
    from cqblend.api.flat_pattern import Pattern
    from cqblend.api.solid_blend import BlendResult


def blend(
    self: Any,
    radius: float | None = None,
    *,
    width: float | tuple[float, float] | None = None,
    continuity: str | tuple[str, str] | None = None,
    tangents: str | tuple[str, str] = "perpendicular",
    bulge: float | tuple[float, float] = 1.0,
    steer: float = DEFAULT_STEER,
    crease: float | None = None,
    section: str = "hermite",
    a: float | None = None,
    b: float | None = None,
    lam: float | None = None,
    order: int | tuple[int, int, int] | None = None,
    parameters: Any = None,
    terms: int | str = "auto",
    form: str = "auto",
    tolerance: float = 1e-7,
    angular_tolerance: float = 1e-5,
    ends: str | tuple[str, str] = "auto",
    first: Any = None,
    report: "Callable[[BlendResult], object] | None" = None,
) -> Any:
    """Blend the selected edges of the solid in the chain.

    As `Workplane.fillet`: the edges of all objects on the stack are blended, and the solid that they belong to must be
    on the stack or in its parents. The parameters are those of `cqblend.blend_edges`; give either `radius` or `width`,
    or `a` and `b`.

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
        No edge is selected, one does not belong to the solid, or all of them are seams, degenerate or smooth already.
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
    from cqblend.api.solid_blend import blend_edges

    check_callback("report", report, "the result")
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
        crease=crease,
        section=section,
        a=a,
        b=b,
        lam=lam,
        order=order,
        parameters=parameters,
        terms=terms,
        form=form,
        tolerance=tolerance,
        angular_tolerance=angular_tolerance,
        ends=ends,
        first=first,
    )
    if report is not None:
        report(result)
    return self.newObject([result.shape])


def unroll(
    self: Any,
    tolerance: float,
    *,
    method: str = "longest",
    direction: str = "auto",
    layout: str = "smooth",
    strain: float = 0.01,
    developable: bool = False,
    even: bool = False,
    least_width: float | None = None,
    flat_tolerance: float | None = None,
    progress: Callable[[float, str], object] | None = None,
    report: "Callable[[Pattern], object] | None" = None,
) -> Any:
    """Unroll the faces, shells or solids on the stack to planar faces on XY, for a cutter.

    The parameters are those of `cqblend.unroll`.

    Parameters
    ----------
    report : callable, optional
        Is called with the `cqblend.Pattern`: pieces, seams and report; it writes files, too.

    Returns
    -------
    Workplane
        With the flat pieces on its stack, side by side.

    Raises
    ------
    CqblendError
        Whatever `cqblend.unroll` raises.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> can = cadquery.Workplane().circle(3).extrude(4)
    >>> can.unroll(0.01, report=lambda pattern: print(pattern.report.seams, "seams")).size()
    3 seams
    3
    """
    from cqblend.api import flat_pattern

    check_callback("report", report, "the pattern")
    pattern = flat_pattern.unroll(
        self,
        tolerance,
        method=method,  # type: ignore[arg-type]
        direction=direction,  # type: ignore[arg-type]
        layout=layout,  # type: ignore[arg-type]
        strain=strain,
        developable=developable,
        even=even,
        least_width=least_width,
        flat_tolerance=flat_tolerance,
        progress=progress,
    )
    if report is not None:
        report(pattern)
    return self.newObject(pattern.faces())


def register_methods(cadquery: ModuleType) -> None:
    """Give ``cadquery.Workplane`` its methods; those that are there already are overwritten."""
    cadquery.Workplane.blend = blend
    cadquery.Workplane.unroll = unroll
