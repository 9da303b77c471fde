"""How a blend meets its surfaces, measured in long doubles and by OCCT on samples in every span: a witness for proofs.

Shares no code with cqblend: B-splines are evaluated by the recursion of their basis functions, from the arrays that go
into files. Samples lie inside every span of the blend, of the rail, and between the places where the rail crosses knot
lines of its surface, however short that span.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from kernel_surfaces import kernel_surface
from OCP.gp import gp_Pnt, gp_Vec

LONG = np.longdouble
SHARES = np.array([0.03, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 0.97], LONG)
JET = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


class Measured(NamedTuple):
    """Largest gap (mm), angle (rad) and jump of the normal curvature (1/mm) over all samples."""

    gap: float
    angle: float
    curvature_jump: float


def basis(degree: int, knots: np.ndarray, span: np.ndarray, x: np.ndarray, order: int) -> np.ndarray:
    """Return derivatives of the degree + 1 basis functions that live on a span, at x (n,): (degree + 1, n)."""
    if order > degree:
        return np.zeros((degree + 1, len(x)), LONG)
    if order:
        lower, out = basis(degree - 1, knots, span, x, order - 1), np.zeros((degree + 1, len(x)), LONG)
        for j in range(degree):
            first = span - degree + 1 + j
            term = degree * lower[j] / (knots[first + degree] - knots[first])
            out[j] -= term
            out[j + 1] += term
        return out
    out = np.ones((1, len(x)), LONG)
    for p in range(1, degree + 1):
        lower, out = out, np.zeros((p + 1, len(x)), LONG)
        for j in range(p):
            left, right = knots[span - p + 1 + j], knots[span + 1 + j]
            out[j] += lower[j] * (right - x) / (right - left)
            out[j + 1] += lower[j] * (x - left) / (right - left)
    return out


def spans(degree: int, knots: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the index of the knot before each x (n,), at the last one that of the last span."""
    return np.clip(np.searchsorted(knots, x, "right") - 1, degree, len(knots) - degree - 2)


@dataclass
class LongCurve:
    """A B-spline curve, evaluated in long doubles."""

    degree: int
    knots: np.ndarray
    poles: np.ndarray
    weights: np.ndarray | None = None

    def __call__(self, t: np.ndarray) -> np.ndarray:
        t, knots = np.asarray(t, LONG), self.knots.astype(LONG)
        span = spans(self.degree, knots, t)
        values = basis(self.degree, knots, span, t, 0)
        index = span - self.degree + np.arange(self.degree + 1)[:, None]
        if self.weights is not None:
            values = values * self.weights.astype(LONG)[index]
            values = values / values.sum(axis=0)
        return np.einsum("in,ind->nd", values, self.poles.astype(LONG)[index])


@dataclass
class LongSurface:
    """A B-spline surface, evaluated in long doubles, or by OCCT."""

    degrees: tuple[int, int]
    knots: tuple[np.ndarray, np.ndarray]
    poles: np.ndarray
    weights: np.ndarray | None = None

    def jet(self, uv: np.ndarray) -> np.ndarray:
        """Return S, Su, Sv, Suu, Suv, Svv, (6, n, 3), at (n, 2)."""
        tables = []
        rows = []
        for axis in (0, 1):
            p, knots, x = self.degrees[axis], self.knots[axis].astype(LONG), np.asarray(uv[:, axis], LONG)
            span = spans(p, knots, x)
            tables.append([basis(p, knots, span, x, k) for k in range(3)])
            rows.append(span - p + np.arange(p + 1)[:, None])
        local = (rows[0][:, None], rows[1][None])
        poles = self.poles.astype(LONG)[local]  # (p + 1, q + 1, n, 3)
        if self.weights is None:
            return np.stack([np.einsum("in,jn,ijnd->nd", tables[0][i], tables[1][j], poles) for i, j in JET])
        weights = self.weights.astype(LONG)[local][..., None]
        middle = poles.mean(axis=(0, 1))
        both = np.concatenate([(poles - middle) * weights, weights], axis=-1)
        s, su, sv, suu, suv, svv = (np.einsum("in,jn,ijnd->nd", tables[0][i], tables[1][j], both) for i, j in JET)
        w = s[:, 3:]
        x = s[:, :3] / w
        xu, xv = ((d[:, :3] - x * d[:, 3:]) / w for d in (su, sv))
        xuu = (suu[:, :3] - 2 * su[:, 3:] * xu - suu[:, 3:] * x) / w
        xvv = (svv[:, :3] - 2 * sv[:, 3:] * xv - svv[:, 3:] * x) / w
        xuv = (suv[:, :3] - su[:, 3:] * xv - sv[:, 3:] * xu - suv[:, 3:] * x) / w
        return np.stack([x + middle, xu, xv, xuu, xuv, xvv])

    def kernel_jet(self, uv: np.ndarray) -> np.ndarray:
        """Return the same by OCCT's D2, at double parameters; first derivatives by D1."""
        surface = kernel_surface(self.degrees, self.knots, self.poles, self.weights)
        p, su, sv, suu, svv, suv = gp_Pnt(), *(gp_Vec() for _ in range(5))
        out = []
        for u, v in np.asarray(uv, float).tolist():
            surface.D2(u, v, p, su, sv, suu, svv, suv)
            second = [x.Coord() for x in (suu, suv, svv)]
            surface.D1(u, v, p, su, sv)
            out.append([*(x.Coord() for x in (p, su, sv)), *second])
        return np.array(out).swapaxes(0, 1).astype(LONG)


