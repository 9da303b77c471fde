"""Patterns for flat stock: ``cqblend.unroll``, and what it returns.

Takes shapes of the caller's library, checks the arguments, has `cqblend.patterns` divide, flatten and assemble, and
returns shapes of the same library, or files. Nothing is computed here.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cqblend.api.cad_shapes import collect_unroll_shapes, wrap_like
from cqblend.api.pattern_report import Report
from cqblend.argument_checks import (
    check_callback,
    check_choice,
    check_flag,
    check_millimetres,
    check_positive,
    is_default,
    refuse_ignored_options,
    to_float_array,
)
from cqblend.errors import InputError, SelectionError, UnrollError, shown
from cqblend.option_records import collect_options, document_options
from cqblend.patterns import unrolling
from cqblend.patterns.files import pattern_files
from cqblend.patterns.files.pdf_file import resolve_paper_size
from cqblend.patterns.outline.pieces import Piece, Pieces, Seam
from cqblend.patterns.stock import sheets, split_pieces
from cqblend.patterns.stock.stock_proportions import LABEL_LIMITS
from cqblend.patterns.stock.tab_options import TabOptions, TabStyle
from cqblend.patterns.stock.tabs import Tabs, fit_tabs
from cqblend.patterns.trimming.surface_shell import make_surface_shell
from cqblend.patterns.unroll_result import UnrollResult
from cqblend.splines.surface import Surface
from cqblend.unroll_options import UNROLL_DEFAULTS, Direction, Layout, Method, UnrollOptions

if TYPE_CHECKING:
    from os import PathLike
    from pathlib import Path as File

    from numpy.typing import ArrayLike

    from cqblend.splines.bernstein import Array

DEFAULT_TAPER = np.pi / 4
"""Angle between the legs of a tab and its base, rad."""

DEFAULT_PAGE = "a4"
"""Paper of a PDF."""

DEFAULT_PACKING_SECONDS = 30.0
"""Time for packing one sheet by spyrrow, s."""

SEWING_RATIO = 2.5
"""Quotient of the tolerance by which strips in space are sewn and the pattern's tolerance: at an edge of the shape, the
strips of both faces are up to one tolerance from it, and their borders are polygons."""


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Pieces of flat stock that make up a shape when they are rolled and joined.

    Attributes
    ----------
    pieces : Pieces
        The pieces and the seams between them.
    report : Report
        How far the strips and the pieces are from the shape. ``print`` it.
    tabs : Tabs or None
        Which tabs differ from those asked for: ``tabs.missing`` and ``tabs.narrowed`` name their seams. None if there
        are no tabs.
    """

    pieces: Pieces
    report: Report
    tabs: Tabs | None
    _unrolled: UnrollResult
    _host_shape: Any
    _tab_options: TabOptions | None = None

    @property
    def strips(self) -> tuple[Piece, ...]:
        """The pieces, in the order of the faces and of the strips on each."""
        return self.pieces.pieces

    @property
    def seams(self) -> tuple[Seam, ...]:
        """Pairs of outline runs that are joined to each other."""
        return self.pieces.seams

    def faces(self, *, tabs: bool = False) -> list[Any]:
        """Return the pieces as planar faces on XY, placed without overlap, in the library of the input.

        Parameters
        ----------
        tabs : bool
            Whether the tabs, if there are any, belong to them.
        """
        from cqblend.brep.conversion.pattern_shapes import make_planar_faces

        if check_flag("tabs", tabs) and self.tabs is None:
            raise InputError("the pattern has no tabs: make them by with_tabs, or leave tabs out")
        placed = sheets.arrange_pieces(self.pieces).pieces
        return [wrap_like(self._host_shape, face) for face in make_planar_faces(placed.pieces, tabs=tabs)]

    def strips_3d(self) -> Any:
        """Return the strips in space: ruled faces and planes, trimmed and sewn, in the library of the input."""
        from cqblend.brep.conversion.pattern_shapes import sew_strip_faces

        trims = [source.to_trimmed_surface() for source in self._unrolled.sources]
        return wrap_like(self._host_shape, sew_strip_faces(trims, SEWING_RATIO * self.report.tolerance))

    def cross_sections(self) -> list[Any]:
        """Return the formers over which strips are assembled: faces through their planar rails, wires through others.

        As in figure 3 of the paper. Where strips were trimmed, rails are whole.
        """
        from cqblend.brep.conversion.pattern_shapes import make_formers

        strips = (source.unrolled_strip for source in self._unrolled.sources)
        rails = [rail for strip in strips if strip is not None for rail in strip.rails]
        return [wrap_like(self._host_shape, former) for former in make_formers(rails)]

    def fold(self, strip: int, points: "ArrayLike") -> "Array":
        """Return where points of a flat piece are in space when it is rolled.

        Parameters
        ----------
        strip : int
            Index of the piece among `strips`, where it lies there.
        points : array_like
            (.., 2), mm.

        Returns
        -------
        array
            (.., 3), mm.

        Raises
        ------
        InputError
            There is no such piece, or these are no points.
        """
        sources = self._unrolled.sources
        if isinstance(strip, bool) or not isinstance(strip, int) or not 0 <= strip < len(sources):
            raise InputError(f"strip is an index from 0 to {len(sources) - 1}, not {shown(strip)}")
        flat = to_float_array("points", points)
        if flat.ndim == 0 or flat.shape[-1] != 2 or not np.isfinite(flat).all():
            raise InputError(f"points are pairs of finite coordinates, not {shown(points)}")
        return sources[strip].fold(flat)

    def with_tabs(
        self,
        width: float,
        *,
        style: TabStyle = "one",
        taper: float = DEFAULT_TAPER,
        pitch: float | None = None,
    ) -> "Pattern":
        """Return the pattern with tabs along its seams, by which pieces are glued, stitched or welded.

        The paper's stubs (section 3, figure 6). Tabs fold to the inner side of the shape, or lie beneath the neighbour;
        they overlap neither their piece nor each other; where there is no room they are lower, down to a quarter of the
        width or 2 mm, or left out, see `tabs`.

        Parameters
        ----------
        width : float
            Height of the tabs above the seam, mm.
        style : {"one", "alternating", "both", "strips", "allowance"}
            On one side of each seam; teeth by turns on either side; on both sides; separate strips that connect both
            pieces from below, without the stair that a tab makes; or a seam allowance all along.
        taper : float
            Angle between the legs of a tab and its base, rad.
        pitch : float, optional
            Length of the teeth that tabs are cut into where a seam is curved, mm.

        Raises
        ------
        InputError
            A number makes no sense, or there would be more than 20,000 teeth.
        """
        if is_default(style, "allowance"):
            refuse_ignored_options(
                "on an allowance, which has no teeth", taper=(taper, DEFAULT_TAPER), pitch=(pitch, None)
            )
        options = TabOptions(style=style, width=width, taper=taper, pitch=pitch)
        tabs = fit_tabs(self._unrolled.pieces, options)
        return replace(self, pieces=tabs.pieces, tabs=tabs, _tab_options=options)

    def export(
        self,
        path: "str | PathLike[str]",
        *,
        sheet: tuple[float, float] | None = None,
        margin: float = 5.0,
        gap: float = 3.0,
        kerf: float = 0.0,
        labels: float | None = LABEL_LIMITS.height,
        fit: float | None = None,
        page: str | tuple[float, float] | None = DEFAULT_PAGE,
        packer: Literal["grid", "spyrrow"] = "grid",
        seconds: float = DEFAULT_PACKING_SECONDS,
        per_sheet: bool = False,
    ) -> "File | tuple[File, ...]":
        """Write the pieces to a file for a cutter, in true size: DXF, SVG, PDF or JSON, by the suffix.

        Outlines are closed loops of lines and arcs, each once, on the layer CUT; fold lines are on SCORE_MOUNTAIN
        (dashed) and SCORE_VALLEY (dash-dotted), labels on ENGRAVE as single strokes, guides on GUIDE. Both sides of a
        seam have the same label.

        Parameters
        ----------
        path : path
            Ends with .dxf (R2010, mm), .svg (mm), .pdf (1:1, tiled over pages) or .json (everything there is).
        sheet : pair of float, optional
            Width and height of the stock, mm; pieces that are larger are cut, with a labelled seam. None is one sheet
            as large as it needs to be.
        margin, gap : float
            Kept free along the borders of a sheet and between pieces when the kerf is gone, mm.
        kerf : float
            Width of what the cutter takes away, mm; cuts are moved outwards by half of it, and GUIDE has the outlines
            themselves.
        labels : float, optional
            Height of the labels, mm; None writes none.
        fit : float, optional
            How far arcs that replace many short segments may be from them, mm; by default a tenth of the flattening's
            tolerance. 0 keeps all segments.
        page : {"a4", "a3", "letter", ...} or pair of float, optional
            Paper of the PDF, tiled with registration crosses; None makes a page of each sheet.
        packer : {"grid", "spyrrow"}
            How pieces are placed; spyrrow is an optional extra, ``pip install cqblend[nesting]``.
        seconds : float
            Time for spyrrow, for each sheet.
        per_sheet : bool
            Whether every sheet has a file of its own: ``p-1.dxf``, ``p-2.dxf`` and so on instead of ``p.dxf``. Nothing
            is outside of the sheet there: labels without room on their pieces are written where the sheet is free, and
            a PDF whose ``page`` is None has its legend there.

        Returns
        -------
        pathlib.Path, or tuple of pathlib.Path
            The file, which replaces what was there only when it is whole; the files, if each sheet has one.

        Raises
        ------
        InputError
            The suffix is another one, the folder does not exist, or a number makes no sense.
        SizeError
            A piece cannot be cut so that it fits the sheet, or has a slit or a hole narrower than the kerf.
        """
        target = pattern_files.check_pattern_path(path)
        suffix = target.suffix.lower()
        if suffix != ".pdf":
            refuse_ignored_options(f"on {suffix}, which has no pages", page=(page, DEFAULT_PAGE))
        if suffix == ".json":
            refuse_ignored_options(
                "on .json, which has the pieces themselves", labels=(labels, LABEL_LIMITS.height), fit=(fit, None)
            )
        if is_default(packer, "grid"):
            refuse_ignored_options('on packer="grid"', seconds=(seconds, DEFAULT_PACKING_SECONDS))
        resolve_paper_size(page)
        check_positive("seconds", seconds)
        packer = check_choice("packer", packer, ("grid", "spyrrow"))
        if sheet is not None:
            sheet = sheets.check_sheet_size(sheet)
        labels = None if labels is None else check_millimetres("the height of labels", labels)
        fit = self.report.flat / 10 if fit is None else check_millimetres("the fit of arcs", fit, zero=True)
        check_flag("per_sheet", per_sheet)
        kerf = check_millimetres("the kerf", kerf, zero=True)
        margin = check_millimetres("the margin of a sheet", margin, zero=True) + kerf / 2
        gap = check_millimetres("the gap between pieces", gap, zero=True) + kerf
        pieces = self.pieces if sheet is None else self._split_to_sheet(sheet, margin)
        placed = sheets.arrange_pieces(pieces, sheet, margin=margin, gap=gap, packer=packer, seconds=seconds)
        write = pattern_files.export_each_sheet if per_sheet else pattern_files.export_sheets
        options = pattern_files.ExportOptions(
            kerf=kerf, arc_tolerance=fit, label_height=labels, page=page, report=asdict(self.report)
        )
        return write(placed, target, options)

    def _split_to_sheet(self, sheet: tuple[float, float], margin: float) -> Pieces:
        """Return the pieces, cut to the size of a sheet before they get their tabs."""
        inner = sheets.subtract_margins(sheet, margin + (self.tabs.width if self.tabs else 0.0))
        sources = self._unrolled.sources
        bare = split_pieces.split_to_fit(
            self._unrolled.pieces, inner, lambda piece, points: sources[piece].map_to_face(points)
        )
        return fit_tabs(bare, self._tab_options).pieces if self._tab_options else bare


