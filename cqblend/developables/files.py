"""Patterns to files: the suffix says which writer, and a file is there only when it is whole.

Exists so that every format gets the same drawings, and so that a failure leaves what was there before. Must not know
what a format looks like inside.
"""

import os
from collections.abc import Mapping
from pathlib import Path as File
from typing import Any

from cqblend.developables.drawing import FIT, LABELS, beside, draw
from cqblend.developables.dxf import write_dxf
from cqblend.developables.pdf import Page, paper, write_pdf
from cqblend.developables.record import write_json
from cqblend.developables.sheets import Sheets
from cqblend.developables.svg import write_svg
from cqblend.developables.writing import checked_target, written_beside
from cqblend.errors import FileError

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
    suffix = target.suffix.lower()
    paper(page)
    drawings = () if suffix == ".json" else draw(sheets, kerf=kerf, fit=fit, height=height)
    try:
        with written_beside(target) as whole:
            if suffix == ".dxf":
                write_dxf(beside(drawings), whole)
            elif suffix == ".svg":
                write_svg(beside(drawings), whole)
            elif suffix == ".pdf":
                write_pdf(drawings, whole, page=page)
            else:
                write_json(sheets, whole, report)
    except OSError as error:
        raise FileError(f"{target} cannot be written: {error.strerror or error}") from error
    return target


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
