"""``Workplane.blend``, ``.bridge`` and ``.unroll``, and their registration on CadQuery.

They make blends, bridges and patterns read like fillets in a chain of CadQuery calls. This module is loaded by ``import
cqblend`` and imports neither CadQuery nor NumPy: an import hook waits for the module CadQuery, and the methods import
what they need when they are called.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cqblend.argument_checks import check_callback
from cqblend.blend_options import BLEND_DEFAULTS, BlendOptions, GivenSize
from cqblend.bridge_options import BRIDGE_DEFAULTS, BridgeOptions
from cqblend.errors import SelectionError
from cqblend.option_records import collect_options, document_options
from cqblend.unroll_options import UNROLL_DEFAULTS, Direction, Layout, Method, UnrollOptions

if TYPE_CHECKING:
    from cqblend.api.flat_pattern import Pattern
    from cqblend.api.solid_functions import BlendResult


@document_options(BlendOptions)
def blend(
    self: Any,
    radius: GivenSize | None = None,
    *,
    width: GivenSize | tuple[GivenSize, GivenSize] | None = None,
    taper: float | None = None,
    continuity: str | tuple[str, str] | None = None,
    tangents: str | tuple[str, str] = BLEND_DEFAULTS.tangents,
    bulge: float | tuple[float, float] = BLEND_DEFAULTS.bulge,
    steer: float = BLEND_DEFAULTS.steer,
    crease: float | None = None,
    section: str = BLEND_DEFAULTS.section,
    a: float | None = None,
    b: float | None = None,
    lam: float | None = None,
    order: int | tuple[int, int, int] | None = None,
    parameters: Any = None,
    terms: int | str = BLEND_DEFAULTS.terms,
    form: str = BLEND_DEFAULTS.form,
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    ends: str | tuple[str, str] = BLEND_DEFAULTS.ends,
    corner: str = BLEND_DEFAULTS.corner,
    setback: float | Mapping[Any, float] | None = None,
    first: Any = None,
    on_error: str = BLEND_DEFAULTS.on_error,
    hold: Any = None,
    chain: bool = BLEND_DEFAULTS.chain,
    report: "Callable[[BlendResult], object] | None" = None,
) -> Any:
    """Blend the selected edges of the solid in the chain.

    As `Workplane.fillet`: the edges of all objects on the stack are blended, and the solid that they belong to must be
    on the stack or in its parents.

    Parameters
    ----------
    ... : the options of `BlendOptions`
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
    options = collect_options(BlendOptions, locals())
    from cqblend.api.solid_functions import blend_with_options

    check_callback("report", report, "the result")
    edges = self.edges().vals()
    if not edges:
        raise SelectionError("no edge is selected: put .edges(...) before .blend(...)")
    result = blend_with_options(self, edges, options)
    if report is not None:
        report(result)
    return self.newObject([result.shape])


@document_options(BridgeOptions)
def bridge(
    self: Any,
    side1: Any,
    side2: Any,
    *,
    continuity: str | tuple[str, str] = BRIDGE_DEFAULTS.continuity,
    bulge: float | tuple[float, float] = BRIDGE_DEFAULTS.bulge,
    tangents: str | tuple[str, str] = BRIDGE_DEFAULTS.tangents,
    section: str = BRIDGE_DEFAULTS.section,
    start: float | None = None,
    solid: bool = BRIDGE_DEFAULTS.solid,
    form: str = BRIDGE_DEFAULTS.form,
    tolerance: float = BRIDGE_DEFAULTS.tolerance,
    angular_tolerance: float = BRIDGE_DEFAULTS.angular_tolerance,
    steer: float = BRIDGE_DEFAULTS.steer,
    crease: float | None = None,
    report: "Callable[[BlendResult], object] | None" = None,
) -> Any:
    """Join two places of the solids in the chain by a smooth bridge.

    The solids are those on the stack, if there are several, else the one that the stack belongs to.

    Parameters
    ----------
    side1, side2 : a face, a closed edge or wire, a pair, or a Workplane with such on its stack
        As in `cqblend.bridge`.
    ... : the options of `BridgeOptions`
    report : callable, optional
        Is called with the `cqblend.BlendResult`: shape, faces of the bridge and certificate.

    Returns
    -------
    Workplane
        With the bridged solid on its stack.

    Raises
    ------
    CqblendError
        Whatever `cqblend.bridge` raises.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> plate = cadquery.Workplane().box(40, 10, 4).faces(">Z").workplane()
    >>> studs = plate.pushPoints([(-10, 0), (10, 0)]).circle(2).extrude(3)
    >>> left, right = studs.faces(">Z").vals()
    >>> studs.bridge(left, right).solids().size()
    1
    """
    options = collect_options(BridgeOptions, locals())
    from cqblend.api.solid_bridge import bridge_with_options

    check_callback("report", report, "the result")
    result = bridge_with_options(self, side1, side2, options)
    if report is not None:
        report(result)
    return self.newObject([result.shape])


