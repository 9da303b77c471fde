r"""Ruled strips laid flat, at nodes chosen so that what lies between them is within a tolerance, and rolled back.

The default lays rails and rulings flat with all their lengths (see :mod:`cqblend.patterns.flattening.development`),
exactly if the strip is developable. ``layout="triangles"`` is Elber's strip of triangles. Depends on nothing that joins
strips or trims them.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), section 2, equation (4) and figure 4.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import InputError, shown
from cqblend.patterns.flattening.arc_length import ArcLength
from cqblend.patterns.flattening.complex_plane import to_coordinates
from cqblend.patterns.flattening.development import RulingMotion, develop_rails, strain_from_turn
from cqblend.patterns.flattening.node_refinement import merge_nodes, split_intervals
from cqblend.patterns.flattening.ruling_chart import RulingChart
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.patterns.flattening.triangle_layout import TriangleChart, bound_triangle_error, refine_for_triangles
from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.developability import (
    RailPair,
    StripKind,
    bound_normal_turn,
    check_rails,
    classify_strip,
    stack_rail_and_ruling,
)
from cqblend.splines import Curve
from cqblend.splines.antiderivative import Antiderivative
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Layout


class StripChart(Protocol):
    """The maps between a strip's parameters, the plane, and space."""

    def to_plane(self, t: Array, w: Array) -> Array:
        """Return the points (m,) in the plane, complex, at (t, w)."""

    def to_space(self, points: Array) -> Array:
        """Return where points (m,) of the plane, complex, are in space, (m, 3)."""

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        """Return the (t, w) that are nearest to points (m,) of the plane, complex."""


@dataclass(frozen=True, slots=True, eq=False)
class DevelopedStrip:
    """A strip laid flat by its rulings, before nodes are chosen along its rails.

    Attributes
    ----------
    rail_and_ruling
        C1 and D as one curve of dim 6.
    kind, normal_turn, area_space, area_flat
        As of :class:`FlatStrip`.
    chart
        The maps between parameters, plane and space.
    rail_lengths
        Arc lengths of both rails in space.
    """

    rail_and_ruling: Curve
    kind: StripKind
    normal_turn: float
    area_space: float
    area_flat: float
    chart: RulingChart
    rail_lengths: tuple[ArcLength, ArcLength]


