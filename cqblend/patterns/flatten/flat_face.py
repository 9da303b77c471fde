"""Strips of a face laid flat, with their rulings as they are or paired anew.

Exists because a strip that is paired anew is another ruled surface between the same rails, over another parameter: who
carries trimming curves to the plane asks here where a point of the face has got to. Must not know trimming.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import isfinite
from typing import Literal

import numpy as np

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flatten.development import strain_from_turn
from cqblend.patterns.flatten.flat_strip import FlatStrip, Layout, flatten_rails
from cqblend.patterns.strips.developability import bound_normal_turn
from cqblend.patterns.strips.division import Direction, Method, divide_surface
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.ruling_pairing import pair_rulings
from cqblend.patterns.trim.domain_cells import CutLines
from cqblend.patterns.trim.trimmed_patch import Patch
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_intervals

_MAX_DEPTH = 4
"""A strip is divided again so often at most because of its strain."""

_MAX_DEPTH_RIGHT_ANGLE = 8
"""The same where its normal turns by a right angle."""

_SAMPLING_SAFETY = 1.05
"""What a sampled deviation is multiplied by before it counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnrollOptions:
    """What is asked of a pattern; see :func:`cqblend.unroll`."""

    tolerance: float
    flat: float
    method: Method
    direction: Direction
    even: bool
    least_width: float | None
    strain: float
    developable: bool
    layout: Layout


@dataclass(frozen=True, slots=True)
class UnrollStrategy:
    """How a patch may be divided and laid flat: by narrower strips than its tolerance needs, if that helps."""

    direction: Literal["u", "v"]
    narrower: bool = False
    layout: Layout = "smooth"

    def __str__(self) -> str:
        what = ", narrower strips" if self.narrower else ", as triangles" if self.layout == "triangles" else ""
        return f"rulings along {self.direction}{what}"


@dataclass(slots=True, eq=False)
class DividedPatch:
    """A patch with its strips, none on a plane, and what keeps its pieces from covering themselves.

    That is cuts across strips, by how much all tolerances are finer than asked, the way in which it is divided, those
    that are left, those that failed and why, and why its strips are narrower than asked.
    """

    patch: Patch
    strips: tuple[RuledStrip, ...] = ()
    transposed: bool = False
    elber: int = 1
    ideal: float = 1.0
    cuts: dict[int, list[float]] = field(default_factory=dict)
    finer: float = 1.0
    way: UnrollStrategy | None = None
    ways: tuple[UnrollStrategy, ...] = ()
    failed: tuple[tuple[UnrollStrategy, CqblendError], ...] = ()
    refusal: CqblendError | None = None

    def choose_layout(self, wishes: UnrollOptions) -> Layout:
        """Return how its strips are laid flat."""
        return self.way.layout if self.way else wishes.layout

    def make_cut_lines(self) -> CutLines:
        """Return the parameter lines that the patch's loops are cut at."""
        return CutLines(self.across_axis, np.array([strip.span[1] for strip in self.strips[:-1]]), self.cuts)

    def add_cut(self, row: int, value: float) -> None:
        """Cut a strip across."""
        self.cuts[row] = sorted([*self.cuts.get(row, ()), value])

    @property
    def extent(self) -> tuple[float, float]:
        """How far both parameters reach."""
        (u0, u1), (v0, v1) = self.patch.surface.domain
        return u1 - u0, v1 - v0

    def to_rail_axes(self, uv: Array) -> tuple[Array, Array]:
        """Return the parameters along the rails and across them of points (n, 2)."""
        return (uv[:, 1], uv[:, 0]) if self.transposed else (uv[:, 0], uv[:, 1])

    @property
    def across_axis(self) -> int:
        """The axis of the parameter plane that runs across the strips."""
        return 0 if self.transposed else 1

    @property
    def upward(self) -> bool:
        """Whether R_t x R_w of the strips points to the outer side."""
        return self.patch.outward != self.transposed


