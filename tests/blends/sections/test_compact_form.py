"""The compact form: as close to the exact jets as stated, with knots where they jump and few elsewhere."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence

import cadquery as cq
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_surfaces import pairs
from places import BENCHMARKS

import cqblend
from cqblend.blends.sections import compact_form, quintic_fit
from cqblend.blends.sections.blend_surface import build_section
from cqblend.blends.sections.compact_form import compact_jets
from cqblend.blends.sections.tolerances import COMPACT_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, interpolation
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.tensor_surface import TensorSurface

sys.path.insert(0, str(BENCHMARKS))
import irit_table

Jets = list[Curve]
Sides = tuple[Jets, Jets]


def lifted(primary: Primary, uv: Curve) -> Curve:
    """Return a curve in the parameter plane as a tensor product's lifted one."""
    return Curve.stack([1.0 - uv[0], uv[0], 1.0 - uv[1], uv[1]])


def wavy(order: int = 1, moved: float = 0.0) -> Sides:
    """Return the pair of kernel-notes: bicubic 10 x 10 spans, cubic rails, field T1 scaled by .3.

    The poles of the second rail are moved at random by up to ``moved``.
    """
    base = Surface.from_bspline(*irit_table.wavy_data())
    poles = np.array([[0.05, 0.10], [0.40, 0.95], [0.65, 0.05], [0.95, 0.90]])
    shift = moved * np.random.default_rng(0).uniform(-1, 1, poles.shape)
    sides = []
    for surface, bezier, sign in (
        (base, poles, 1),
        (base + np.array([0.3, 0.2, 1.0]), np.clip(poles * [1, -1] + [0, 1] + shift, 0.02, 0.98), -1),
    ):
        primary = TensorSurface.from_spline(surface)
        uv = Curve.bezier(bezier)
        slope = uv.derivative()
        turned = Curve.stack([slope[1], -slope[0]]) * (0.3 * sign)
        direction = Curve.stack([-turned[0], turned[0], -turned[1], turned[1]])
        sides.append(list(primary.compose_jets(lifted(primary, uv), (direction,), order)))
    return sides[0], sides[1]


def on_primary(name: str, order: int = 1) -> Jets:
    """Return jets along a cubic spline rail, whose breaks have tiny jumps, on one of the primaries."""
    pair = pairs()[name]
    t = np.linspace(0, 1, 65)
    square = np.stack([0.5 + 0.3 * np.cos(2 * t), 0.5 + 0.3 * np.sin(3 * t)], -1)
    uv = pair.uv(square)
    c = interpolation.interpolate(t, pair.primary.lift_points(uv))
    rs = 0.2 * np.ptp(uv, axis=0) * np.stack([-1.5 * np.cos(3 * t), -np.sin(2 * t)], -1)
    return list(
        pair.primary.compose_jets(c, (interpolation.interpolate(t, pair.primary.lift_directions(uv, c(t), rs)),), order)
    )