@dataclass(frozen=True, slots=True, eq=False)
class FlatStrip:
    r"""A strip laid flat.

    Attributes
    ----------
    kind
        Of the ruled surface.
    layout
        ``"smooth"`` or ``"triangles"``.
    nodes
        (n,) increasing parameters along the rails.
    first_rail, second_rail
        (n, 2), mm: points of the rails at the nodes, in the plane.
    lengths
        (2, n - 1), mm: of the rails between nodes; arc lengths in space, or chords for ``"triangles"``.
    error
        Mm. For developables the distance of the outline, of arcs between nodes, from the exact one. For twisted strips
        also the distance between the ruled surface and triangles along it: equation (4), from coefficients, and the
        twist of each quadrilateral. There are as many triangles as the tolerance takes, up to 20000 along a rail; they
        need not be between the nodes, because strips of ever narrower triangles have this layout as their limit. For
        ``"triangles"``, whose triangles are between the nodes, the same distance.
    ruling_error
        Largest relative error of a ruling's length at a node.
    normal_turn
        Bound of the angle between the normals at the two ends of a ruling, rad; zero for developables.
    strain
        Largest relative excess of a length inside the strip in the plane over that in space: 1 / cos(normal_turn / 2)
        - 1. Zero for developables; nan for ``"triangles"``.
    area_space, area_flat
        Mm^2: of the ruled surface, and of the flat strip.
    chart
        The maps between parameters, plane and space.
    rail_lengths
        Arc lengths of both rails in space, as functions of the parameter.
    wanted_nodes
        Parameters that were asked to be among the nodes, increasing.
    developed
        The strip before nodes were chosen; None for ``"triangles"``, which depend on their nodes.
    """

    kind: StripKind
    layout: Layout
    nodes: Array
    first_rail: Array
    second_rail: Array
    lengths: Array
    error: float
    ruling_error: float
    normal_turn: float
    strain: float
    area_space: float
    area_flat: float
    chart: StripChart
    rail_lengths: tuple[ArcLength, ArcLength]
    wanted_nodes: Array
    developed: DevelopedStrip | None

    def move_nodes(self, wanted: Array, tolerance: float) -> "FlatStrip":
        """Return a smooth strip with other nodes: wanted ones, increasing, and those that a tolerance (mm) takes."""
        if np.array_equal(wanted, self.wanted_nodes):
            return self
        assert self.developed is not None
        return _choose_nodes(self.developed, wanted, tolerance)

    def __call__(self, t: ArrayLike, w: ArrayLike) -> Array:
        """Return the points in the plane at parameters t along the rails and fractions w of the rulings, (.., 2)."""
        t, w = np.broadcast_arrays(np.asarray(t, dtype=np.float64), np.asarray(w, dtype=np.float64))
        return to_coordinates(self.chart.to_plane(t.ravel(), w.ravel())).reshape(*t.shape, 2)

    def fold(self, points: ArrayLike) -> Array:
        """Roll points (.., 2) of the flat strip back into space, (.., 3).

        Points a little outside are mapped by the continuation of the rulings or triangles next to them.
        """
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, 2)
        return self.chart.to_space(flat[:, 0] + 1j * flat[:, 1]).reshape(*points.shape[:-1], 3)

    def to_parameters(self, points: ArrayLike) -> tuple[Array, Array]:
        """Return the parameters t and the fractions w, within the strip, of points (n, 2) of the plane: (n,) each."""
        x, y = np.asarray(points, dtype=np.float64).T
        t, w = self.chart.to_parameters(x + 1j * y)
        return np.clip(t, self.nodes[0], self.nodes[-1]), np.clip(w, 0.0, 1.0)


def flatten_rails(
    rails: RailPair,
    tolerance: float,
    *,
    nodes: ArrayLike = (),
    kind: StripKind | None = None,
    normal_turn: float | None = None,
    flip: bool = False,
    layout: Layout = "smooth",
) -> FlatStrip:
    r"""Lay the ruled strip between two rails flat.

    Parameters
    ----------
    rails
        C1 and C2: dim 3, one domain, polynomial or rational; one may be a point. The strip is (1 - w) C1(t) + w C2(t).
    tolerance
        Mm, of :attr:`FlatStrip.error`: nodes are added until it is met.
    nodes
        Parameters that are to be among the nodes.
    kind
        Of the strip, where it is known; else see :func:`cqblend.patterns.strips.developability.classify_strip`.
    normal_turn
        See :attr:`FlatStrip.normal_turn`, where it is known.
    flip
        The strip shows the side to which R_t x R_w points, with t to the right and w up where it starts. True mirrors
        it, to show the other side.
    layout
        ``"smooth"``: rails and rulings keep their lengths; isometric if the strip is developable. ``"triangles"``:
        Elber's 2 n triangles between equidistant parameters, along one diagonal, with the lengths of chords.

    Raises
    ------
    InputError
        If an argument is not of that form, or out of range.
    GeometryError
        If there is no strip, if rulings meet inside it, or if more than 20000 segments would be needed.

    References
    ----------
    Elber (1995), section 2.

    Examples
    --------
    >>> from cqblend.splines import Curve
    >>> arc = Curve.bezier([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, np.sqrt(0.5), 1.0])
    >>> flat = flatten_rails((arc, arc + [0, 0, 2]), 0.01)
    >>> flat.kind, len(flat.nodes), bool(abs(flat(1.0, 1.0) - [np.pi / 2, 2]).max() < 1e-14)
    ('cylinder', 2, True)
    """
    rails = check_rails(rails)
    if not (isinstance(tolerance, (int, float)) and isfinite(tolerance) and tolerance > 0):
        raise InputError(f"tolerance {shown(tolerance)}: it must be a positive number")
    if layout not in ("smooth", "triangles"):
        raise InputError(f"layout {shown(layout)}: choose 'smooth' or 'triangles'")
    wanted = np.asarray(nodes, dtype=np.float64).ravel()
    if kind is None:
        kind = classify_strip(rails)
    if normal_turn is None:
        normal_turn = bound_normal_turn(rails) if kind == "twisted" else 0.0
    mirror = -1.0 if flip else 1.0
    if layout == "triangles":
        return _flatten_as_triangles(rails, wanted, tolerance, kind, normal_turn, mirror)
    return _choose_nodes(_develop_strip(rails, kind, normal_turn, mirror), wanted, tolerance)