@dataclass(frozen=True, slots=True, eq=False)
class UnrolledStrip:
    """A strip laid flat, as it is or with its rulings paired anew.

    Attributes
    ----------
    strip
        As it was divided.
    rails
        Between which it is ruled now, over a parameter r.
    parameters
        The strip's own parameter t on both rails as functions of r; None where r is t.
    bound
        Distance from the surface, both ways, mm.
    proven
        Whether the bound is certified. That of a new pairing is the largest of a grid of samples.
    flat
        The strip in the plane.
    """

    strip: RuledStrip
    rails: tuple[Curve, Curve]
    parameters: tuple[Curve, Curve] | None
    bound: float
    proven: bool
    flat: FlatStrip

    def to_ruled_surface(self) -> Surface:
        """Return the strip as a surface (r, w)."""
        return replace(self.strip, rails=self.rails).to_ruled_surface()

    def map_to_surface(self, points: Array) -> Array:
        """Return the points of the surface, (n, 3), for which points (n, 2) of the plane stand."""
        return _map_to_surface(self.strip, self.parameters, *self.flat.to_parameters(points))

    def locate_on_ruling(self, t: Array, across: Array) -> tuple[Array, Array]:
        """Return r and the fraction of the ruling of points given by the strip's own parameters.

        Of a strip that is paired anew only points on its rails and at its ends can be located.
        """
        start, stop = self.strip.rails[0].domain
        t = np.clip(t, start, stop)
        w = self.strip.find_fractions(t, np.clip(across, *self.strip.span))
        if self.parameters is None:
            return t, w
        return np.where(w < 1, _invert_monotone(self.parameters[0], t), _invert_monotone(self.parameters[1], t)), w


def _invert_monotone(function: Curve, values: Array) -> Array:
    """Return where a function that never decreases takes values; the first and the last at its ends."""
    start, stop = function.domain
    _, high = bisect_intervals(
        lambda r: function(r)[..., 0] < values, np.full(values.shape, start), np.full(values.shape, stop)
    )
    ends = function(np.array([start, stop]))[:, 0]
    return np.where(values <= ends[0], start, np.where(values >= ends[1], stop, high))


def bound_strain(strips: Sequence[RuledStrip]) -> float:
    """Bound by how much lengths inside strips change when they are laid flat; infinite where that cannot be done."""
    return max(strain_from_turn(bound_normal_turn(strip.rails)) for strip in strips)


def narrow_strips(
    strips: Sequence[RuledStrip], wishes: UnrollOptions, finer: float, *, at_any_price: bool = False
) -> tuple[RuledStrip, ...]:
    """Divide strips along their rails until lengths inside them change little enough when they are laid flat.

    Strain falls with the square of the width. Each part is divided as the whole face was: its bound is certified.

    Parameters
    ----------
    at_any_price
        Whether strips are divided, too, whose normal turns by a right angle along a ruling.

    Raises
    ------
    GeometryError
        Some strip cannot be made narrow enough.
    """
    found: list[RuledStrip] = []
    todo = [(strip, 0) for strip in reversed(strips)]
    while todo:
        strip, depth = todo.pop()
        excess = bound_strain([strip]) / wishes.strain
        if excess <= 1:
            found.append(strip)
            continue
        if not isfinite(excess) and not at_any_price:
            raise GeometryError(
                f"the strip from {strip.ruling_parameter} = {strip.span[0]:.6g} to {strip.span[1]:.6g} cannot be "
                "laid flat: its "
                "rulings meet between the rails, or its normal turns by more than a right angle along a ruling; divide "
                "it into narrower strips"
            )
        if depth == (_MAX_DEPTH if isfinite(excess) else _MAX_DEPTH_RIGHT_ANGLE):
            change = f"change by {wishes.strain * excess:.2g}" if isfinite(excess) else "cannot be kept"
            raise GeometryError(
                f"lengths inside a strip {change} when it is laid flat, more than {wishes.strain:g}, however narrow it "
                "is; allow more strain, or choose another direction"
            )
        count = int(np.clip(np.ceil(np.sqrt(1.1 * excess)), 2, 16)) if isfinite(excess) else 2
        ends = np.linspace(*strip.span, count + 1)
        parts = [
            replace(part, transposed=strip.transposed)
            for span in pairwise(ends.tolist())
            for part in divide_surface(strip.surface.clip(v=span), wishes.tolerance / finer, direction="v").strips
        ]
        todo += [(part, depth + 1) for part in reversed(parts)]
    return tuple(found)


