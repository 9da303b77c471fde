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
from cqblend.patterns.write.drawing import FIT, LABELS, Drawing, beside, draw, with_notes
from cqblend.patterns.write.dxf_file import write_dxf
from cqblend.patterns.write.json_file import on_sheet, record, write_json
from cqblend.patterns.write.pdf_file import Page, paper, write_pdf
from cqblend.patterns.write.svg_file import write_svg
from cqblend.whole_files import checked_target, written_beside

SUFFIXES = (".dxf", ".svg", ".pdf", ".json")


def export(
    sheets: Sheets,
    path: str | os.PathLike[str],
    *,
    kerf: float = 0.0,
    fit: float = FIT,
    height: float | None = LABELS,
    page: Page | None = "a4",
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
    target = checked_path(path)
    paper(page)
    drawings = () if _is_json(target) else draw(sheets, kerf=kerf, fit=fit, height=height)
    with _written([target]) as (whole,):
        if _is_json(target):
            write_json(record(sheets, report), whole)
        elif target.suffix.lower() == ".pdf":
            write_pdf(drawings, whole, page=page)
        else:
            _write_drawing(beside(drawings), whole)
    return target


def export_each(
    sheets: Sheets,
    path: str | os.PathLike[str],
    *,
    kerf: float = 0.0,
    fit: float = FIT,
    height: float | None = LABELS,
    page: Page | None = "a4",
    report: Mapping[str, Any] | None = None,
) -> tuple[File, ...]:
    """Write a file for every sheet, ``p-1.dxf`` and so on for ``p.dxf``, with nothing outside of the sheet.

    Parameters and errors are those of `export`. All files are whole, or none is replaced.
    """
    target = checked_path(path)
    paper(page)
    targets = [target.with_name(f"{target.stem}-{k + 1}{target.suffix}") for k in range(sheets.count)]
    drawings = () if _is_json(target) else draw(sheets, kerf=kerf, fit=fit, height=height)
    whole = record(sheets, report)
    with _written(targets) as files:
        for number, file in enumerate(files):
            if _is_json(target):
                write_json(on_sheet(whole, number), file)
            elif target.suffix.lower() == ".pdf":
                write_pdf(drawings[number : number + 1], file, page=page, inside=True)
            else:
                _write_drawing(with_notes(drawings[number]), file)
    return tuple(targets)


def _is_json(target: File) -> bool:
    return target.suffix.lower() == ".json"


def _write_drawing(drawing: Drawing, whole: File) -> None:
    (write_dxf if whole.suffix.lower() == ".dxf" else write_svg)(drawing, whole)


@contextmanager
def _written(targets: Sequence[File]) -> Iterator[list[File]]:
    """Give files to be written that take the places of others when all of them are whole."""
    try:
        with ExitStack() as stack:
            yield [stack.enter_context(written_beside(target)) for target in targets]
    except OSError as error:
        raise FileError(f"{targets[0]} cannot be written: {error.strerror or error}") from error


def checked_path(path: str | os.PathLike[str]) -> File:
    """Return the path of a file to be written.

    Raises
    ------
    InputError
        If its suffix is not known, its folder does not exist, or it is a folder.
    FileError
        If it is protected.
    """
    return checked_target(path, SUFFIXES, "patterns")
