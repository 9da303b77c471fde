"""Writes sheets to files: the suffix chooses the format, and a file takes its place only when it is whole.

Every format gets the same drawings, and a failure leaves the file that was there before.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from cqblend.atomic_files import check_target, write_atomically
from cqblend.errors import FileError
from cqblend.patterns.files.drawing import Drawing, draw_sheets, join_drawings, write_notes
from cqblend.patterns.files.dxf_file import write_dxf
from cqblend.patterns.files.json_file import build_record, select_sheet, write_json
from cqblend.patterns.files.page_dimensions import DRAWING_LAYOUT
from cqblend.patterns.files.pdf_file import PaperFormat, resolve_paper_size, write_pdf
from cqblend.patterns.files.svg_file import write_svg
from cqblend.patterns.stock.sheets import Sheets
from cqblend.patterns.stock.stock_proportions import LABEL_LIMITS

PATTERN_SUFFIXES = (".dxf", ".svg", ".pdf", ".json")
"""Of the files that patterns are written to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """How sheets are written.

    Attributes
    ----------
    kerf, arc_tolerance, label_height
        See :func:`cqblend.patterns.files.drawing.draw_sheets`; JSON has the pieces themselves.
    page
        Paper of the PDF, see :func:`cqblend.patterns.files.pdf_file.write_pdf`.
    report
        Figures to be written to the JSON.
    """

    kerf: float = 0.0
    arc_tolerance: float = DRAWING_LAYOUT.arc_tolerance
    label_height: float | None = LABEL_LIMITS.height
    page: PaperFormat | None = "a4"
    report: Mapping[str, Any] | None = None


def export_sheets(sheets: Sheets, path: str | os.PathLike[str], options: ExportOptions | None = None) -> File:
    """Write sheets as DXF, SVG, PDF or JSON, in true size.

    Parameters
    ----------
    sheets
        Pieces at their places.
    path
        Ends with .dxf, .svg (several sheets beside each other, in frames), .pdf (pages) or .json (everything).
    options
        Defaults of :class:`ExportOptions` if None.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    InputError
        If the suffix is another one, the folder does not exist, or a number makes no sense.
    FileError
        If the file cannot be written.
    """
    options = options or ExportOptions()
    target = check_pattern_path(path)
    drawings = _draw_for(target, sheets, options)
    with _replace_when_whole([target]) as (file,):
        if _is_json(target):
            write_json(build_record(sheets, options.report), file)
        elif target.suffix.lower() == ".pdf":
            write_pdf(drawings, file, page=options.page)
        else:
            _write_drawing(join_drawings(drawings), file)
    return target


def export_each_sheet(
    sheets: Sheets, path: str | os.PathLike[str], options: ExportOptions | None = None
) -> tuple[File, ...]:
    """Write a file for every sheet, ``p-1.dxf`` and so on for ``p.dxf``, with nothing outside of the sheet.

    Parameters and errors are those of :func:`export_sheets`. Either all files are replaced, or none is.
    """
    options = options or ExportOptions()
    target = check_pattern_path(path)
    targets = [target.with_name(f"{target.stem}-{k + 1}{target.suffix}") for k in range(sheets.count)]
    drawings = _draw_for(target, sheets, options)
    record = build_record(sheets, options.report)
    with _replace_when_whole(targets) as files:
        for number, file in enumerate(files):
            if _is_json(target):
                write_json(select_sheet(record, number), file)
            elif target.suffix.lower() == ".pdf":
                write_pdf(drawings[number : number + 1], file, page=options.page, page_is_sheet=True)
            else:
                _write_drawing(write_notes(drawings[number]), file)
    return tuple(targets)


def _is_json(target: File) -> bool:
    return target.suffix.lower() == ".json"


def _draw_for(target: File, sheets: Sheets, options: ExportOptions) -> tuple[Drawing, ...]:
    """Return the drawings of sheets for a file, none for JSON, when the paper is known to exist."""
    resolve_paper_size(options.page)
    if _is_json(target):
        return ()
    return draw_sheets(
        sheets, kerf=options.kerf, arc_tolerance=options.arc_tolerance, label_height=options.label_height
    )


def _write_drawing(drawing: Drawing, file: File) -> None:
    (write_dxf if file.suffix.lower() == ".dxf" else write_svg)(drawing, file)


@contextmanager
def _replace_when_whole(targets: Sequence[File]) -> Iterator[list[File]]:
    """Yield paths of temporary files, which replace the targets when all of them are written."""
    try:
        with ExitStack() as stack:
            yield [stack.enter_context(write_atomically(target)) for target in targets]
    except OSError as error:
        raise FileError(f"{targets[0]} cannot be written: {error.strerror or error}") from error


def check_pattern_path(path: str | os.PathLike[str]) -> File:
    """Return the path of a pattern file that can be written, as far as can be known before.

    Raises
    ------
    InputError
        If its suffix is not known, its folder does not exist, or it is a folder.
    FileError
        If it is protected.
    """
    return check_target(path, PATTERN_SUFFIXES, "patterns")