def _check_rulings_paired(unrolled: UnrollResult) -> None:
    """Raise InputError if strips twist, and the rulings of none could be paired anew."""
    twisted = sum(record.kind == "twisted" for record in unrolled.records)
    strips = (source.unrolled_strip for source in unrolled.sources)
    if twisted and all(strip is None or strip.original_parameters is None for strip in strips):
        raise InputError(
            f"developable has no effect: none of {twisted} twisted strips has a pairing of rulings that is developable "
            "and keeps it within the tolerance; leave developable out, or try the other direction or another tolerance"
        )


@document_options(UnrollOptions)
def unroll(
    shape: Any,
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
) -> Pattern:
    """Unroll faces to pieces of flat stock: freeform ones as strips, planes, cylinders and cones in one piece each.

    After Elber, Model fabrication using surface layout projection (1995).

    Parameters
    ----------
    shape : a shape, faces, a Workplane, or Surface
        A solid, shell, compound or face, several of them, a Workplane with those on its stack, or a symbolic surface.
        Neighbouring faces of one plane become one piece. Faces that touch within `flat_tolerance` without sharing edges
        are joined.
    ... : the options of `UnrollOptions`
    progress : callable, optional
        Is called with the part of the work done, 0 to 1, and a word on what is next.

    Returns
    -------
    Pattern
        Pieces, seams and report.

    Raises
    ------
    InputError
        An argument is of the wrong type or out of range, has no effect beside another one, or nothing is selected.
    TopologyError
        More than two faces meet at an edge.
    UnrollError
        Some faces could not be done; it has the pattern of the others.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> pattern = cqblend.unroll(cadquery.Solid.makeCone(3, 1, 4), 0.01)
    >>> len(pattern.strips), pattern.report.seam_mismatch < 1e-9
    (3, True)
    """
    return unroll_with_options(shape, collect_options(UnrollOptions, locals()), progress)


