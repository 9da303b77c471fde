"""Packs polygons on sheets by spyrrow, an optional library that packs closer than the grid.

It runs in a process of its own, which ends when its time is up: its solver has native threads that nothing in this
process can stop. Depends on nothing else in patterns but limits.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from math import isfinite
from pathlib import Path as File
from typing import Any

import numpy as np
import shapely

from cqblend.errors import GeometryError, InputError, InstallationError, shown
from cqblend.patterns.stock.sheet_placement import Placement, SheetSize
from cqblend.patterns.stock.stock_proportions import PACKING_LIMITS

WORKER = File(__file__).with_name("spyrrow_worker.py")
"""The script that runs in the other process."""


def pack_with_spyrrow(
    polygons: Sequence[Any], turns: Sequence[float], usable: SheetSize | None, gap: float, seconds: float
) -> list[Placement]:
    """Return the placements of polygons, packed as closely as spyrrow can in the time for each sheet.

    Spyrrow packs strips of a given height and any width: polygons within the width of a sheet stay on it, the others
    are packed again for the next one.

    Parameters
    ----------
    polygons
        Of shapely.
    turns
        Angle (rad) by which each is turned to fit the sheet; quarters of a turn more are tried.
    usable
        Width and height of the sheets within their margins, mm; None is one sheet, about as wide as high.
    gap
        Between polygons, mm.
    seconds
        For each sheet.

    Returns
    -------
    list of Placement
        In the order of the polygons.

    Raises
    ------
    InputError
        If the time is not a positive number.
    InstallationError
        If spyrrow is not installed.
    GeometryError
        If it fails, or finds no place for a polygon.
    """
    if not isinstance(seconds, (int, float)) or not isfinite(seconds) or seconds <= 0:
        raise InputError(f"the time for packing is a positive number of seconds, not {shown(seconds)}")
    if find_spec("spyrrow") is None:
        raise InstallationError('packing by spyrrow needs it: pip install "cqblend[nesting]", or packer="grid"')
    growth = gap / 2 + PACKING_LIMITS.outline_tolerance
    grown = [
        _grow_polygon(_rotate_polygon(polygon, turn), growth) for polygon, turn in zip(polygons, turns, strict=True)
    ]
    low, high = np.reshape([shape.bounds for shape in grown], (-1, 2, 2)).swapaxes(0, 1)
    extents = high - low
    if usable is None:
        size = np.array([np.inf, max(extents.max(), np.sqrt(1.2 * sum(shape.area for shape in grown)))])
    else:
        size = np.array(usable) + 2 * growth
    items = [
        {
            "shape": shapely.get_coordinates(shape.exterior)[:-1].tolist(),
            "angles": [0, 90, 180, 270] if (extent[::-1] <= size).all() else [0, 180],
        }
        for shape, extent in zip(grown, extents, strict=True)
    ]
    placed: dict[int, Placement] = {}
    sheet = 0
    while remaining := [k for k in range(len(grown)) if k not in placed]:
        found = _run_worker([items[k] for k in remaining], float(size[1]), seconds)
        count = len(placed)
        for k, (degrees, *shift) in zip(remaining, found, strict=True):
            turn = np.deg2rad(degrees)
            right = _rotate_polygon(grown[k], turn).bounds[2] + shift[0]
            if right <= size[0] + PACKING_LIMITS.outline_tolerance / 2:
                placed[k] = Placement(sheet, turns[k] + turn, np.array(shift) - growth)
        if len(placed) == count:
            raise GeometryError(
                f"spyrrow puts none of {len(remaining)} pieces on a sheet within {seconds:g} s: allow more"
            )
        sheet += 1
    return [placed[k] for k in range(len(grown))]


def _rotate_polygon(polygon: Any, turn: float) -> Any:
    cos, sin = np.cos(turn), np.sin(turn)
    return shapely.transform(polygon, lambda points: points @ np.array([[cos, sin], [-sin, cos]]))


def _grow_polygon(polygon: Any, distance: float) -> Any:
    """Return one polygon without holes that holds all points within a distance of a polygon."""
    simple = shapely.simplify(polygon, PACKING_LIMITS.outline_tolerance)
    wide = shapely.buffer(simple, distance, join_style="mitre", mitre_limit=2.0)
    return shapely.Polygon(wide.exterior) if wide.geom_type == "Polygon" else shapely.convex_hull(wide)


def _run_worker(items: list[dict[str, Any]], height: float, seconds: float) -> list[list[float]]:
    """Return [degrees, x, y] of each item from the worker process: angle about the origin, then shift."""
    task = json.dumps({"height": height, "seconds": max(round(seconds), 1), "items": items})
    try:
        done = subprocess.run(  # noqa: S603  (our own file)
            [sys.executable, "-P", str(WORKER)],
            input=task,
            capture_output=True,
            text=True,
            timeout=seconds + PACKING_LIMITS.grace_seconds,
            check=True,
        )
    except subprocess.TimeoutExpired:
        raise GeometryError(
            f'spyrrow did not end {PACKING_LIMITS.grace_seconds:g} s after its time was up: take packer="grid"'
        ) from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["no message"])[-1]
        raise GeometryError(f'spyrrow failed ({last}): take packer="grid"') from None
    return json.loads(done.stdout)
