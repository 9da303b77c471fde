"""Surfaces in homogeneous Bernstein pieces, stacked so that bands of many are cut and measured at once.

A band is the part of a surface between two of its isoparametric curves. Surfaces of equal degrees, and with as many
pieces in u, are stacked along v; a stack takes hardly longer than one of them. Depends on splines only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import EPSILON, Array, evaluate_basis, restrict_pieces


@dataclass(frozen=True, slots=True, eq=False)
class BezierPieces:
    """A surface in homogeneous Bernstein pieces, to be cut in v.

    Attributes
    ----------
    coefs
        (p+1, q+1, 4, nu, nv); the weight is 1 if the surface is polynomial.
    breaks
        (nu + 1,) and (nv + 1,).
    continuity
        (nu - 1,) in u.
    rational
        Whether rails have weights.
    separable
        Whether the weights are a product of one function of u and one of v, to rounding.
    size
        Largest extent of the control points.
    max_coordinate
        Largest absolute value of a coordinate of the control points.
    """

    coefs: Array
    breaks: tuple[Array, Array]
    continuity: Array
    rational: bool
    separable: bool
    size: float
    max_coordinate: float

    @classmethod
    def from_surface(cls, surface: Surface) -> "BezierPieces":
        """Prepare a surface of dim 3.

        Raises
        ------
        GeometryError
            If a weight is not positive, or all control points coincide.
        """
        coefs = surface.coefs
        if not surface.rational:
            shape = coefs.shape
            coefs = np.concatenate([coefs, np.ones((*shape[:2], 1, *shape[3:]))], axis=2)
        weight = coefs[:, :, 3]
        if weight.min() <= 0:
            raise GeometryError(f"a weight of the surface is {weight.min():.3g}: its deviation cannot be bounded")
        points = coefs[:, :, :3] / weight[:, :, None]
        size = float((points.max(axis=(0, 1, 3, 4)) - points.min(axis=(0, 1, 3, 4))).max())
        if not size > 0:
            raise GeometryError("the surface is degenerate: it is a single point")
        table = weight.transpose(0, 2, 1, 3).reshape(weight.shape[0] * weight.shape[2], -1)
        rank_one = np.outer(table[:, 0], table[0]) / table[0, 0]
        separable = bool((np.abs(table - rank_one) <= 32 * EPSILON * table).all())
        max_coordinate = float(np.abs(points).max())
        return cls(coefs, surface.breaks, surface.continuity[0], surface.rational, separable, size, max_coordinate)

    def take_pieces(self, first: int, last: int) -> "BezierPieces":
        """Take the pieces first .. last - 1 in v."""
        u, v = self.breaks
        coefs = self.coefs[..., first:last]
        return replace(self, coefs=coefs, breaks=(u, v[first : last + 1]))

    @property
    def domain(self) -> tuple[float, float]:
        """First and last v."""
        v = self.breaks[1]
        return float(v[0]), float(v[-1])

    @property
    def slack(self) -> float:
        """Rounding, mm, that bounds are enlarged by: of a deviation, and of points of surface and strips in OCCT."""
        return 64 * EPSILON * self.size + 16 * EPSILON * self.max_coordinate

    @property
    def likeness(self) -> tuple[int, int, int, bool]:
        """What surfaces that are stacked have in common: degrees, number of pieces in u, whether weights separate."""
        p, q, _, nu, _ = self.coefs.shape
        return p - 1, q - 1, nu, self.separable


@dataclass(frozen=True, slots=True, eq=False)
class PieceStack:
    """Surfaces that are alike, their pieces in v one after the other.

    Attributes
    ----------
    members
        The surfaces, or parts of surfaces between knot lines; see :attr:`BezierPieces.likeness`.
    coefs
        (p+1, q+1, 4, nu, m): the pieces in v of all members.
    starts, ends
        (m,) interval of v of every piece.
    offsets
        (k + 1,) index of the first piece of every member, and the number of pieces.
    inner_breaks
        (k, ..) breaks of every member without the first and the last, then infinities.
    """

    members: tuple[BezierPieces, ...]
    coefs: Array
    starts: Array = field(init=False)
    ends: Array = field(init=False)
    offsets: Array = field(init=False)
    inner_breaks: Array = field(init=False)

    def __post_init__(self) -> None:
        breaks = [member.breaks[1] for member in self.members]
        counts = np.array([len(v) - 1 for v in breaks])
        inner_breaks = np.full((len(breaks), int(counts.max()) - 1), np.inf)
        for row, v in zip(inner_breaks, breaks, strict=True):
            row[: len(v) - 2] = v[1:-1]
        for name, value in (
            ("starts", np.concatenate([v[:-1] for v in breaks])),
            ("ends", np.concatenate([v[1:] for v in breaks])),
            ("offsets", np.concatenate([[0], np.cumsum(counts)])),
            ("inner_breaks", inner_breaks),
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def from_members(cls, members: Sequence[BezierPieces]) -> "PieceStack":
        """Stack surfaces of one likeness."""
        return cls(tuple(members), np.concatenate([member.coefs for member in members], axis=-1))

    def divide_members(self, borders: Sequence[Sequence[int]]) -> "PieceStack":
        """Return the same pieces with the parts of the members as members: between borders, from 0 to their number."""
        parts = [
            member.take_pieces(first, last)
            for member, borders_of_member in zip(self.members, borders, strict=True)
            for first, last in pairwise(borders_of_member)
        ]
        return PieceStack(tuple(parts), self.coefs)

    @property
    def separable(self) -> bool:
        """Whether the weights of all members are products of one function of u and one of v."""
        return self.members[0].separable

    @property
    def domains(self) -> tuple[Array, Array]:
        """First and last v (k,) of the members."""
        return self.starts[self.offsets[:-1]], self.ends[self.offsets[1:] - 1]

    @property
    def sizes(self) -> Array:
        """Sizes (k,) of the members, mm."""
        return np.array([member.size for member in self.members])

    @property
    def slacks(self) -> Array:
        """Rounding (k,) of the members, mm."""
        return np.array([member.slack for member in self.members])

    def cut_bands(self, member: ArrayLike, starts: ArrayLike, ends: ArrayLike) -> "SurfaceBands":
        """Cut bands (n,) out, each of one member, by its index, from v = start to end."""
        index = np.atleast_1d(np.asarray(member, dtype=int))
        low, high = (np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (starts, ends))
        inner = self.inner_breaks[index]
        first = (inner <= low[:, None]).sum(axis=1)
        count = (inner < high[:, None]).sum(axis=1) - first + 1
        owner = np.repeat(np.arange(len(low)), count)
        rank = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        piece = (self.offsets[index] + first)[owner] + rank
        start, end = self.starts[piece], self.ends[piece]
        x0 = (np.maximum(start, low[owner]) - start) / (end - start)
        x1 = (np.minimum(end, high[owner]) - start) / (end - start)
        rows = self.coefs[..., piece].swapaxes(0, 1)
        return SurfaceBands(self, restrict_pieces(rows, x0, x1).swapaxes(0, 1), index, low, high, owner, rank)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceBands:
    """Bands of surfaces, each between two isoparametric curves of one surface, its rails.

    Attributes
    ----------
    stack
        The surfaces.
    coefs
        (p+1, q+1, 4, nu, m) homogeneous, the pieces in v of all bands one after the other.
    member
        (k,) index of the surface that a band is part of.
    starts, ends
        (k,) intervals of v.
    owner, rank
        (m,) index of the band that a piece belongs to, and its place in v within that band.
    rail_coefs
        (p+1, 2, 4, nu, k) homogeneous coefficients of both rails of each.
    widths
        (k,) lengths of the longest of sampled rulings, mm.
    """

    stack: PieceStack
    coefs: Array
    member: Array
    starts: Array
    ends: Array
    owner: Array
    rank: Array
    rail_coefs: Array = field(init=False)
    widths: Array = field(init=False)

    def __post_init__(self) -> None:
        first = self.rank == 0
        last = np.append(first[1:], True)
        rail_coefs = np.stack([self.coefs[:, 0][..., first], self.coefs[:, -1][..., last]], axis=1)
        rails = to_points(np.tensordot(sample_basis(len(self.coefs) - 1), rail_coefs, (0, 0)))
        object.__setattr__(self, "rail_coefs", rail_coefs)
        object.__setattr__(self, "widths", np.linalg.norm(rails[:, 1] - rails[:, 0], axis=1).max(axis=(0, 1)))

    def take_bands(self, is_taken: Array) -> "SurfaceBands":
        """Return some of the bands, by a mask (k,)."""
        if is_taken.all():
            return self
        columns = is_taken[self.owner]
        return SurfaceBands(
            self.stack,
            self.coefs[..., columns],
            self.member[is_taken],
            self.starts[is_taken],
            self.ends[is_taken],
            (np.cumsum(is_taken) - 1)[self.owner[columns]],
            self.rank[columns],
        )

    @property
    def sizes(self) -> Array:
        """Sizes (k,) of the surfaces that the bands are parts of, mm."""
        return self.stack.sizes[self.member]

    @property
    def slacks(self) -> Array:
        """Rounding (k,) of these surfaces, mm."""
        return self.stack.slacks[self.member]

    def make_rail(self, band: int, side: Literal[0, 1]) -> Curve:
        """Return C1 (side 0) or C2 (side 1) of one of the bands."""
        pieces = self.stack.members[self.member[band]]
        coefs = self.rail_coefs[:, side, : 4 if pieces.rational else 3, :, band]
        return Curve(pieces.breaks[0], coefs, rational=pieces.rational, continuity=pieces.continuity)

    def starts_along(self, band: int, rail: Curve) -> bool:
        """Whether C1 of one of the bands is a given rail but for rounding."""
        coefs = self.rail_coefs[:, 0, : rail.coefs.shape[1], :, band]
        return bool(np.abs(rail.coefs - coefs).max() <= self.stack.members[self.member[band]].slack)

    def is_spannable(self) -> Array:
        """Whether (k,) there is a ruled surface between the rails: they are not both points, nor the same curve."""
        rails = to_points(self.rail_coefs)
        extents = (rails.max(axis=(0, 3)) - rails.min(axis=(0, 3))).max(axis=1)  # (2, k)
        small = STRIP_TOLERANCES.coincident_points * self.sizes
        return np.asarray((extents.max(axis=0) > small) & (self.widths > small))

    def fit_row_fractions(self, *, middle_column: bool = False) -> Array:
        """Fit a fraction w to every row of control points: (q+1, m), not decreasing from 0 to 1 in every band.

        Rows are projected on the rulings: all columns at once, by least squares, or only the column in the middle of
        the control mesh (if its ends coincide, the one whose ends are farthest apart), as in Elber's figure 1.
        """
        points, rails = to_points(self.coefs), to_points(self.rail_coefs)
        chord = rails[:, 1] - rails[:, 0]  # (p+1, 3, nu, k)
        if middle_column:
            square = (chord * chord).sum(axis=1)  # (p+1, nu, k)
            i, piece = self._choose_columns(square)
            band, owner = np.arange(len(i)), self.owner
            chord = chord[i, :, piece, band]  # (k, 3)
            relative = points[i[owner], :, :, piece[owner], np.arange(len(owner))]  # (m, q+1, 3)
            relative = relative - rails[i, 0, :, piece, band][owner, None]
            dots = (relative @ chord[owner, :, None])[..., 0].T
            square = square[i, piece, band]
        else:
            relative = points - rails[:, :1][..., self.owner]
            dots = np.einsum("ijdnm,idnm->jm", relative, chord[..., self.owner])
            square = (chord * chord).sum(axis=(0, 1, 2))
        square = square[self.owner]
        fractions = np.clip(np.divide(dots, square, out=np.zeros_like(dots), where=square > 0), 0.0, 1.0)
        fractions[0, self.rank == 0] = 0.0
        reached = np.zeros(len(self.starts))
        for rank in range(int(self.rank.max()) + 1):
            here = self.rank == rank
            fractions[:, here] = np.maximum(np.maximum.accumulate(fractions[:, here]), reached[self.owner[here]])
            reached[self.owner[here]] = fractions[-1, here]
        fractions[-1, np.append(self.rank[1:] == 0, True)] = 1.0
        return fractions

    def _choose_columns(self, square: Array) -> tuple[Array, Array]:
        """Choose the columns that are projected: index within a piece and index of the piece in u, (k,) each.

        `square` are the squared chords (p+1, nu, k) of all columns.
        """
        degree, pieces, count = square.shape[0] - 1, square.shape[1], square.shape[2]
        piece, i = divmod((degree * pieces + 1) // 2, degree)
        if piece == pieces:
            piece, i = pieces - 1, degree
        rows, columns = np.full(count, i), np.full(count, piece)
        is_zero = square[i, piece] <= (STRIP_TOLERANCES.coincident_points * self.sizes) ** 2
        if is_zero.any():
            longest = square[..., is_zero].reshape(-1, int(is_zero.sum())).argmax(axis=0)
            rows[is_zero], columns[is_zero] = np.unravel_index(longest, square.shape[:2])
        return rows, columns

    def make_fraction_surface(self, band: int, row_fractions: Array) -> Surface:
        """Return the fraction w(u, v) over one of the bands, of given row fractions (q+1, m) of all."""
        columns = self.owner == band
        weight = self.coefs[:, :, 3:][..., columns]
        coefs = np.concatenate([weight * row_fractions[:, None, None, columns], weight], axis=2)
        u, v = self.stack.members[self.member[band]].breaks
        start, end = self.starts[band], self.ends[band]
        inner = v[(v > start) & (v < end)]
        return Surface((u, np.concatenate([[start], inner, [end]])), coefs, rational=True)


@lru_cache(maxsize=64)
def sample_basis(degree: int) -> Array:
    """Bernstein polynomials (p+1, 2 p+1) at equal steps."""
    x = np.linspace(0.0, 1.0, 2 * degree + 1)
    return evaluate_basis(degree, 1 - x, x)


def to_points(homogeneous: Array) -> Array:
    """Divide the three coordinates, axis 2, by the weight after them."""
    return np.asarray(homogeneous[:, :, :3] / homogeneous[:, :, 3:4])
