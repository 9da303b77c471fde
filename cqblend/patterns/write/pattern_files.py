"""Patterns to files: the suffix says which writer, and a file is there only when it is whole.

Exists so that every format gets the same drawings, and so that a failure leaves what was there before. Must not know
what a format looks like inside.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path as File
from typing import Any

from cqblend.errors import FileError
from cqblend.patterns.stock.sheets import Sheets
from cqblend.patterns.write.drawing import (
    ARC_FIT_TOLERANCE,
    LABEL_HEIGHT,
    Drawing,
    draw_sheets,
    join_drawings,
    write_notes,
)
from cqblend.patterns.write.dxf_file import write_dxf
from cqblend.patterns.write.json_file import build_record, select_sheet, write_json
from cqblend.patterns.write.pdf_file import PaperFormat, resolve_paper_size, write_pdf
from cqblend.patterns.write.svg_file import write_svg
from cqblend.whole_files import check_target, write_atomically

SUFFIXES = (".dxf", ".svg", ".pdf", ".json")


def export_sheets(
    sheets: Sheets,
    path: str | os.PathLike[str],
    *,
    kerf: float = 0.0,
    fit: float = ARC_FIT_TOLERANCE,
    height: float | None = LABEL_HEIGHT,
    page: PaperFormat | None = "a4",
    report: Mapping[str, Any] | None = None,
) -> File:
    """Write sheets as DXF, SVG, PDF or JSON, in true size.

    Parameters
    ----------
    sheets
        Pieces at their places.
    path
        Ends with .dxf, .svg (several sheets beside each other, in frames), .pdf (pages) or .json (everything).
    kerf, fit, height
        As `draw` takes them; JSON has the pieces themselves.
    page
        Paper of the PDF, as `write_pdf` takes it.
    report
        Figures to be told in the JSON.

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
    target = check_pattern_path(path)
    resolve_paper_size(page)
    drawings = () if _is_json(target) else draw_sheets(sheets, kerf=kerf, fit=fit, height=height)
    with _replace_when_whole([target]) as (whole,):
        if _is_json(target):
            write_json(build_record(sheets, report), whole)
        elif target.suffix.lower() == ".pdf":
            write_pdf(drawings, whole, page=page)
        else:
            _write_drawing(join_drawings(drawings), whole)
    return target


def export_each_sheet(
    sheets: Sheets,
    path: str | os.PathLike[str],
    *,
    kerf: float = 0.0,
    fit: float = ARC_FIT_TOLERANCE,
    height: float | None = LABEL_HEIGHT,
    page: PaperFormat | None = "a4",
    report: Mapping[str, Any] | None = None,
) -> tuple[File, ...]:
    """Write a file for every sheet, ``p-1.dxf`` and so on for ``p.dxf``, with nothing outside of the sheet.

    Parameters and errors are those of `export`. All files are whole, or none is replaced.
    """
    target = check_pattern_path(path)
    resolve_paper_size(page)
    targets = [target.with_name(f"{target.stem}-{k + 1}{target.suffix}") for k in range(sheets.count)]
    drawings = () if _is_json(target) else draw_sheets(sheets, kerf=kerf, fit=fit, height=height)
    whole = build_record(sheets, report)
    with _replace_when_whole(targets) as files:
        for number, file in enumerate(files):
            if _is_json(target):
                write_json(select_sheet(whole, number), file)
            elif target.suffix.lower() == ".pdf":
                write_pdf(drawings[number : number + 1], file, page=page, inside=True)
            else:
                _write_drawing(write_notes(drawings[number]), file)
    return tuple(targets)


def _is_json(target: File) -> bool:
    return target.suffix.lower() == ".json"


def _write_drawing(drawing: Drawing, whole: File) -> None:
    (write_dxf if whole.suffix.lower() == ".dxf" else write_svg)(drawing, whole)


@contextmanager
def _replace_when_whole(targets: Sequence[File]) -> Iterator[list[File]]:
    """Give files to be written that take the places of others when all of them are whole."""
    try:
        with ExitStack() as stack:
            yield [stack.enter_context(write_atomically(target)) for target in targets]
    except OSError as error:
        raise FileError(f"{targets[0]} cannot be written: {error.strerror or error}") from error


def check_pattern_path(path: str | os.PathLike[str]) -> File:
    """Return the path of a file to be written.

    Raises
    ------
    InputError
        If its suffix is not known, its folder does not exist, or it is a folder.
    FileError
        If it is protected.
    """
    return check_target(path, SUFFIXES, "patterns")
