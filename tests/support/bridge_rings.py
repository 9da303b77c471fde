"""Closed rails in planes, for tests of bridges."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.network.bridge_loops import LoopJoin, LoopPiece, RailLoop
from cqblend.splines import Curve
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame


def make_ring(a: float, b: float, z: float) -> Curve:
    """Return an ellipse with half-axes a and b, counter-clockwise seen from above, as four rational arcs."""
    unit = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    poles = np.column_stack([unit * [a, b], np.full(9, z)])
    weights = [1, *[np.sqrt(0.5), 1] * 4]
    return Curve.from_bspline(2, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], poles, weights)


def make_loop(curves: Sequence[Curve], kinds: Sequence[Any] = ("through",), outward: float = 1.0) -> RailLoop:
    """Return a loop of curves in a plane z = constant, whose normal is z or, with ``outward`` -1, -z.

    It runs counter-clockwise from above; so what goes is inside.
    """
    height = float(curves[0](np.array(curves[0].domain))[0, 2])
    plane = Plane(LocalFrame(np.array([0.0, 0.0, height]), np.eye(3)))
    pieces = []
    for curve in curves:
        t = np.linspace(*curve.domain, 65)
        pieces.append(LoopPiece(SupportSurface(plane, outward), curve, (t, curve(t)[:, :2])))
    return RailLoop(tuple(pieces), tuple(LoopJoin(kind) for kind in kinds), outward)


def make_polygon(corners: Sequence[Any] | NDArray[np.float64], z: float, outward: float = 1.0) -> RailLoop:
    """Return a polygon, counter-clockwise seen from above, with all its corners."""
    points = np.column_stack([np.array(corners, dtype=float), np.full(len(corners), z)])
    sides = [Curve.bezier([one, other]) for one, other in zip(points, np.roll(points, -1, axis=0), strict=True)]
    return make_loop(sides, ["sharp"] * len(sides), outward)
