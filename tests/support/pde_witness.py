"""Closed forms of You and Zhang's equations, in 50 digits, and what two surfaces differ by: nothing of it is cqblend's.

On boundary data that are waves cos(k w) and sin(k w), the equation in v and w separates. What is left is an ordinary
differential equation in v, with the solutions v^p exp(rho v): rho runs over the zeros of the characteristic polynomial,
p up to their multiplicity. Symbols are given by their factors, so that multiplicities are known and not found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import combinations, product

import mpmath as mp
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec

Array = np.ndarray
DIGITS = 50


@dataclass(frozen=True)
class Symbol:
    """A polynomial in X = d2/dv2 and Y = d2/dw2, by factors X + s Y or X^2 + p X Y + q Y^2 and their multiplicities."""

    factors: tuple[tuple[tuple[float, ...], int], ...]
    leading: float = 1.0

    @property
    def parameters(self) -> tuple[float, ...]:
        """The coefficients a, b, .. of its equation."""
        product_ = [Fraction(self.leading)]
        for factor, multiplicity in self.factors:
            for _ in range(multiplicity):
                product_ = _times(product_, [Fraction(1), *map(Fraction, factor)])
        assert all(Fraction(float(c)) == c for c in product_)
        return tuple(map(float, product_))

    @property
    def half(self) -> int:
        return len(self.parameters) - 1

    @property
    def order(self) -> int:
        return 2 * self.half

    def exponents(self, frequency: float) -> list[tuple[mp.mpc, int]]:
        """Return the rho of its solutions exp(rho v + i frequency w), with multiplicities that add up to the order."""
        if frequency == 0:
            return [(mp.mpf(0), self.order)]
        found = []
        for factor, multiplicity in self.factors:
            if len(factor) == 1:
                squares = [mp.mpf(factor[0])]
            else:
                p, q = map(mp.mpf, factor)
                root = mp.sqrt(mp.mpc(p * p - 4 * q))
                squares = [(p + root) / 2, (p - root) / 2]
            found += [(sign * mp.sqrt(z) * mp.mpf(frequency), multiplicity) for z in squares for sign in (1, -1)]
        assert sum(multiplicity for _, multiplicity in found) == self.order
        assert all(abs(one - other) > 1e-3 for (one, _), (other, _) in combinations(found, 2))
        return found

    def steepest(self) -> float:
        """Return the largest |rho| for frequency 1."""
        return float(max(abs(rho) for rho, _ in self.exponents(1.0)))


def symbol(*factors, leading: float = 1.0) -> Symbol:
    """Return a symbol from factors (s,), (p, q), or (.., multiplicity)."""
    return Symbol(tuple((tuple(map(float, factor)), times) for factor, times in factors), leading)


def _times(one: list, other: list) -> list:
    out = [0] * (len(one) + len(other) - 1)
    for (i, a), (k, b) in product(enumerate(one), enumerate(other)):
        out[i + k] += a * b
    return out


@cache
def _coefficients(equation: Symbol, frequency: float) -> tuple[list, mp.matrix]:
    """Return functions (rho, p, v0), v^p exp(rho (v - v0)), and the matrix from boundary derivatives to factors."""
    with mp.workdps(DIGITS):
        functions = [
            (rho, p, 1 if mp.re(rho) > 0 else 0)  # none of them large
            for rho, multiplicity in equation.exponents(frequency)
            for p in range(multiplicity)
        ]
        rows = [[_derivative(one, mp.mpf(v), k) for one in functions] for v in (0, 1) for k in range(equation.half)]
        return functions, mp.inverse(mp.matrix(rows))


def _derivative(function: tuple, v: mp.mpf, k: int) -> mp.mpc:
    """Return the k-th derivative of v^p exp(rho (v - v0))."""
    rho, p, v0 = function
    terms = (mp.binomial(k, i) * mp.ff(p, i) * v ** (p - i) * rho ** (k - i) for i in range(min(k, p) + 1))
    return sum(terms) * mp.exp(rho * (v - v0))


def unit_in_digits(equation: Symbol, frequency: float, v: mp.mpf, kv: int = 0) -> list:
    """Return the k-th derivatives at v of the solutions with one boundary derivative 1 and all others 0."""
    with mp.workdps(DIGITS):
        functions, inverse = _coefficients(equation, frequency)
        row = mp.matrix([[_derivative(one, mp.mpf(v), kv) for one in functions]]) * inverse
        return [mp.re(x) for x in row]


@cache
def _units(equation: Symbol, frequency: float, v: tuple[float, ...], kv: int) -> Array:
    """Return the same as doubles (len(v), 2, half): derivative r at v = e is 1 in entry [:, e, r]."""
    rows = [[float(x) for x in unit_in_digits(equation, frequency, one, kv)] for one in v]
    return np.array(rows).reshape(len(v), 2, equation.half)


NODES = 40


@cache
def _interpolants(equation: Symbol, frequency: float) -> Array:
    """Return Chebyshev coefficients on [0, 1], (NODES, 2, half), of the unit solutions: for many v at once."""
    assert frequency * equation.steepest() < 8  # so that rounding is all that is left out
    angles = np.pi * (np.arange(NODES) + 0.5) / NODES
    values = _units(equation, frequency, tuple(((1 + np.cos(angles)) / 2).tolist()), 0)
    transform = np.cos(np.arange(NODES)[:, None] * angles) * 2 / NODES
    transform[0] /= 2
    return np.tensordot(transform, values, 1)


@dataclass(frozen=True)
class Waves:
    """Boundary data: sums over frequencies k of c cos(k t) + s sin(k t), by ``coefs`` (2 sides, 3, xyz, modes, 2).

    The second axis is the order of the derivative by v.
    """

    frequencies: tuple[float, ...]
    coefs: Array

    @classmethod
    def random(cls, seed: int, frequencies, *, apart: float = 0.0, sizes=1.0) -> Waves:
        """Return data of amplitude 1 at most (times ``sizes``), the sides ``apart`` in z."""
        rng = np.random.default_rng(seed)
        amplitude = rng.uniform(0.3, 1, (2, 3, 3, len(frequencies))) * np.broadcast_to(sizes, len(frequencies))
        phase = rng.uniform(0, 2 * np.pi, amplitude.shape)
        coefs = np.stack([amplitude * np.cos(phase), amplitude * np.sin(phase)], axis=-1)
        coefs[..., np.array(frequencies) == 0, 1] = 0.0
        made = cls(tuple(map(float, frequencies)), coefs)
        return made.moved((0, 0, apart), side=1) if apart else made

    def moved(self, by, side: int | None = None) -> Waves:
        """Return the data translated, both sides or one."""
        coefs = self.coefs.copy()
        for i in (0, 1) if side is None else (side,):
            coefs[i, 0, :, self.frequencies.index(0.0), 0] += by
        return replace(self, coefs=coefs)

    def along(self, t: Array, kt: int = 0) -> Array:
        """Return the k-th derivatives by t of cos(k t) and sin(k t), (n, modes, 2)."""
        k = np.array(self.frequencies)
        phase = np.multiply.outer(np.asarray(t, float), k)
        turns = (np.cos(phase), np.sin(phase), -np.cos(phase), -np.sin(phase))
        return k[:, None] ** kt * np.stack([turns[-kt % 4], turns[(1 - kt) % 4]], axis=-1)

    def data(self, side: int, order: int, t: Array, kt: int = 0) -> Array:
        """Return the k-th derivative by t of what is given on a side, (n, 3)."""
        return np.einsum("nks,cks->nc", self.along(t, kt), self.coefs[side, order])

    def solution(self, equations, t: Array, v: Array, kt: int = 0, kv: int = 0) -> Array:
        """Return the closed form at all t and v, (len(t), len(v), 3), for the equations of x, y and z."""
        v, along, out = tuple(np.asarray(v, float).tolist()), self.along(t, kt), []
        for i, equation in enumerate(equations):
            units = np.stack([_units(equation, k, v, kv) for k in self.frequencies])  # (modes, n, 2, half)
            data = self.coefs[:, : equation.half, i]
            out.append(np.einsum("kver,erks,tks->tv", units, data, along, optimize=True))
        return np.stack(out, axis=-1)

    def section(self, equations, t: float, v: Array, kt: int = 0) -> Array:
        """Return the closed form at one t, for many v: (n, 3)."""
        along, out = self.along(np.array([t]), kt)[0], []
        for i, equation in enumerate(equations):
            units = np.stack([_interpolants(equation, k) for k in self.frequencies])
            series = np.einsum("kver,erks,ks->v", units, self.coefs[:, : equation.half, i], along)
            out.append(np.polynomial.chebyshev.chebval(2 * np.asarray(v) - 1, series))
        return np.stack(out, axis=-1)

    def size(self, domain=(0.0, 2 * np.pi)) -> float:
        """Return the diagonal of the box around both sides."""
        points = np.concatenate([self.data(side, 0, np.linspace(*domain, 257)) for side in (0, 1)])
        return float(np.linalg.norm(np.ptp(points, axis=0)))


def hyperboloid_with_torus() -> Waves:
    """Return the data of the paper's eq. 14: (a cosh u cos v, b cosh u sin v, h0 + h sinh u) at u0, then the torus
    ((R + A cos u) cos v, (R + A cos u) sin v, A sin u) at u1; derivatives are those by u.
    """
    a, b, h, h0, u0 = 7.0, 6.0, 5.0, -12.0, 0.4
    ring, tube, u1 = 8.0, 2.5, -0.5
    ch, sh, c, s = np.cosh(u0), np.sinh(u0), np.cos(u1), np.sin(u1)
    x_y_z = np.array(
        [
            [(a * ch, b * ch, h0 + h * sh), (a * sh, b * sh, h * ch), (a * ch, b * ch, h * sh)],
            [(ring + tube * c,) * 2 + (tube * s,), (-tube * s, -tube * s, tube * c), (-tube * c, -tube * c, -tube * s)],
        ]
    )
    coefs = np.zeros((2, 3, 3, 2, 2))
    coefs[:, :, 0, 1, 0], coefs[:, :, 1, 1, 1], coefs[:, :, 2, 0, 0] = np.moveaxis(x_y_z, -1, 0)
    return Waves((0.0, 1.0), coefs)


def hermite(first: Array, second: Array, v: Array) -> Array:
    """Return the polynomial with derivatives ``first`` (half, n) at 0 and ``second`` at 1, (len(v), n)."""
    inverse = _hermite(len(first))
    return np.power.outer(np.asarray(v, float), np.arange(len(inverse))) @ (inverse @ np.concatenate([first, second]))


@cache
def _hermite(half: int) -> Array:
    """Return the matrix from derivatives at 0 and 1 to powers of v."""
    rows = [
        [int(mp.ff(i, k)) * e ** (i - k) if i >= k else 0 for i in range(2 * half)] for e in (0, 1) for k in range(half)
    ]
    return np.array(mp.inverse(mp.matrix(rows)).tolist(), float)


@cache
def central(order: int, reach: int, step: float) -> Array:
    """Return the weights of a central difference at -reach .. reach steps, exact for degrees up to 2 reach."""
    with mp.workdps(DIGITS):
        n = 2 * reach + 1
        powers = mp.matrix([[mp.mpf(i - reach) ** k for i in range(n)] for k in range(n)])
        right = mp.matrix([mp.factorial(order) if k == order else 0 for k in range(n)])
        return np.array([float(x) for x in mp.lu_solve(powers, right)]) / step**order


def occt_jets(face, t, v) -> Array:
    """Return P, Pt, Pv, Ptt, Pvv, Ptv of a face by OCCT, (6, n, 3)."""
    surface, out = BRep_Tool.Surface_s(face), []
    for a, b in zip(*np.broadcast_arrays(t, v), strict=True):
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
        surface.D2(float(a), float(b), point, *vectors)
        out.append([point.Coord(), *(vector.Coord() for vector in vectors)])
    return np.array(out).swapaxes(0, 1)


def contact(one: Array, other: Array) -> tuple[float, float, float]:
    """Return the largest gap, angle between tangent planes, and jump of the normal curvature of jets (6, n, 3)."""
    (n, first), (m, second) = map(_bending, (one, other))
    sign = np.sign((n * m).sum(1))
    angle = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.abs((n * m).sum(1)))
    jump = np.abs(np.linalg.eigvalsh(first * sign[:, None, None] - second)).max()
    return float(np.linalg.norm(one[0] - other[0], axis=1).max()), float(angle.max()), float(jump)


def _bending(jets: Array) -> tuple[Array, Array]:
    """Return normals (n, 3) and the second fundamental form as a tensor in space (n, 3, 3)."""
    _, t, v, tt, vv, tv = jets
    frame = np.stack([t, v], axis=1)  # (n, 2, 3)
    normal = np.cross(t, v)
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    dual = np.linalg.solve(frame @ frame.swapaxes(1, 2), frame)
    form = np.einsum("abnc,nc->nab", np.array([[tt, tv], [tv, vv]]), normal)
    return normal, np.einsum("nap,nab,nbq->npq", dual, form, dual)