def crossings(curve: LongCurve, surface: LongSurface, samples: int = 4097) -> np.ndarray:
    """Return where a rail crosses knot lines, by bisection in long doubles."""
    found = []
    t = np.linspace(LONG(curve.knots[0]), LONG(curve.knots[-1]), samples)
    uv = curve(t)
    for axis in (0, 1):
        p = surface.degrees[axis]
        for line in np.unique(surface.knots[axis][p + 1 : -p - 1]).astype(LONG):
            off = uv[:, axis] - line
            i = np.flatnonzero(np.sign(off[:-1]) * np.sign(off[1:]) < 0)
            low, high, first = t[i], t[i + 1], off[i]
            for _ in range(70):
                middle = (low + high) / 2
                ahead = (curve(middle)[:, axis] - line) * first > 0 if len(i) else np.zeros(0, bool)
                low, high = np.where(ahead, middle, low), np.where(ahead, high, middle)
            found += [*(low + high) / 2, *t[off == 0]]
    return np.array(found, LONG)


def samples(blend: LongSurface, curve: LongCurve, surface: LongSurface) -> np.ndarray:
    """Return parameters inside every span that is longer than some roundings, as doubles."""
    breaks = np.concatenate([blend.knots[0].astype(LONG), curve.knots.astype(LONG), crossings(curve, surface)])
    breaks = np.unique(np.clip(breaks, LONG(curve.knots[0]), LONG(curve.knots[-1])))
    lengths = np.diff(breaks)
    inside = lengths > 64 * np.finfo(float).eps * np.abs(breaks).max()
    t = (breaks[:-1] + SHARES[:, None] * lengths)[:, inside].ravel()
    dense = np.linspace(breaks[0], breaks[-1], 203)[1:-1]
    return np.sort(np.concatenate([t, dense])).astype(float)


def compared(mine: np.ndarray, other: np.ndarray) -> Measured:
    """Compare two jets (6, n, 3)."""
    m, n = (np.cross(jet[1], jet[2]) for jet in (mine, other))
    m, n = (x / length(x)[:, None] for x in (m, n))
    if (m * n).sum() < 0:
        n = -n
    angle = np.arctan2(length(np.cross(m, n)), (m * n).sum(1))
    forms = tensor(mine, m, mine[1]) - tensor(other, n, mine[1])
    middle, half = (forms[:, 0, 0] + forms[:, 1, 1]) / 2, (forms[:, 0, 0] - forms[:, 1, 1]) / 2
    jump = np.abs(middle) + np.hypot(half, forms[:, 0, 1])
    return Measured(*(float(x.max()) for x in (length(mine[0] - other[0]), angle, jump)))


def length(x: np.ndarray) -> np.ndarray:
    return np.sqrt((x * x).sum(-1))


def tensor(jet: np.ndarray, normal: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Curvature tensors (n, 2, 2) of a jet in the frame (along, across) of the plane of a unit normal."""
    first = along - (along * normal).sum(1)[:, None] * normal
    first = first / length(first)[:, None]
    frame = np.stack([first, np.cross(normal, first)], 1)
    a, b = (np.einsum("nij,nj->ni", frame, x) for x in (jet[1], jet[2]))
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    inverse = np.stack([np.stack([b[:, 1], -b[:, 0]], -1), np.stack([-a[:, 1], a[:, 0]], -1)], 1) / det[:, None, None]
    uu, uv, vv = np.einsum("kni,ni->kn", jet[3:], normal)
    form = np.stack([uu, uv, uv, vv], -1).reshape(-1, 2, 2)
    return np.einsum("nki,nkl,nlj->nij", inverse, form, inverse)


def measure(blend: LongSurface, end: int, curve: LongCurve, surface: LongSurface) -> tuple[Measured, Measured]:
    """Measure in long doubles, and by OCCT, how a blend meets a surface along its boundary v = 0 or 1."""
    t = samples(blend, curve, surface)
    uv = curve(t)
    tv = np.stack([t, np.full_like(t, blend.knots[1][-1] if end else blend.knots[1][0])], -1)
    return (
        compared(blend.jet(tv), surface.jet(uv)),
        compared(blend.kernel_jet(tv), surface.kernel_jet(uv)),
    )