def synthetic(seed: int, order: int, degree: int = 9) -> Jets:
    """Return random homogeneous jets with a weight that varies."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 1, degree + 1)
    base = [np.stack([5 * x, 0 * x, 0 * x, 1 + 0 * x], -1), np.stack([0 * x, 2 + 0 * x, 0 * x, 0 * x], -1)]
    jets = []
    for k in range(order + 1):
        poles = rng.normal(scale=0.3, size=(degree + 1, 4)) + (base[k] if k < 2 else 0)
        jets.append(Curve.bezier(poles))
    return jets


def regular(jets: Jets) -> bool:
    """Tell whether the field is nowhere nearly parallel to the rail, and the rail nowhere nearly stops."""
    t = np.linspace(0, 1, 501)
    velocity = derivative(jets[0], t)
    speed = np.linalg.norm(velocity, axis=1)
    if speed.min() < 0.1 * speed.max() or len(jets) == 1:
        return bool(speed.min() >= 0.1 * speed.max())
    field = euclidean(jets[:2], t)[1]
    return bool(np.all(np.linalg.norm(np.cross(velocity, field), axis=1) > 0.2 * speed * np.linalg.norm(field, axis=1)))


def euclidean(jets: Sequence[Curve], t: np.ndarray) -> np.ndarray:
    """Divide sum J_k v^k / k! by its weight as power series in v: the Euclidean jets (orders, n, 3)."""
    series = [jet(t) / math.factorial(k) for k, jet in enumerate(jets)]
    out: list[np.ndarray] = []
    for k, term in enumerate(series):
        rest = term[:, :3] - sum((series[k - i][:, 3:] * out[i] for i in range(k)), np.zeros((len(t), 3)))
        out.append(rest / series[0][:, 3:])
    return np.stack([x * math.factorial(k) for k, x in enumerate(out)])


def slope(points, t: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """Differentiate by finite differences."""
    return (points(t + h) - points(t - h)) / (2 * h)


def between(jets: Sequence[Curve], fitted: Sequence[Curve], count: int = 20001) -> np.ndarray:
    """Choose parameters all over the domain, none within a finite difference of a break."""
    a, b = jets[0].domain
    t = a + (b - a) * (np.arange(count) + 0.5) / count
    breaks = np.unique(np.concatenate([curve.breaks for curve in (*jets, *fitted)]))
    return t[np.abs(t[:, None] - breaks).min(axis=1) > 2e-6]


def measured(jets: Sequence[Curve], fitted: Sequence[Curve]) -> tuple[float, float, float, list[float]]:
    """Return the largest gap, angle between tangent planes, relative error of T, and errors of the higher jets."""
    t = between(jets, fitted)
    true, rows = euclidean(jets, t), np.stack([row(t) for row in fitted])
    gap = float(np.linalg.norm(rows[0] - true[0], axis=1).max())
    if len(jets) == 1:
        return gap, 0.0, 0.0, []
    wanted = np.cross(slope(lambda x: euclidean(jets[:1], x)[0], t), true[1])
    normal = np.cross(slope(fitted[0], t), rows[1])
    angle = np.arctan2(np.linalg.norm(np.cross(normal, wanted), axis=1), (normal * wanted).sum(1))
    length = np.linalg.norm(true[1], axis=1)
    field = np.linalg.norm(rows[1] - true[1], axis=1) / length
    # normals of the exact derivatives here: finite differences would drown a curvature of 1e-5
    exact_normal = np.cross(derivative(jets[0], t), true[1])
    fitted_normal = np.cross(fitted[0](t, 1), rows[1])
    exact_normal /= np.linalg.norm(exact_normal, axis=1)[:, None]
    fitted_normal /= np.linalg.norm(fitted_normal, axis=1)[:, None]
    size = np.linalg.norm(np.ptp(true[0], axis=0))
    bends = []
    if len(jets) > 2:
        speed = np.linalg.norm(derivative(jets[0], t), axis=1)
        pairs_of = [
            (fitted[0](t, 2), derivative(jets[0], t, 2), speed**2, size),
            (fitted[1](t, 1), slope(lambda x: euclidean(jets[:2], x)[1], t), speed * length, size),
            *((rows[k], true[k], length**k, size ** (k - 1)) for k in range(2, len(jets))),
        ]
        for a, b, scale, power in pairs_of:
            bent = (a * fitted_normal).sum(1) - (b * exact_normal).sum(1)
            bends.append(float(np.abs(bent / scale).max() * power))
    return gap, float(angle.max()), float(field.max()), bends


def derivative(rail: Curve, t: np.ndarray, order: int = 1) -> np.ndarray:
    """Return a derivative of a homogeneous rail by the rational class."""
    return Curve(rail.breaks, rail.coefs, rational=True, continuity=rail.continuity)(t, order)


def poles(fitted: Sides) -> int:
    """Count the poles along the blend, after re-assembly."""
    return len(build_section(fitted).to_bspline()[2])


CASES = {
    "wavy": wavy,
    "wavy, G2": lambda: wavy(2),
    "wavy, G2 and G0": lambda: (wavy(2)[0], wavy(1)[1][:1]),
    "sphere and plane": lambda: (on_primary("sphere"), on_primary("plane")),
    "sphere and torus, G2": lambda: (on_primary("sphere", 2), on_primary("torus", 2)),
    "cone and spline": lambda: (on_primary("cone +0.4, nappe -1"), on_primary("spline 3 x 3")),
    "rational splines": lambda: (on_primary("rational spline 2 x 4"), on_primary("revolved rational spline")),
    "random, G3": lambda: (synthetic(1, 3), synthetic(2, 3)),
    "random, G1 and G2": lambda: (synthetic(3, 1), synthetic(4, 2)),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("tolerance", "angular"), [(1e-4, 1e-3), (1e-7, 1e-5)])
def test_fit_is_within_what_was_asked(name, tolerance, angular):
    sides = CASES[name]()
    fitted = compact_jets(sides, tolerance, angular)
    for jets, rows in zip(sides, fitted, strict=True):
        assert [row.dim for row in rows] == [3] * len(jets)
        assert {row.degree for row in rows} == {5}
        gap, angle, field, bends = measured(jets, rows)
        assert gap <= tolerance
        assert angle <= angular
        assert field <= angular
        assert all(bend <= COMPACT_TOLERANCES.curvature for bend in bends)
    assert all(np.array_equal(row.breaks, fitted[0][0].breaks) for rows in fitted for row in rows)


def next_regular(seed, order):
    """Return the first regular jets from a seed on: two thirds of all are not, too many to filter out."""
    return next(jets for jets in (synthetic(i, order) for i in itertools.count(seed)) if regular(jets))


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), orders=st.tuples(st.integers(0, 3), st.integers(0, 3)))
def test_any_jets_of_any_orders(seed, orders):
    """The same jets at every run: errors are measured at ten points a span, and may be 1 % larger between them."""
    sides = next_regular(seed, orders[0]), next_regular(seed + 1, orders[1])
    for jets, rows in zip(sides, compact_jets(sides, 1e-6, 1e-5), strict=True):
        gap, angle, field, bends = measured(jets, rows)
        assert gap <= 1e-6
        assert max(angle, field) <= 1e-5
        assert all(bend <= COMPACT_TOLERANCES.curvature for bend in bends)


@pytest.mark.parametrize("name", CASES)
def test_ends_are_the_exact_ones_with_two_derivatives(name):
    sides = CASES[name]()
    for jets, rows in zip(sides, compact_jets(sides, 1e-7, 1e-5), strict=True):
        ends = np.array(jets[0].domain)
        inside = ends + np.array([1e-4, -1e-4])
        for true, row in zip(euclidean(jets, ends), rows, strict=True):
            assert np.abs(row(ends) - true).max() <= 4e-16 * max(1.0, np.abs(true).max())
        rounding = 8 * np.finfo(float).eps * np.abs(rows[0].coefs).max() * 5 / np.diff(rows[0].breaks).min()
        assert np.abs(rows[0](ends, 1) - derivative(jets[0], ends)).max() <= rounding
        # second derivatives agree: what is left of C_f - C falls with the third power
        rest = np.linalg.norm(rows[0](inside) - euclidean(jets, inside)[0], axis=1)
        assert rest.max() < 1e-13 + 1e-12 * max(1.0, np.abs(rows[0](ends, 3)).max())


@pytest.mark.parametrize("name", CASES)
def test_pieces_meet_as_smoothly_as_they_say(name):
    for rows in compact_jets(CASES[name](), 1e-7, 1e-5):
        for row in rows:
            inner, scale = row.breaks[1:-1], np.diff(row.breaks)
            h = np.minimum(scale[1:], scale[:-1])
            for k in range(5):
                known = row.continuity >= k
                jump = np.abs(row(inner, k, side="right") - row(inner, k, side="left")).max(axis=1) * h**k
                assert np.all(jump[known] <= 1e-11 * np.abs(row.coefs).max())
            met = row.continuity >= 0
            assert np.array_equal(row.coefs[-1, :, :-1][:, met], row.coefs[0, :, 1:][:, met])


def test_wavy_pair_takes_fewer_poles_than_asked_for_and_a_small_step_file(tmp_path):
    fitted = compact_jets(wavy(), 1e-7, 1e-5)
    assert poles(wavy_exact := wavy()) == 325
    assert max(jet.degree for side in wavy_exact for jet in side) == 18
    assert poles(fitted) <= 100
    path = tmp_path / "wavy.step"
    face = cq.Shape.cast(cqblend.to_face(build_section(fitted)))
    assert face.isValid()
    face.exportStep(str(path))
    assert 20_000 < path.stat().st_size < 100_000


@pytest.mark.parametrize(("order", "most"), [(2, 210), (3, 230)])
def test_wavy_pair_of_higher_order_is_lighter_than_the_exact_one(order, most):
    sides = wavy(order)
    assert poles(compact_jets(sides, 1e-7, 1e-5)) <= most < poles(sides) == 343


@pytest.mark.parametrize("moved", [0.05, 0.1, 0.2])
def test_stretches_are_predicted_so_well_that_few_are_fitted_again(moved, monkeypatch):
    counts: list[int] = []

    def count_spans(exact, stretches):
        counts.append(sum(stretch.spans for stretch in stretches))
        return quintic_fit.fit_stretches(exact, stretches)

    monkeypatch.setattr(compact_form, "fit_stretches", count_spans)
    fitted = compact_jets(wavy(moved=moved), 1e-7, 1e-5)
    assert len(counts) <= 4
    assert sum(counts[1:]) <= counts[0] / 2
    assert poles(fitted) <= 215


def count_poles(chosen, t, spans_per_length, spans_per_jump, extra_poles, forgiven):
    """Count spans and extra poles of multiple knots one stretch after another, in plain Python."""
    total = 0.0
    for i, j in itertools.pairwise(chosen):
        asked = max([*spans_per_length[i:j], *spans_per_jump[i + 1 : j]])
        total += max(1, math.ceil(asked * (t[j] - t[i]) - forgiven)) + extra_poles[j]
    return total


@pytest.mark.parametrize("seed", range(8))
def test_multiple_knots_are_where_they_cost_the_fewest_poles(seed):
    rng = np.random.default_rng(seed)
    n = 9
    t = np.cumsum(rng.uniform(0.2, 1, n))
    asked = rng.uniform(0.1, 4, n - 1), rng.choice([0.0, 1.0, 8.0], n), rng.integers(2, 5, n)
    chosen, spans = compact_form._minimise_poles(t, *asked)
    forgiven = COMPACT_TOLERANCES.forgiven_span_share
    subsets = itertools.chain.from_iterable(itertools.combinations(range(1, n - 1), k) for k in range(n - 1))
    least = min(count_poles((0, *inner, n - 1), t, *asked, forgiven) for inner in subsets)
    assert (chosen[0], chosen[-1]) == (0, n - 1)
    assert count_poles(chosen, t, *asked, forgiven) == least == sum(spans) + asked[2][chosen[1:]].sum()


def test_joints_are_where_the_field_really_jumps():
    fitted = compact_jets(wavy(), 1e-7, 1e-5)
    crossings = wavy()[0][0].breaks[1:-1]
    for rows in fitted:
        for row in rows:
            joints = row.breaks[1:-1][row.continuity < 4]
            assert np.abs(joints[:, None] - crossings).min(axis=1).max() < 1e-12
            assert set(row.continuity.tolist()) <= {1, 2, 4}


@pytest.mark.parametrize("stations", [64, 512])
def test_breaks_of_a_cubic_rail_do_not_become_joints(stations):
    """A cubic rail is a smooth curve with a tiny jump of the third derivative at every station."""
    t = np.linspace(0, 1, stations + 1)
    weight = 1 + 0.2 * t
    plane = interpolation.interpolate(
        t, np.stack([np.cos(2 * t), np.sin(2 * t), 0.2 * t**2, np.ones_like(t)], -1) * weight[:, None]
    )
    up = interpolation.interpolate(t, np.stack([0.1 * t, 0 * t, 1 + 0.1 * t, 0 * t], -1) * weight[:, None])
    fitted = compact_jets(([plane, up], [plane + np.array([0, 0, 1.0, 0]), up]), 1e-7, 1e-5)
    assert set(fitted[0][0].continuity.tolist()) <= {4}
    assert poles(fitted) <= 30


def test_breaks_that_differ_by_rounding_are_one():
    first, second = wavy()
    moved = first[0].breaks.copy()
    moved[1:-1] *= 1 + 4e-16
    assert not np.array_equal(moved, first[0].breaks)
    shifted = [Curve(moved, jet.coefs, continuity=jet.continuity) for jet in first]
    fitted = compact_jets((shifted, second), 1e-7, 1e-5)
    assert np.diff(fitted[0][0].breaks).min() > 1e-4
    assert poles(fitted) <= 100


def test_a_jump_of_a_higher_jet_stays_one_sided():
    """A second jet that jumps, as on faces that are only C1, is not smoothed: each side keeps its own value."""
    rail = Curve.bezier([[0.0, 0, 0, 1], [1, 0, 0.5, 1], [2, 0, 0, 1]]).cut([0.4])
    field = Curve.bezier([[0.0, 1, 0, 0], [0.0, 1, 0.3, 0]]).cut([0.4])
    bend = Curve([0, 0.4, 1], np.array([[[0.0, 0, 1, 0], [0.0, 0, 2, 0]]]).transpose(0, 2, 1), continuity=[-1])
    first, _ = compact_jets(([rail, field, bend], [rail]), 1e-7, 1e-5)
    joint = int(np.flatnonzero(first[2].breaks[1:-1] == 0.4)[0])
    assert first[2].continuity[joint] == -1
    assert first[2](0.4, side="left").tolist() == [0, 0, 1]
    assert first[2](0.4, side="right").tolist() == [0, 0, 2]
    assert first[0].continuity[joint] >= 2


def test_kink_of_a_field_stays_a_kink():
    rail = Curve.bezier([[0.0, 0, 0, 1], [1, 0, 0.5, 1], [2, 0, 0, 1]])
    field = Curve(
        [0, 0.3, 1], np.array([[[0, 1, 0, 0], [0, 1, 1, 0]], [[0, 1, 1, 0], [0, 1, 0.5, 0]]]).transpose(1, 2, 0)
    )
    first, _ = compact_jets(([rail, field], [rail]), 1e-7, 1e-5)
    at = int(np.flatnonzero(first[1].breaks[1:-1] == 0.3)[0])
    assert first[1].continuity[at] == 0
    assert first[0].continuity[at] >= 2
    assert poles((first, first)) <= 20


def test_what_cannot_be_reached_says_so():
    with pytest.raises(GeometryError, match=r"4096 pieces does not reach 1e-30 mm and 1e-05 rad; .*form='exact'"):
        compact_jets((on_primary("sphere"), on_primary("plane")), 1e-30, 1e-5)
