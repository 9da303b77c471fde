"""Which loops of a face's new boundary belong together, where blends have cut the face in several pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, make_closed_wire
from cqblend.splines.bernstein import Array

Loop = Sequence[TopoDS_Edge]
"""Uses of edges, each followed by the next one, the last one by the first."""


def group_loops(face: TopoDS_Face, loops: Sequence[Loop], wires: Sequence[TopoDS_Shape]) -> list[list[TopoDS_Shape]]:
    """Return wires by the piece of a FORWARD face that they bound; each piece has one outer wire, the first.

    Of ``loops`` wires are made, ``wires`` are holes that stay. Where loops run around a closed face, it is one piece.
    """
    made = [make_closed_wire(loop) for loop in loops]
    polygons = [_sample_loop(face, loop) for loop in loops]
    outer = [k for k, polygon in enumerate(polygons) if _measure_area(polygon) > 0]
    if len(outer) < 2 or not all(_is_closed(polygon) for polygon in polygons):
        return [[*made, *wires]]
    groups: dict[int, list[TopoDS_Shape]] = {k: [made[k]] for k in outer}
    holes = [(made[k], polygon[0]) for k, polygon in enumerate(polygons) if k not in groups]
    for wire in wires:
        use = next(iter(explore_subshapes(wire, TopAbs_EDGE)))
        holes.append((wire, _sample_loop(face, [use])[0]))
    for wire, point in holes:
        around = [k for k in outer if _encloses(polygons[k], point)]
        groups[min(around or outer, key=lambda k: _measure_area(polygons[k]))].append(wire)
    return list(groups.values())


def _sample_loop(face: TopoDS_Face, loop: Loop) -> Array:
    """Return points (n, 2) along a loop in the parameters of its face."""
    found = []
    for use in loop:
        curve, first, last = read_pcurve(use, face)
        t = np.linspace(first, last, SHELL_EDIT_TOLERANCES.boundary_chords + 1)
        found.append(CurveEvaluator(curve)(t[:: -1 if use.Orientation() == TopAbs_REVERSED else 1])[0].T)
    return np.concatenate(found)


def _is_closed(polygon: Array) -> bool:
    gap = np.abs(polygon[-1] - polygon[0]).max()
    return bool(gap <= SHELL_EDIT_TOLERANCES.boundary_gap * np.ptp(polygon, axis=0).max())


def _measure_area(polygon: Array) -> float:
    """Return the area that a polygon (n, 2) runs around, above 0 if counter-clockwise."""
    x, y = (polygon - polygon[0]).T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def _encloses(polygon: Array, point: Array) -> bool:
    """Whether a point (2,) lies inside a polygon."""
    (x1, y1), (x2, y2) = (polygon - point).T, np.roll(polygon - point, -1, axis=0).T
    passes = (y1 > 0) != (y2 > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x1 - y1 * (x2 - x1) / (y2 - y1) > 0
    return bool(np.count_nonzero(passes & right) % 2)
