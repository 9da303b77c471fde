"""Closer packing by spyrrow, an optional library, in a process of its own that ends when its time is up.

Exists apart because its solver runs in native threads that nothing in this process can stop. Must not know pieces.
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
from cqblend.splines.bernstein import Array

GRACE_SECONDS = 30.0
"""How much longer than asked for the process may take to start and to end, s."""

OUTLINE_TOLERANCE = 0.02
"""Outlines are simplified to this tolerance and blown up by as much, mm."""

WORKER = File(__file__).with_name("nesting_worker.py")


def pack_with_spyrrow(
    polygons: Sequence[Any], turns: Sequence[float], inner: tuple[float, float] | None, gap: float, seconds: float
) -> list[tuple[int, float, Array]]:
    """Return sheet, turn and shift of polygons, packed as closely as spyrrow can in the time for each sheet.

    It packs strips of a given height and any width: what lies on the sheet stays, the rest goes on to the next one.

    Parameters
    ----------
    polygons
        Of shapely.
    turns
        Angle (rad) by which each is turned to fit the sheet; quarters of a turn more are tried.
    inner
        Width and height of the sheets within their margins, mm; None is one sheet, about as wide as high.
    gap
        Between polygons, mm.
    seconds
        For each sheet.

    Returns
    -------
    list of (int, float, Array)
        Sheet, angle (rad) about the origin, and shift (2,) after it, from the lower left corner within the margins.

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
    around = gap / 2 + OUTLINE_TOLERANCE
    blown = [
        _inflate_polygon(_rotate_polygon(polygon, turn), around) for polygon, turn in zip(polygons, turns, strict=True)
    ]
    low, high = np.reshape([shape.bounds for shape in blown], (-1, 2, 2)).swapaxes(0, 1)
    extents = high - low
    if inner is None:
        size = np.array([np.inf, max(extents.max(), np.sqrt(1.2 * sum(shape.area for shape in blown)))])
    else:
        size = np.array(inner) + 2 * around
    items = [
        {
            "shape": shapely.get_coordinates(shape.exterior)[:-1].tolist(),
            "angles": [0, 90, 180, 270] if (extent[::-1] <= size).all() else [0, 180],
        }
        for shape, extent in zip(blown, extents, strict=True)
    ]
    placed: list[tuple[int, float, Array]] = [(0, 0.0, np.zeros(2))] * len(blown)
    number, left = 0, list(range(len(blown)))
    while left:
        found = _run_worker([items[k] for k in left], float(size[1]), seconds)
        staying = set()
        for k, (degrees, *shift) in zip(left, found, strict=True):
            turn = np.deg2rad(degrees)
            if _rotate_polygon(blown[k], turn).bounds[2] + shift[0] <= size[0] + OUTLINE_TOLERANCE / 2:
                placed[k] = number, turns[k] + turn, np.array(shift) - around
                staying.add(k)
        if not staying:
            raise GeometryError(f"spyrrow puts none of {len(left)} pieces on a sheet within {seconds:g} s: allow more")
        number, left = number + 1, [k for k in left if k not in staying]
    return placed


def _rotate_polygon(polygon: Any, turn: float) -> Any:
    cos, sin = np.cos(turn), np.sin(turn)
    return shapely.transform(polygon, lambda points: points @ np.array([[cos, sin], [-sin, cos]]))


def _inflate_polygon(polygon: Any, around: float) -> Any:
    """Return what a polygon keeps free, without its holes, as one polygon."""
    wide = shapely.buffer(shapely.simplify(polygon, OUTLINE_TOLERANCE), around, join_style="mitre", mitre_limit=2.0)
    return shapely.Polygon(wide.exterior) if wide.geom_type == "Polygon" else shapely.convex_hull(wide)


def _run_worker(items: list[dict[str, Any]], height: float, seconds: float) -> list[list[float]]:
    """Return degrees and shift of each item, from the other process."""
    task = json.dumps({"height": height, "seconds": max(round(seconds), 1), "items": items})
    try:
        done = subprocess.run(  # noqa: S603  (our own file)
            [sys.executable, "-P", str(WORKER)],
            input=task,
            capture_output=True,
            text=True,
            timeout=seconds + GRACE_SECONDS,
            check=True,
        )
    except subprocess.TimeoutExpired:
        raise GeometryError(
            f'spyrrow did not end {GRACE_SECONDS:g} s after its time was up: take packer="grid"'
        ) from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["no message"])[-1]
        raise GeometryError(f'spyrrow failed ({last}): take packer="grid"') from None
    return json.loads(done.stdout)