@document_options(UnrollOptions)
def unroll(
    self: Any,
    tolerance: float,
    *,
    method: Method = UNROLL_DEFAULTS.method,
    direction: Direction = UNROLL_DEFAULTS.direction,
    layout: Layout = UNROLL_DEFAULTS.layout,
    strain: float = UNROLL_DEFAULTS.strain,
    developable: bool = UNROLL_DEFAULTS.developable,
    even: bool = UNROLL_DEFAULTS.even,
    least_width: float | None = None,
    flat_tolerance: float | None = None,
    progress: Callable[[float, str], object] | None = None,
    report: "Callable[[Pattern], object] | None" = None,
) -> Any:
    """Unroll the faces, shells or solids on the stack to planar faces on XY, for a cutter.

    Parameters
    ----------
    ... : the options of `UnrollOptions`
    progress : callable, optional
        Is called with the part of the work done, 0 to 1, and a word on what is next.
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
    options = collect_options(UnrollOptions, locals())
    from cqblend.api.flat_pattern import unroll_with_options

    check_callback("report", report, "the pattern")
    pattern = unroll_with_options(self, options, progress)
    if report is not None:
        report(pattern)
    return self.newObject(pattern.faces())


def register_methods(cadquery: ModuleType) -> None:
    """Set the methods ``blend``, ``bridge`` and ``unroll`` of ``cadquery.Workplane``, in place of any that it has."""
    cadquery.Workplane.blend = blend
    cadquery.Workplane.bridge = bridge
    cadquery.Workplane.unroll = unroll


class _RegisteringLoader(Loader):
    """Loads CadQuery by the loader that was found for it, which the module keeps, and registers the methods then."""

    def __init__(self, found: Loader) -> None:
        self.found = found

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self.found.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = self.found
        if module.__spec__ is not None:
            module.__spec__.loader = self.found
        self.found.exec_module(module)
        register_methods(module)


class _RegisteringFinder(MetaPathFinder):
    """Finds CadQuery by the finders behind this one on ``sys.meta_path``, and has the methods registered once loaded.

    It stays there, since an import may fail and be tried again, or CadQuery be reloaded. Where cqblend itself was
    reloaded, the finder of its newer copy stands in front, and registers last.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "cadquery":
            return None
        for finder in sys.meta_path[sys.meta_path.index(self) + 1 :]:
            spec = finder.find_spec(fullname, path, target)
            if spec is not None:
                if spec.loader is not None:  # as that of a folder without __init__.py, which is no CadQuery
                    spec.loader = _RegisteringLoader(spec.loader)
                return spec
        return None


def register_on_import() -> None:
    """Register the methods now if CadQuery is imported already, else as soon as it is."""
    if "cadquery" in sys.modules:
        register_methods(sys.modules["cadquery"])
    else:
        sys.meta_path.insert(0, _RegisteringFinder())
