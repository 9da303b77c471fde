"""Exact jets (derivatives across) of two ribbons, and the tolerances and errors of a fit to them.

The compact form (:mod:`cqblend.blends.sections.compact_form`) approximates these jets within tolerances in position, in
the tangent plane and in curvature, which are measured here.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import perm

import numpy as np

from cqblend.blends.sections.hermite_section import Jets
from cqblend.blends.sections.tolerances import COMPACT_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.evaluation import BreakSide, dehomogenise_derivatives
from cqblend.surfaces.vectors import cross_product

JUMP_ERRORS = np.array([0.5, 0.1, 0.017, 0.005])
"""Largest error of a C4 quintic with unit spans that is fitted to a unit jump of derivative 0 .. 3 by least squares."""

JET_ERRORS = np.array([2.2e-5, 1.4e-4, 1e-3])
"""Largest error of value, slope and second derivative of such a quintic, where the sixth derivative is 1."""


@dataclass(frozen=True)
class ExactJets:
    """The exact homogeneous jets of both ribbons, all on the same breaks, and what a fit of them may miss.

    ``together`` has the components of all of them, which costs one evaluation where they would cost four or more.
    ``tolerance`` is that of position, ``angular_tolerance`` that of tangent planes (rad); ``sizes`` are the diagonals
    of the boxes around the rails. *Rows* are the Euclidean jets of the first side by order, then those of the second.
    """

    sides: tuple[list[Curve], list[Curve]]
    together: Curve
    tolerance: float
    angular_tolerance: float
    sizes: tuple[float, float]

    @property
    def breaks(self) -> Array:
        """Breaks common to all jets."""
        return self.sides[0][0].breaks

    def evaluate_rows(self, t: Array, order: int, side: BreakSide) -> Array:
        """Return the Euclidean rows with their derivatives by t, (rows, order + 1, n, 3)."""
        return np.concatenate(self._evaluate_each_side(t, order, side))

    def evaluate_sides(self, t: Array) -> list[Array]:
        """Return for each side its Euclidean jets with the derivatives that are compared, (orders, 2 or 3, n, 3)."""
        counts = [count_derivatives(jets) for jets in self.sides]
        found = self._evaluate_each_side(t, max(counts), "right")
        return [rows[:, : count + 1] for rows, count in zip(found, counts, strict=True)]

    def _evaluate_each_side(self, t: Array, order: int, side: BreakSide) -> list[Array]:
        """Return for each side its Euclidean jets with their derivatives by t, (orders, order + 1, n, 3)."""
        size = max(1, COMPACT_TOLERANCES.gathered_numbers // self.together.coefs[..., 0].size)
        parts = [self.together.jet(t[i : i + size], order, side=side) for i in range(0, len(t), size)]
        values = np.concatenate(parts, axis=1).transpose(2, 0, 1)
        homogeneous = values.reshape(-1, 4, order + 1, len(t)).swapaxes(1, 2)
        first = len(self.sides[0])
        return [dehomogenise_derivatives(rows).swapaxes(2, 3) for rows in (homogeneous[:first], homogeneous[first:])]

    def measure_errors(self, fitted: list[Array], exact: list[Array], widths: Array) -> Array:
        """Return the largest error of any sort, as a share of its tolerance, (n,).

        ``fitted`` and ``exact`` are as :meth:`evaluate_sides` returns them, ``widths`` (n,) the lengths of the pieces
        there. Derivatives are uncertain by the rounding of poles divided by these, whatever the number of spans: on
        short pieces, that is allowed as well.
        """
        ratios = []
        step = 2 * self.sides[0][0].degree / widths
        for fit, true, size, jets in zip(fitted, exact, self.sizes, self.sides, strict=True):
            noise = [COMPACT_TOLERANCES.coefficient_rounding * float(np.abs(jet.coefs).max()) for jet in jets]
            ratios.append(compute_norms(fit[0, 0] - true[0, 0]) / self.tolerance)
            if len(fit) == 1:
                continue
            speed, reach = (
                np.maximum(compute_norms(x), COMPACT_TOLERANCES.tiny_length) for x in (true[0, 1], true[1, 0])
            )
            ratios.append(compute_norms(fit[1, 0] - true[1, 0]) / (reach * self.angular_tolerance + noise[1]))
            n, wanted = (cross_product(x[0, 1], x[1, 0]) for x in (fit, true))
            turned = np.arctan2(compute_norms(cross_product(n, wanted)), (n * wanted).sum(-1))
            ratios.append(turned / (self.angular_tolerance + noise[0] * step / speed + noise[1] / reach))
            if len(fit) == 2:
                continue
            uncertain = [noise[2] / reach**2, noise[0] * (step / speed) ** 2, noise[1] * step / (speed * reach)]
            uncertain += [rounding * size / reach**3 for rounding in noise[3:]]
            curvatures = zip(_compute_curvatures(fit, size), _compute_curvatures(true, size), uncertain, strict=True)
            ratios += [np.abs(x - y) / (COMPACT_TOLERANCES.curvature + size * allowed) for x, y, allowed in curvatures]
        return np.asarray(np.max(ratios, axis=0) / COMPACT_TOLERANCES.used_share)

    def estimate_jump_costs(self, jumps: Array, rows: Array) -> Array:
        """Return the errors a, (rows, 3, 4, n), that a smooth fit makes at jumps (rows, 4, n, 3) of derivatives 0 .. 3.

        On spans of length h, the jump of derivative k + m of row r costs a[r, k, m] h^m tolerances of derivative k of
        that row. ``rows`` are the Euclidean rows with their first derivatives, (rows, 2, n, 3). Jumps change tangent
        planes and curvatures as well, as jumps of one and of two derivatives less do; there, only their normal part
        counts.
        """
        count = len(JUMP_ERRORS)
        costs = np.zeros((len(jumps), 3, *jumps.shape[1:-1]))
        for row, derivative, normal, limit in self._list_limits(rows):
            sizes = _measure_parts(jumps[row, derivative:], normal)
            costs[row, derivative, : count - derivative] = JUMP_ERRORS[: count - derivative, None] * sizes / limit
        return costs

    def estimate_span_widths(self, t: Array) -> Array:
        """Return how long spans of a C4 quintic may be at t, none of it a break, for its errors to be tolerated, (n,).

        These are proportional to the sixth derivatives of the rows; what rounding makes of them is left out.
        """
        order = 6
        rows = self.evaluate_rows(t, order, "right")
        piece = np.searchsorted(self.breaks, t) - 1
        length = np.diff(self.breaks)[piece]
        degree = self.sides[0][0].degree
        rounding = perm(degree, order) * (2 / length) ** order * COMPACT_TOLERANCES.coefficient_rounding
        noise = [rounding * float(np.abs(jet.coefs).max()) for jets in self.sides for jet in jets]
        inverse = np.full(len(t), 1 / float(np.ptp(self.breaks)))
        for row, derivative, normal, limit in self._list_limits(rows[:, :2]):
            size = np.maximum(_measure_parts(rows[row, order], normal) - noise[row], 0.0)
            share = JET_ERRORS[derivative] * size / (COMPACT_TOLERANCES.used_share * limit)
            inverse = np.maximum(inverse, share ** (1 / (order - derivative)))
        return np.asarray(1 / inverse)

    def _list_limits(self, rows: Array) -> list[tuple[int, int, Array | None, Array]]:
        """List what a fit may miss: row, derivative of it, unit vectors (n, 3) along which that counts, limit (n,).

        ``rows`` are the Euclidean rows with their first derivatives, (rows, 2, n, 3). All directions count where there
        are no unit vectors.
        """
        limits: list[tuple[int, int, Array | None, Array]] = []
        first = 0
        for jets, size in zip(self.sides, self.sizes, strict=True):
            count = len(jets)
            limits.append((first, 0, None, np.full(rows.shape[2], self.tolerance)))
            if count > 1:
                tangent, field = rows[first, 1], rows[first + 1, 0]
                speed, reach = (np.maximum(compute_norms(x), COMPACT_TOLERANCES.tiny_length) for x in (tangent, field))
                normal = cross_product(tangent, field)
                normal = normal / np.maximum(compute_norms(normal), COMPACT_TOLERANCES.tiny_length)[:, None]
                limits.append((first + 1, 0, None, self.angular_tolerance * reach))
                limits.append((first, 1, normal, self.angular_tolerance * speed))
                curvature = COMPACT_TOLERANCES.curvature
                limits += [(first + k, 0, None, curvature * reach**k / size ** (k - 1)) for k in range(2, count)]
                if count > 2:
                    limits.append((first, 2, normal, curvature / size * speed**2))
                    limits.append((first + 1, 1, normal, curvature / size * speed * reach))
            first += count
        return limits


def collect_exact_jets(sides: tuple[Jets, Jets], tolerance: float, angular_tolerance: float) -> ExactJets:
    """Bring homogeneous jets to common breaks, and measure the rails."""
    together = align_breaks([*sides[0], *sides[1]])
    first, second = together[: len(sides[0])], together[len(sides[0]) :]
    breaks = first[0].breaks
    sizes = []
    for rail in (first[0], second[0]):
        points = rail(np.concatenate([breaks, np.linspace(breaks[0], breaks[-1], 65)]))
        sizes.append(float(np.linalg.norm(np.ptp(points[:, :3] / points[:, 3:], axis=0))))
    return ExactJets((first, second), Curve.stack(together), tolerance, angular_tolerance, (sizes[0], sizes[1]))


def _measure_parts(vectors: Array, normal: Array | None) -> Array:
    """Return the sizes of vectors (.., n, 3): of their parts along unit vectors (n, 3), or their lengths if None."""
    return compute_norms(vectors) if normal is None else np.abs((vectors * normal).sum(-1))


def compute_norms(vectors: Array) -> Array:
    """Return the lengths of vectors (.., 3)."""
    return np.asarray(np.sqrt((vectors * vectors).sum(-1)))


def count_derivatives(jets: Jets) -> int:
    """Return the order of derivatives by t up to which errors are measured: 2 where curvature is to agree, else 1."""
    return 1 if len(jets) < 3 else 2


def _compute_curvatures(rows: Array, size: float) -> list[Array]:
    """Return the normal curvatures along T and C', the mixed one, and the normal part of the third jet, (n,) each.

    They are in units of 1 / size; ``rows`` are Euclidean jets with their derivatives (orders, 3, n, 3), and only what
    these determine is returned.
    """
    if len(rows) < 3:
        return []
    normal = cross_product(rows[0, 1], rows[1, 0])
    normal = normal / compute_norms(normal)[:, None]
    speed, reach = compute_norms(rows[0, 1]), compute_norms(rows[1, 0])
    parts = [(rows[2, 0], size / reach**2), (rows[0, 2], size / speed**2), (rows[1, 1], size / (speed * reach))]
    parts += [(row[0], size**2 / reach**3) for row in rows[3:]]
    return [np.asarray((vector * normal).sum(-1) * factor) for vector, factor in parts]