def unroll_strips(face: DividedPatch, vertices: Mapping[int, Array], wishes: UnrollOptions) -> dict[int, UnrolledStrip]:
    """Lay strips flat, by row, with nodes at given vertices (t, across) on each and on its borders.

    Triangles have the nodes of all strips of the face: the chords of a rail are the same on both sides.
    """
    nodes = np.empty(0)
    if face.choose_layout(wishes) == "triangles":
        nodes = np.concatenate([corners[:, 0] for corners in vertices.values()])
    found = {row: _unroll_strip(face, row, corners, nodes, wishes) for row, corners in vertices.items()}
    if face.choose_layout(wishes) == "triangles":
        finest = max((laying.flat.nodes for laying in found.values()), key=len)
        found = {row: _unroll_strip(face, row, corners, finest, wishes) for row, corners in vertices.items()}
    return found


def _unroll_strip(face: DividedPatch, row: int, vertices: Array, nodes: Array, wishes: UnrollOptions) -> UnrolledStrip:
    """Lay a strip flat, with nodes at the vertices (t, across) of its cells, and at given t."""
    strip = face.strips[row]
    t, across = vertices.T
    layout = face.choose_layout(wishes)
    if wishes.developable and (np.isin(across, strip.span) | np.isin(t, strip.rails[0].domain)).all():
        paired = _unroll_paired_anew(face, strip, t, wishes)
        if paired is not None:
            return paired
    nodes = np.unique(np.append(t, nodes))
    flat = flatten_rails(strip.rails, wishes.flat / face.finer, nodes=nodes, flip=not face.upward, layout=layout)
    return UnrolledStrip(strip, strip.rails, None, strip.bound, True, flat)


def _unroll_paired_anew(face: DividedPatch, strip: RuledStrip, t: Array, wishes: UnrollOptions) -> UnrolledStrip | None:
    """Pair the rulings of a strip anew, so that it is developable; None if that cannot be done within the tolerance."""
    pairing = pair_rulings(strip.rails)
    if pairing.rails is None or pairing.parameters is None or pairing.rails is strip.rails:
        return None
    bound = _SAMPLING_SAFETY * _sample_deviation(strip, pairing.rails, pairing.parameters)
    if bound > wishes.tolerance:
        return None
    nodes = np.unique([_invert_monotone(one, np.unique(t)) for one in pairing.parameters])
    layout = face.choose_layout(wishes)
    flat = flatten_rails(pairing.rails, wishes.flat / face.finer, nodes=nodes, flip=not face.upward, layout=layout)
    if flat.kind == "twisted":
        return None
    return UnrolledStrip(strip, pairing.rails, pairing.parameters, bound, False, flat)


def _sample_deviation(strip: RuledStrip, rails: tuple[Curve, Curve], parameters: tuple[Curve, Curve]) -> float:
    """Return the largest distance found between a strip paired anew and points of the surface at like places."""
    r, w = np.linspace(*rails[0].domain, 97)[:, None], np.linspace(0.0, 1.0, 17)[1:-1]
    points = rails[0](r) * (1 - w[:, None]) + rails[1](r) * w[:, None]
    return float(np.linalg.norm(_map_to_surface(strip, parameters, r, w) - points, axis=-1).max())


def _map_to_surface(strip: RuledStrip, parameters: tuple[Curve, Curve] | None, r: Array, w: Array) -> Array:
    """Return the points of the surface that a strip has in the places (r, w), of the shape that these broadcast to."""
    r, w = np.broadcast_arrays(r, w)
    u = r if parameters is None else parameters[0](r)[..., 0] * (1 - w) + parameters[1](r)[..., 0] * w
    low, high = bisect_intervals(
        lambda across: strip.find_fractions(u, across) < w,
        np.full(u.shape, strip.span[0]),
        np.full(u.shape, strip.span[1]),
        steps=52,
    )
    return np.asarray(strip.surface(u, np.where(w > 0, high, low)))
