"""Patterns for flat stock: ``cqblend.unroll``, and what it returns.

Thin: takes shapes of the caller's library, checks the arguments, has the core divide, flatten and assemble, and gives
back shapes of the same library, or files. Must not compute anything.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from cqblend.api.host_shapes import collect_unroll_shapes, wrap_like
from cqblend.api.pattern_report import Report
from cqblend.blend_options import (
    check_callback,
    check_choice,
    check_flag,
    check_positive,
    is_default,
    refuse_ignored_options,
)
from cqblend.errors import InputError, SelectionError, UnrollError, shown
from cqblend.patterns import assembly
from cqblend.patterns.assembly import UnrollResult
from cqblend.patterns.checks import check_millimetres
from cqblend.patterns.flatten.flat_face import UnrollOptions
from cqblend.patterns.flatten.flat_strip import Layout
from cqblend.patterns.outline.pieces import Piece, Pieces, Seam
from cqblend.patterns.stock import sheets, split_pieces
from cqblend.patterns.stock.tabs import Tabs, TabStyle, fit_tabs
from cqblend.patterns.strips.division import Direction, Method
from cqblend.patterns.trim.bare_surface import make_surface_shell
from cqblend.patterns.write import pattern_files
from cqblend.patterns.write.drawing import LABEL_HEIGHT
from cqblend.patterns.write.pdf_file import resolve_paper_size
from cqblend.splines import knots as door
from cqblend.splines.surface import Surface

if TYPE_CHECKING:
    from os import PathLike
    from pathlib import Path as File

    from numpy.typing import ArrayLike

    from cqblend.splines.bernstein import Array

FLAT_TOLERANCE_RATIO = 10.0
"""By how much flattening is finer than the strips, unless told otherwise: it costs vertices only, no pieces."""

DEFAULT_TAPER, DEFAULT_PAGE, DEFAULT_PACKING_SECONDS = np.pi / 4, "a4", 30.0
"""Of tabs, rad; of the PDF; for packing, s: unless told otherwise."""

DEFAULT_STRAIN = 0.01
"""What paper, leather and thin metal take."""

_SEWING_RATIO = 2.5
"""Strips on both sides of an edge are as far from it as the tolerance allows, and their borders are polygons."""


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """Pieces of flat stock that make up a shape when they are rolled and joined.

    Attributes
    ----------
    pieces : Pieces
        The pieces and the seams between them.
    report : Report
        How far all this is from the shape. ``print`` it.
    tabs : Tabs or None
        How far the tabs are what was asked for; ``tabs.missing`` and ``tabs.narrowed`` name seams.
    """

    pieces: Pieces
    report: Report
    tabs: Tabs | None
    _unrolled: UnrollResult
    _model: Any
    _fit: Callable[[Pieces], Tabs] | None = None

    @property
    def strips(self) -> tuple[Piece, ...]:
        """The pieces, in the order of the faces and of the strips on each."""
        return self.pieces.pieces

    @property
    def seams(self) -> tuple[Seam, ...]:
        """Which run of which piece is joined to which."""
        return self.pieces.seams

    def faces(self, *, tabs: bool = False) -> list[Any]:
        """Return the pieces as planar faces on XY, placed without overlap, in the library of the input.

        Parameters
        ----------
        tabs : bool
            Whether the tabs, if there are any, belong to them.
        """
        from cqblend.brep.pattern_shapes import make_planar_faces

        if check_flag("tabs", tabs) and self.tabs is None:
            raise InputError("the pattern has no tabs: make them by with_tabs, or leave tabs out")
        placed = sheets.arrange_pieces(self.pieces).pieces
        return [wrap_like(self._model, face) for face in make_planar_faces(placed.pieces, tabs=tabs)]

    def strips_3d(self) -> Any:
        """Return the strips in space: ruled faces and planes, trimmed and sewn, in the library of the input."""
        from cqblend.brep.pattern_shapes import sew_strip_faces

        trims = [source.to_trimmed_surface() for source in self._unrolled.sources]
        return wrap_like(self._model, sew_strip_faces(trims, _SEWING_RATIO * self.report.tolerance))

    def cross_sections(self) -> list[Any]:
        """Return the formers over which strips are assembled: faces through their planar rails, wires through others.

        As in figure 3 of the paper. Where strips were trimmed, rails are whole.
        """
        from cqblend.brep.pattern_shapes import make_formers

        rails = [rail for source in self._unrolled.sources if source.laying for rail in source.laying.rails]
        return [wrap_like(self._model, former) for former in make_formers(rails)]

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
        flat = door.to_float_array("points", points)
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
        fit = partial(fit_tabs, style=style, width=width, taper=taper, pitch=pitch)
        tabs = fit(self._unrolled.pieces)
        return replace(self, pieces=tabs.pieces, tabs=tabs, _fit=fit)

    def export(
        self,
        path: "str | PathLike[str]",
        *,
        sheet: tuple[float, float] | None = None,
        margin: float = 5.0,
        gap: float = 3.0,
        kerf: float = 0.0,
        labels: float | None = LABEL_HEIGHT,
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
                "on .json, which has the pieces themselves", labels=(labels, LABEL_HEIGHT), fit=(fit, None)
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
        return write(
            placed,
            target,
            kerf=kerf,
            fit=fit,
            height=labels,
            page=page,
            report=asdict(self.report),
        )

    def _split_to_sheet(self, sheet: tuple[float, float], margin: float) -> Pieces:
        """Return the pieces, cut to the size of a sheet before they get their tabs."""
        inner = sheets.subtract_margins(sheet, margin + (self.tabs.width if self.tabs else 0.0))
        sources = self._unrolled.sources
        bare = split_pieces.split_to_fit(
            self._unrolled.pieces, inner, lambda piece, points: sources[piece].map_to_face(points)
        )
        return self._fit(bare).pieces if self._fit else bare


def _check_rulings_paired(unrolled: UnrollResult) -> None:
    """Raise InputError if strips twist, and the rulings of none could be paired anew."""
    twisted = sum(record.kind == "twisted" for record in unrolled.records)
    if twisted and all(one.laying is None or one.laying.parameters is None for one in unrolled.sources):
        raise InputError(
            f"developable has no effect: none of {twisted} twisted strips has a pairing of rulings that is developable "
            "and keeps it within the tolerance; leave developable out, or try the other direction or another tolerance"
        )


def unroll(
    shape: Any,
    tolerance: float,
    *,
    method: Method = "longest",
    direction: Direction = "auto",
    layout: Layout = "smooth",
    strain: float = DEFAULT_STRAIN,
    developable: bool = False,
    even: bool = False,
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
    tolerance : float
        Largest distance between the shape and the strips, both ways, mm.
    method : {"longest", "elber", "curvature"}
        How freeform faces are divided: longest strip first against a certified bound; by the paper's algorithm 1; or at
        the ridges of the normal curvature first (equations 5 to 7).
    direction : {"auto", "rings", "u", "v"}
        Parameter that the rulings run along: the one with fewer strips, or with less strain if both take as many; the
        one that makes rings of a closed face; or a given one. Where the first way fails, ``"auto"`` tries the other
        one, then narrower strips, then triangles; see ``report.detours``.
    layout : {"smooth", "triangles"}
        How strips are laid flat: so that rails and rulings keep their lengths, or as the paper's triangles along one
        diagonal. Triangles keep chords, so seams between different faces match to `flat_tolerance` only.
    strain : float
        By how much lengths inside a strip may change when it is laid flat, relative: a strip that twists is made
        narrower until they do not. Not with ``method="elber"``, which is the paper's.
    developable : bool
        Whether rulings of twisted strips are paired anew, so that the strips are truly developable, wherever such a
        pairing exists within the tolerance; it is an error if there is none. Not with ``method="elber"`` or
        ``layout="triangles"``.
    even : bool
        Whether the strips of a face share its error evenly, instead of leaving the rest to the last one. Not with
        ``method="elber"``.
    least_width : float, optional
        Mm; pieces that are thinner, measured by twice their area over the length of their outlines, are merged into a
        neighbour of the same face where that keeps the tolerance; ``report.unmerged`` names those that could not be. A
        face of which no piece can be that wide is refused.
    flat_tolerance : float, optional
        Largest distance between strips in space and flat pieces rolled, mm; by default a tenth of `tolerance`.
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
    allowed = check_positive("tolerance", tolerance)
    wishes = UnrollOptions(
        tolerance=allowed,
        flat=allowed / FLAT_TOLERANCE_RATIO
        if flat_tolerance is None
        else check_positive("flat_tolerance", flat_tolerance),
        method=check_choice("method", method, get_args(Method)),
        direction=check_choice("direction", direction, get_args(Direction)),
        strain=check_positive("strain", strain),
        layout=check_choice("layout", layout, get_args(Layout)),
        developable=check_flag("developable", developable),
        even=check_flag("even", even),
        least_width=None if least_width is None else check_positive("least_width", least_width),
    )
    check_callback("progress", progress, "two arguments")
    if wishes.method == "elber":
        refuse_ignored_options(
            'on method="elber", which is the paper\'s',
            even=(even, False),
            developable=(developable, False),
            strain=(strain, DEFAULT_STRAIN),
        )
    if wishes.layout == "triangles":
        refuse_ignored_options('on layout="triangles", which is flat along diagonals', developable=(developable, False))
    if isinstance(shape, Surface):
        import cadquery

        model, skin = cadquery.Compound.makeCompound([]), make_surface_shell(shape)
    else:
        from cqblend.brep.read.trimmed_patches import read_patches

        model, parts, whole = collect_unroll_shapes(shape)
        try:
            skin = read_patches(parts, numbered_shape=whole, sewing_tolerance=wishes.flat)
        except SelectionError:  # the solid in the chain is another one
            skin = read_patches(parts, sewing_tolerance=wishes.flat)
    unrolled = assembly.unroll_patches(skin, wishes, progress)
    if developable:
        _check_rulings_paired(unrolled)
    pattern = Pattern(unrolled.pieces, Report.from_unroll_result(unrolled, wishes), None, unrolled, model)
    if unrolled.failures:
        reasons = "; ".join(str(failure.error) for failure in unrolled.failures)
        some = pattern if pattern.strips else None
        raise UnrollError(
            f"{len(unrolled.failures)} of the faces cannot be unrolled: {reasons}", some, unrolled.failures
        )
    return pattern
