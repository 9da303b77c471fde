"""Lays the strips of a face flat, with their rulings as they are or paired anew, and maps points of the face to them.

A strip whose rulings are paired anew is another ruled surface between the same rails, over another parameter. So the
mapping of trimming curves to the plane (:mod:`cqblend.patterns.flattening.flat_loops`) asks here where a point of the
face is on its strip.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import isfinite
from typing import Literal

import numpy as np

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flattening.development import strain_from_turn
from cqblend.patterns.flattening.flat_strip import FlatStrip, flatten_rails
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.patterns.strips.band_search import RulingDirection
from cqblend.patterns.strips.developability import RailPair, StripKind, classify_strip
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.ruling_pairing import pair_rulings
from cqblend.patterns.strips.surface_division import divide_along_rulings
from cqblend.patterns.trimming.domain_cells import CutLines
from cqblend.patterns.trimming.trimmed_patch import Patch
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_intervals
from cqblend.unroll_options import Layout, UnrollOptions


@dataclass(frozen=True, slots=True)
class UnrollStrategy:
    """A way to divide a patch and to lay it flat.

    Attributes
    ----------
    direction
        The parameter that runs along the rulings.
    split_right_angles
        Whether strips whose normal turns by a right angle or more along a ruling are divided, too, until they can be
        laid flat.
    layout
        How strips are laid flat.
    """

    direction: Literal["u", "v"]
    split_right_angles: bool = False
    layout: Layout = "smooth"

    def __str__(self) -> str:
        what = (
            ", narrower strips" if self.split_right_angles else ", as triangles" if self.layout == "triangles" else ""
        )
        return f"rulings along {self.direction}{what}"


@dataclass(frozen=True, slots=True, eq=False)
class DividedPatch:
    """A patch divided into strips, and how that came about.

    Attributes
    ----------
    patch
        The patch.
    strips
        None on a plane.
    transposed
        Whether the rulings run along u.
    elber_count, ideal_count
        Numbers of strips by Elber's Algorithm 1 and in the limit of narrow strips, see
        :class:`cqblend.patterns.strips.surface_division.SurfaceDivision`.
    cross_cuts
        By index of the strip: parameters t along the rails, increasing, at which it is cut across so that its pieces
        do not overlap themselves.
    refinement
        Factor by which all tolerances are divided.
    strategy
        How it was divided; None on a plane.
    untried
        Strategies that have not been tried yet, in order.
    failures
        Strategies that have failed, and why.
    width_error
        Why the strips are not as wide as asked, if they are not.
    """

    patch: Patch
    strips: tuple[RuledStrip, ...] = ()
    transposed: bool = False
    elber_count: int = 1
    ideal_count: float = 1.0
    cross_cuts: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    refinement: float = 1.0
    strategy: UnrollStrategy | None = None
    untried: tuple[UnrollStrategy, ...] = ()
    failures: tuple[tuple[UnrollStrategy, CqblendError], ...] = ()
    width_error: CqblendError | None = None

    def choose_layout(self, options: UnrollOptions) -> Layout:
        """Return how its strips are laid flat."""
        return self.strategy.layout if self.strategy else options.layout

    def make_cut_lines(self) -> CutLines:
        """Return the parameter lines that the patch's loops are cut at."""
        return CutLines(self.across_axis, np.array([strip.span[1] for strip in self.strips[:-1]]), self.cross_cuts)

    def cut_across(self, strip_index: int, t: float) -> "DividedPatch":
        """Return the patch with one more cut across a strip, at a parameter along its rails."""
        cuts = tuple(sorted([*self.cross_cuts.get(strip_index, ()), t]))
        return replace(self, cross_cuts={**self.cross_cuts, strip_index: cuts})

    @property
    def extent(self) -> tuple[float, float]:
        """Lengths of the ranges of u and v."""
        (u0, u1), (v0, v1) = self.patch.surface.domain
        return u1 - u0, v1 - v0

    def to_rail_axes(self, uv: Array) -> tuple[Array, Array]:
        """Return the parameters along the rails and across them of points (n, 2)."""
        return (uv[:, 1], uv[:, 0]) if self.transposed else (uv[:, 0], uv[:, 1])

    @property
    def across_axis(self) -> int:
        """The axis of the parameter plane that runs across the strips: 0 for u, 1 for v."""
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
        As it was divided, over the parameter t along its rails.
    rails
        Between which it is ruled now, over a parameter r.
    original_parameters
        t on both rails as functions of r; None where r is t.
    bound
        Distance from the surface, both ways, mm.
    proven
        Whether the bound is certified. That of a new pairing is the largest of a grid of samples, with a margin.
    flat
        The strip in the plane.
    """

    strip: RuledStrip
    rails: RailPair
    original_parameters: tuple[Curve, Curve] | None
    bound: float
    proven: bool
    flat: FlatStrip

    def to_ruled_surface(self) -> Surface:
        """Return the strip as a surface (r, w)."""
        return replace(self.strip, rails=self.rails).to_ruled_surface()

    def map_to_surface(self, points: Array) -> Array:
        """Return the points of the surface, (n, 3), for which points (n, 2) of the plane stand."""
        return _map_to_surface(self.strip, self.original_parameters, *self.flat.to_parameters(points))

    def locate_on_ruling(self, t: Array, across: Array) -> tuple[Array, Array]:
        """Return r and the fraction w of the ruling of points given by the strip's own parameters.

        Of a strip that is paired anew only points on its rails and at its ends can be located.
        """
        start, stop = self.strip.rails[0].domain
        t = np.clip(t, start, stop)
        w = self.strip.find_fractions(t, np.clip(across, *self.strip.span))
        if self.original_parameters is None:
            return t, w
        first, second = self.original_parameters
        return np.where(w < 1, _invert_monotone(first, t), _invert_monotone(second, t)), w


def _invert_monotone(function: Curve, values: Array) -> Array:
    """Return where a function that never decreases takes values, by bisection; the first and the last at its ends."""
    start, stop = function.domain
    _, high = bisect_intervals(
        lambda r: function(r)[..., 0] < values, np.full(values.shape, start), np.full(values.shape, stop)
    )
    ends = function(np.array([start, stop]))[:, 0]
    return np.where(values <= ends[0], start, np.where(values >= ends[1], stop, high))


def bound_strain(strips: Iterable[RuledStrip]) -> float:
    """Bound the relative change of lengths inside strips that are laid flat; infinite where that cannot be done."""
    return max(strain_from_turn(strip.normal_turn) for strip in strips)


def narrow_strips(
    strips: Sequence[RuledStrip], options: UnrollOptions, refinement: float, *, split_right_angles: bool = False
) -> tuple[RuledStrip, ...]:
    """Divide strips along their rails until lengths inside them change little enough when they are laid flat.

    Strain falls with the square of the width. Each part is divided as the whole face was: its bound is certified.

    Parameters
    ----------
    strips
        In order.
    options
        With the largest strain.
    refinement
        Factor by which the tolerance is divided.
    split_right_angles
        Whether strips whose normal turns by a right angle or more along a ruling are divided, too.

    Raises
    ------
    GeometryError
        If some strip cannot be made narrow enough.
    """
    done: list[RuledStrip] = []
    pending = [(strip, 0) for strip in reversed(strips)]
    while pending:
        strip, depth = pending.pop()
        excess = bound_strain([strip]) / options.strain
        if excess <= 1:
            done.append(strip)
            continue
        if not isfinite(excess) and not split_right_angles:
            raise GeometryError(
                f"the strip from {strip.ruling_parameter} = {strip.span[0]:.6g} to {strip.span[1]:.6g} cannot be "
                "laid flat: its "
                "rulings meet between the rails, or its normal turns by more than a right angle along a ruling; divide "
                "it into narrower strips"
            )
        limits = FLATTENING_TOLERANCES
        if depth == (limits.max_depth if isfinite(excess) else limits.max_depth_right_angle):
            change = f"change by {options.strain * excess:.2g}" if isfinite(excess) else "cannot be kept"
            raise GeometryError(
                f"lengths inside a strip {change} when it is laid flat, more than {options.strain:g}, however "
                "narrow it is; allow more strain, or choose another direction"
            )
        count = int(np.clip(np.ceil(np.sqrt(limits.strain_margin * excess)), 2, 16)) if isfinite(excess) else 2
        borders = np.linspace(*strip.span, count + 1)
        jobs: list[tuple[Surface, RulingDirection]] = [
            (strip.surface.clip(v=span), "v") for span in pairwise(borders.tolist())
        ]
        parts: list[RuledStrip] = []
        for found in divide_along_rulings(jobs, options.tolerance / refinement):
            if isinstance(found, GeometryError):
                raise found
            parts += [replace(part, transposed=strip.transposed) for part in found.strips]
        pending += [(part, depth + 1) for part in reversed(parts)]
    return tuple(done)


def unroll_strips(
    face: DividedPatch,
    vertices: Mapping[int, Array],
    options: UnrollOptions,
    known: Mapping[RuledStrip, UnrolledStrip],
) -> dict[int, UnrolledStrip]:
    """Lay strips flat, by their index, with nodes at given vertices (t, across), (n, 2), on each and on its borders.

    Triangles have the nodes of all strips of the face, so that the chords of a rail are the same on both sides. Smooth
    strips that are `known`, laid flat before with other vertices, only get other nodes.
    """
    if face.choose_layout(options) != "triangles":
        return {
            i: _unroll_strip(face, i, corners, np.empty(0), options, known.get(face.strips[i]))
            for i, corners in vertices.items()
        }
    nodes = np.concatenate([corners[:, 0] for corners in vertices.values()])
    unrolled = [_unroll_strip(face, i, corners, nodes, options) for i, corners in vertices.items()]
    finest = max((strip.flat.nodes for strip in unrolled), key=len)
    return {i: _unroll_strip(face, i, corners, finest, options) for i, corners in vertices.items()}


def _unroll_strip(
    face: DividedPatch,
    strip_index: int,
    vertices: Array,
    nodes: Array,
    options: UnrollOptions,
    known: UnrolledStrip | None = None,
) -> UnrolledStrip:
    """Lay a strip flat, with nodes at the vertices (t, across) of its cells, and at given t."""
    strip = face.strips[strip_index]
    t, across = vertices.T
    if options.developable and (np.isin(across, strip.span) | np.isin(t, strip.rails[0].domain)).all():
        paired = _unroll_paired_anew(face, strip, t, options)
        if paired is not None:
            return paired
    wanted = np.unique(np.append(t, nodes))
    if known is not None and known.original_parameters is None:
        return replace(known, flat=known.flat.move_nodes(wanted, options.flat / face.refinement))
    kind = classify_strip(strip.rails)
    turn = strip.normal_turn if kind == "twisted" else 0.0
    flat = _flatten_outward(face, strip.rails, wanted, options, kind, turn)
    return UnrolledStrip(strip, strip.rails, None, strip.bound, True, flat)


def _unroll_paired_anew(
    face: DividedPatch, strip: RuledStrip, t: Array, options: UnrollOptions
) -> UnrolledStrip | None:
    """Pair the rulings of a strip anew, so that it is developable; None if that cannot be done within the tolerance."""
    pairing = pair_rulings(strip.rails)
    if pairing.rails is None or pairing.parameters is None or pairing.rails is strip.rails:
        return None
    bound = FLATTENING_TOLERANCES.sampling_margin * _sample_deviation(strip, pairing.rails, pairing.parameters)
    if bound > options.tolerance:
        return None
    nodes = np.unique([_invert_monotone(one, np.unique(t)) for one in pairing.parameters])
    kind = classify_strip(pairing.rails, pairing.twist)
    if kind == "twisted":
        return None
    flat = _flatten_outward(face, pairing.rails, nodes, options, kind, 0.0)
    return UnrolledStrip(strip, pairing.rails, pairing.parameters, bound, False, flat)


def _flatten_outward(
    face: DividedPatch, rails: RailPair, nodes: Array, options: UnrollOptions, kind: StripKind, normal_turn: float
) -> FlatStrip:
    """Lay a strip of a face flat, of known kind and turn of its normals, with its outer side up."""
    tolerance, layout = options.flat / face.refinement, face.choose_layout(options)
    return flatten_rails(
        rails, tolerance, nodes=nodes, kind=kind, normal_turn=normal_turn, flip=not face.upward, layout=layout
    )


def _sample_deviation(strip: RuledStrip, rails: RailPair, parameters: tuple[Curve, Curve]) -> float:
    """Return the largest distance found between a strip paired anew and points of the surface at like places."""
    r, w = np.linspace(*rails[0].domain, 97)[:, None], np.linspace(0.0, 1.0, 17)[1:-1]
    points = rails[0](r) * (1 - w[:, None]) + rails[1](r) * w[:, None]
    return float(np.linalg.norm(_map_to_surface(strip, parameters, r, w) - points, axis=-1).max())


def _map_to_surface(strip: RuledStrip, parameters: tuple[Curve, Curve] | None, r: Array, w: Array) -> Array:
    """Return the points of the surface for which points (r, w) of the strip stand, of the shape r and w broadcast to.

    That is S(u, v), where u is linear in w along the ruling, and v is found by bisection of the fraction at u.
    """
    r, w = np.broadcast_arrays(r, w)
    u = r if parameters is None else parameters[0](r)[..., 0] * (1 - w) + parameters[1](r)[..., 0] * w
    low, high = bisect_intervals(
        lambda v: strip.find_fractions(u, v) < w,
        np.full(u.shape, strip.span[0]),
        np.full(u.shape, strip.span[1]),
        steps=52,
    )
    return np.asarray(strip.surface(u, np.where(w > 0, high, low)))