def _merge_wanted_nodes(rail_and_ruling: Curve, wanted: Array) -> Array:
    """Return the breaks of the rails and wanted nodes, sorted, without those that are next to another one."""
    start, end = rail_and_ruling.domain
    slack = FLATTENING_TOLERANCES.node_merge * (end - start)
    if not np.isfinite(wanted).all() or (wanted < start - slack).any() or (wanted > end + slack).any():
        raise InputError(f"nodes must lie in the rails' domain [{start:.9g}, {end:.9g}], not {shown(wanted)}")
    return merge_nodes(rail_and_ruling.breaks, wanted, slack)


def _develop_strip(rails: RailPair, kind: StripKind, normal_turn: float, mirror: float) -> DevelopedStrip:
    """Lay a strip flat with the lengths of rails and rulings."""
    rail_and_ruling = stack_rail_and_ruling(rails)
    area_flat, area_space = _measure_areas(RulingMotion(rails))
    return DevelopedStrip(
        rail_and_ruling=rail_and_ruling,
        kind=kind,
        normal_turn=normal_turn,
        area_space=area_space,
        area_flat=area_flat if kind == "twisted" else area_space,
        chart=RulingChart(rail_and_ruling, develop_rails(rails, kind), mirror),
        rail_lengths=(ArcLength(rails[0]), ArcLength(rails[1])),
    )


def _choose_nodes(developed: DevelopedStrip, wanted: Array, tolerance: float) -> FlatStrip:
    """Choose nodes along the rails of a strip: wanted ones, and more until arcs follow the flat rails."""
    rail_and_ruling, chart, rail_lengths = developed.rail_and_ruling, developed.chart, developed.rail_lengths
    nodes, error = _refine_nodes(chart, rail_lengths, _merge_wanted_nodes(rail_and_ruling, wanted), tolerance)
    if developed.kind == "twisted":
        error = max(error, bound_triangle_error(rail_and_ruling, nodes, tolerance))
    first, second = chart.map_rails(nodes)
    rulings = np.linalg.norm(rail_and_ruling(nodes)[:, 3:], axis=1)
    return FlatStrip(
        kind=developed.kind,
        layout="smooth",
        nodes=nodes,
        first_rail=to_coordinates(first),
        second_rail=to_coordinates(second),
        lengths=np.stack([_measure_steps(length, nodes) for length in rail_lengths]),
        error=error,
        ruling_error=_max_relative_error(np.abs(second - first), rulings),
        normal_turn=developed.normal_turn,
        strain=strain_from_turn(developed.normal_turn),
        area_space=developed.area_space,
        area_flat=developed.area_flat,
        chart=chart,
        rail_lengths=rail_lengths,
        wanted_nodes=wanted,
        developed=developed,
    )


def _flatten_as_triangles(
    rails: RailPair, wanted: Array, tolerance: float, kind: StripKind, normal_turn: float, mirror: float
) -> FlatStrip:
    """Lay a strip flat as triangles, as many as it takes for these to be close enough to it."""
    rail_and_ruling = stack_rail_and_ruling(rails)
    initial = _merge_wanted_nodes(rail_and_ruling, wanted)
    _, area_space = _measure_areas(RulingMotion(rails, refuse_crossing_rulings=False))
    nodes, error = refine_for_triangles(rail_and_ruling, initial, tolerance)
    chart = TriangleChart.from_rails(rail_and_ruling, nodes, mirror)
    first, second = chart.corners
    rulings = np.linalg.norm(rail_and_ruling(nodes)[:, 3:], axis=1)
    return FlatStrip(
        kind=kind,
        layout="triangles",
        nodes=nodes,
        first_rail=to_coordinates(first),
        second_rail=to_coordinates(second),
        lengths=chart.chord_lengths,
        error=error,
        ruling_error=_max_relative_error(np.abs(second - first), rulings),
        normal_turn=normal_turn,
        strain=np.nan,
        area_space=area_space,
        area_flat=chart.area,
        chart=chart,
        rail_lengths=(ArcLength(rails[0]), ArcLength(rails[1])),
        wanted_nodes=wanted,
        developed=None,
    )


