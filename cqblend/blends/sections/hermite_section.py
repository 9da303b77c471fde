"""Sections: the surface between the jets of two ribbons, Hermite's and whatever vanishes at both rails besides.

In homogeneous 4-space, or in space where there are no weights. Each component takes as many jets as its own order of
continuity asks for. Knows neither where jets come from nor what fills the interior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, perm
from typing import TypeAlias

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks

UNIT_WEIGHT_TOLERANCE = 1e-12  # of a weight that is one

Jets: TypeAlias = Sequence[Curve]


@dataclass(frozen=True)
class SectionInterior:
    """What is added to a Hermite section without changing how it meets its surfaces.

    Component i of the sum is ``tables[i] @ curve``: Bernstein coefficients across, on the pieces between ``breaks`` of
    [0, 1], of splines that vanish at both ends with as many derivatives as that component takes from the jets.
    """

    curve: Curve
    tables: Array  # (3, degree + 1, dim of the curve, pieces)
    breaks: Array
    continuity: Array


def tabulate_hermite(first: int, last: int, taken: tuple[int, int], degree: int) -> Array:
    """Return Bernstein coefficients across (degree + 1, first + last) of what has the given jets at both ends.

    Of ``first`` jets at v = 0 and ``last`` at v = 1, both into the blend, the first ``taken`` are taken. With p the sum
    of these less one, row i from the first rail on is the sum over r of C(i, r) (p - r)!/p! J_r, and from the second
    rail on likewise; then the degree is raised.
    """
    p = sum(taken) - 1
    table = np.zeros((p + 1, first + last))
    for i in range(taken[0]):
        table[i, : i + 1] = [comb(i, r) / perm(p, r) for r in range(i + 1)]
    for i in range(taken[1]):
        table[p - i, first : first + i + 1] = [comb(i, r) / perm(p, r) for r in range(i + 1)]
    return bernstein.elevate_degree(table[..., None], degree - p)[..., 0]


def evaluate_weights(sides: tuple[Jets, Jets], t: Array, v: Array) -> Array | None:
    """Return the weight (n, m) that the section of jets has at t (n,) and v (m,); None if they are not homogeneous."""
    if sides[0][0].dim == 3:
        return None
    first, last = map(len, sides)
    degree = first + last - 1
    rows = tabulate_hermite(first, last, (first, last), degree)
    values = np.stack([jet(t)[:, 3] for jets in sides for jet in jets])
    return np.asarray(np.einsum("im,ik,kn->nm", bernstein.evaluate_basis(degree, 1 - v, v), rows, values))


def build_section(
    sides: tuple[Jets, Jets], halves: tuple[int, int, int] | None = None, interior: SectionInterior | None = None
) -> Surface:
    """Assemble the surface H(t, v) between the jets of two ribbons, of degree k1 + k2 + 1 across or more.

    Parameters
    ----------
    sides
        Jets of orders 0 .. k1 and 0 .. k2, both into the blend. Homogeneous ones (dim 4) give a rational surface,
        unless their weight is one.
    halves
        How many of them x, y and z take on each side; None for all. The weight takes all.
    interior
        What is added.

    Raises
    ------
    GeometryError
        If a weight is not positive.
    """
    first, last = map(len, sides)
    together = align_breaks([*sides[0], *sides[1], *([] if interior is None else [interior.curve])])
    largest = max(jet.degree for jet in together)
    coefs = [jet.elevate(largest - jet.degree).coefs for jet in together]
    jets = np.stack(coefs[: first + last])  # (k, p + 1, dim, n)
    degree = first + last - 1 if interior is None else max(first + last, interior.tables.shape[1]) - 1
    across = np.array([0.0, 1.0]) if interior is None else interior.breaks

    def tabulate_rows(taken: tuple[int, int]) -> Array:
        rows = tabulate_hermite(first, last, taken, degree)[..., None]
        return bernstein.restrict_pieces(rows.repeat(len(across) - 1, axis=2), across[:-1], across[1:])

    every = tabulate_rows((first, last))
    if halves is None:
        poles = np.einsum("ikm,kpdn->pidnm", every, jets)
    else:
        each = [tabulate_rows((half, half)) for half in halves] + [every] * (jets.shape[2] - 3)
        poles = np.einsum("dikm,kpdn->pidnm", np.stack(each), jets, optimize=True)
    if interior is not None:
        tables = np.moveaxis(interior.tables, 0, 1)
        tables = bernstein.elevate_degree(tables, degree + 1 - len(tables))
        poles[:, :, :3] += np.einsum("idkm,pkn->pidnm", tables, coefs[-1], optimize=True)
    continuity = np.min([jet.continuity for jet in together], axis=0)
    rational = False
    if poles.shape[2] == 4:
        weight = poles[:, :, 3]
        if not np.all(weight > 0):
            raise GeometryError("the blend's weight is not positive everywhere: the size is too large for these faces")
        # the rounding of a weight grows with the longest jet
        longest = max(float(np.abs(one[:, :3]).max()) for one in coefs[: first + last])
        rational = bool(
            np.abs(weight - 1).max() > UNIT_WEIGHT_TOLERANCE * max(1.0, longest / np.abs(poles[:, [0, -1], :3]).max())
        )
        poles = poles if rational else poles[:, :, :3] / weight[:, :, None]  # whose rounding is that of the numerators
    joints = np.empty(0, int) if interior is None else interior.continuity
    return Surface((together[0].breaks, across), poles, rational=rational, continuity=(continuity, joints))