def unroll_with_options(
    shape: Any, options: UnrollOptions, progress: Callable[[float, str], object] | None = None
) -> Pattern:
    """Do what :func:`unroll` does, with the options in a record."""
    options = options.check()
    check_callback("progress", progress, "two arguments")
    if isinstance(shape, Surface):
        import cadquery

        host_shape, shell = cadquery.Compound.makeCompound([]), make_surface_shell(shape)
    else:
        from cqblend.brep.conversion.patch_reading import read_patches

        given = collect_unroll_shapes(shape)
        host_shape = given.model
        try:
            shell = read_patches(given.shapes, numbered_shape=given.solid, sewing_tolerance=options.flat)
        except SelectionError:  # the faces are not those of the solid in the chain
            shell = read_patches(given.shapes, sewing_tolerance=options.flat)
    unrolled = unrolling.unroll_patches(shell, options, progress)
    if options.developable:
        _check_rulings_paired(unrolled)
    pattern = Pattern(unrolled.pieces, Report.from_unroll_result(unrolled, options), None, unrolled, host_shape)
    if unrolled.failures:
        reasons = "; ".join(str(failure.error) for failure in unrolled.failures)
        some = pattern if pattern.strips else None
        raise UnrollError(
            f"{len(unrolled.failures)} of the faces cannot be unrolled: {reasons}", some, unrolled.failures
        )
    return pattern
