"""Writes a pattern with all that is known of it as JSON, for other programs and for checking.

Drawings do not tell which run is joined to which, and where in space it is. Depends on sheets of placed pieces.
"""

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path as File
from typing import Any

import numpy as np

from cqblend.patterns.outline.pieces import Piece, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.sheets import Sheets

SCHEMA = "cqblend.pattern/1"
"""Name and version of the format, by which programs know it."""


def build_record(sheets: Sheets, report: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return a pattern as plain lists and dictionaries.

    Lengths are in mm, angles in rad, indices count from 0; what is not known is null::

        {"schema": "cqblend.pattern/1", "units": "mm",
         "sheet": {"size": [w, h], "count": n, "margin": m, "gap": g},
         "pieces": [{"name": .., "sheet": index, "area": mm^2,
                     "loops": [[{"kind": "rail" | "end" | "trim" | "cut", "seam": index | null, "length": mm,
                                 "path": PATH, "space": [[x, y, z], ..]}, ..], ..],
                     "tabs": [PATH, ..] | null,
                     "scores": [{"fold": "mountain" | "valley", "path": PATH}, ..]}, ..],
         "seams": [{"label": .., "sides": [{"piece": i, "loop": j, "run": k}, {..}], "opposed": bool,
                    "angle": rad | null, "length": mm}, ..],
         "report": {..} | null}

    where PATH is ``{"points": [[x, y], ..], "bulges": [..]}``, with one bulge less than points: the tangent of a
    quarter of each arc's angle, 0 for straight, positive to the left. The first loop is the outer one,
    counterclockwise; runs have the material to their left. "space" has the points of the vertices in space: on the
    strips, but those of vertices that come from cutting pieces to the size of sheets on the face. Numbers are exact:
    reading them gives the same doubles.
    """
    return {
        "schema": SCHEMA,
        "units": "mm",
        "sheet": {"size": list(sheets.size), "count": sheets.count, "margin": sheets.margin, "gap": sheets.gap},
        "pieces": [
            _encode_piece(piece, sheet) for piece, sheet in zip(sheets.pieces.pieces, sheets.numbers, strict=True)
        ],
        "seams": [_encode_seam(seam, sheets) for seam in sheets.pieces.seams],
        "report": None if report is None else _encode_value(report),
    }


def select_sheet(record: dict[str, Any], sheet: int) -> dict[str, Any]:
    """Return the part of a record (see :func:`build_record`) that is on one sheet, given by its index.

    Indices are those of the pieces and seams that are left. The side of a seam that is on another sheet has null as its
    piece, and the piece's name and the index of that sheet besides.
    """
    kept = [i for i, piece in enumerate(record["pieces"]) if piece["sheet"] == sheet]
    new_pieces = {i: k for k, i in enumerate(kept)}  # new indices by old ones
    seams = [i for i, seam in enumerate(record["seams"]) if any(side["piece"] in new_pieces for side in seam["sides"])]
    new_seams = {i: k for k, i in enumerate(seams)}

    def describe_side(side: dict[str, Any]) -> dict[str, Any]:
        piece = record["pieces"][side["piece"]]
        elsewhere = {} if side["piece"] in new_pieces else {"name": piece["name"], "sheet": piece["sheet"]}
        return {**side, "piece": new_pieces.get(side["piece"]), **elsewhere}

    pieces = [
        {**piece, "loops": [[{**run, "seam": new_seams.get(run["seam"])} for run in loop] for loop in piece["loops"]]}
        for piece in (record["pieces"][i] for i in kept)
    ]
    sided = [
        {**seam, "sides": [describe_side(side) for side in seam["sides"]]}
        for seam in (record["seams"][i] for i in seams)
    ]
    return {**record, "pieces": pieces, "seams": sided}


def write_json(record: Mapping[str, Any], path: File) -> None:
    """Write the record of a pattern, or of one sheet of it."""
    text = json.dumps(record, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    path.write_text(text + "\n", encoding="utf-8", newline="\n")


def _encode_piece(piece: Piece, sheet: int) -> dict[str, Any]:
    loops = [
        [
            {
                "kind": run.kind,
                "seam": run.seam,
                "length": run.path.length,
                "path": _encode_path(run.path),
                "space": run.space.tolist(),
            }
            for run in loop
        ]
        for loop in piece.loops
    ]
    return {
        "name": piece.name,
        "sheet": sheet,
        "area": piece.area,
        "loops": loops,
        "tabs": None if piece.tabs is None else [_encode_path(path) for path in piece.tabs],
        "scores": [{"fold": score.fold, "path": _encode_path(score.path)} for score in piece.scores],
    }


def _encode_seam(seam: Seam, sheets: Sheets) -> dict[str, Any]:
    return {
        "label": seam.label,
        "sides": [{"piece": side.piece, "loop": side.loop, "run": side.run} for side in seam.sides],
        "opposed": seam.opposed,
        "angle": _encode_value(seam.angle),
        "length": max(sheets.pieces.run(side).path.length for side in seam.sides),
    }


def _encode_path(path: Path) -> dict[str, Any]:
    return {"points": path.points.tolist(), "bulges": path.bulges.tolist()}


def _encode_value(value: Any) -> Any:
    """Return a value as JSON knows it: arrays as lists, numbers that are not finite as None."""
    if isinstance(value, Mapping):
        return {str(key): _encode_value(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _encode_value(value.tolist())
    if isinstance(value, list | tuple):
        return [_encode_value(one) for one in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value