def _measure_areas(motion: RulingMotion) -> tuple[float, float]:
    """Return the area of the flat strip and of that in space, mm^2, integrated together as a complex number."""
    areas = Antiderivative(lambda t: np.dot([1.0, 1j], motion.compute_area_rates(t)), motion.rail_and_ruling.breaks)
    return float(areas.values[-1].real), float(areas.values[-1].imag)


def _measure_steps(length: ArcLength, nodes: Array) -> Array:
    """Return arc lengths between nodes; zero where a rail moves by rounding only."""
    steps = np.diff(length(nodes))
    return np.where(steps > FLATTENING_TOLERANCES.stationary_step * length.length, steps, 0.0)


def _max_relative_error(found: Array, wanted: Array) -> float:
    """Return the largest relative error of lengths, except of those that are zero to rounding."""
    is_real = wanted > FLATTENING_TOLERANCES.zero_ruling * wanted.max()
    return float((np.abs(found - wanted)[is_real] / wanted[is_real]).max())


def _find_bulges(points: Array, middle: Array, lengths: Array) -> Array:
    """Return the bulges (n - 1,) of arcs of given lengths between points (n, 2), on the side of points (n - 1, 2)."""
    chord, to_middle = np.diff(points, axis=0), middle - points[:-1]
    left = chord[:, 0] * to_middle[:, 1] - chord[:, 1] * to_middle[:, 0]
    return np.where(lengths > 0, -np.sign(left) * plane_path.solve_bulges(np.linalg.norm(chord, axis=1), lengths), 0.0)


def _refine_nodes(
    chart: RulingChart, arc_lengths: tuple[ArcLength, ArcLength], nodes: Array, tolerance: float
) -> tuple[Array, float]:
    """Halve intervals between nodes until arcs of the rails' lengths are close enough to the flat rails.

    Returns the nodes, and the largest distance, mm.
    """
    while True:
        error = _measure_arc_error(chart, arc_lengths, nodes, tolerance)
        if error.max() <= tolerance:
            return nodes, float(error.max())
        nodes = split_intervals(nodes, np.where(error <= tolerance, 1, 2), tolerance)


def _measure_arc_error(
    chart: RulingChart, arc_lengths: tuple[ArcLength, ArcLength], nodes: Array, tolerance: float
) -> Array:
    """Return the distances (n - 1,), mm, of the flat rails from arcs of their lengths between nodes.

    Infinite where an arc is longer than the tolerance and so far from its chord that the distance is not reliable.
    """
    count = plane_path.ARC_SAMPLES
    t = nodes[:-1, None] + np.diff(nodes)[:, None] * np.arange(count) / count
    t = np.append(t.ravel(), nodes[-1])
    worst = np.zeros(len(nodes) - 1)
    for arc_length, points in zip(arc_lengths, chart.map_rails(t), strict=True):
        lengths = _measure_steps(arc_length, t[::count])
        flat = to_coordinates(points)
        corners = flat[::count]
        path = Path(corners, _find_bulges(corners, flat[count // 2 :: count], lengths))
        error = plane_path.measure_arc_deviations(path, flat[:-1].reshape(-1, count, 2)[:, 1:])
        is_round = path.chords < FLATTENING_TOLERANCES.longest_arc_chord * lengths
        worst = np.maximum(worst, np.where(is_round & (lengths > tolerance), np.inf, error))
    return worst
