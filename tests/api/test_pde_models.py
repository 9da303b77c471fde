"""The two examples of You and Zhang's paper: what it says of its figures, measured against the surfaces themselves."""

import contextlib
import io
import math
import runpy
import sys
from functools import cache

import numpy as np
import pytest
from places import EXAMPLES
from test_pde_surface import angle, occt_jets

V = np.linspace(0, 2 * math.pi, 401)[:-1]
COS, SIN, ONE = np.cos(V), np.sin(V), np.ones_like(V)


@cache
def run(example):
    """Run it as in CQ-editor, and return its variables, what it has shown and what it has printed."""
    shown, printed = [], io.StringIO()
    with contextlib.redirect_stdout(printed), pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(EXAMPLES), *sys.path])
        made = runpy.run_path(str(EXAMPLES / f"{example}.py"), {"show_object": lambda shape, name: shown.append(shape)})
    return made, shown, printed.getvalue()


def vectors(*components):
    return np.stack(np.broadcast_arrays(*components), axis=-1)


def cone():
    """Return S, Su, Sv, Suu, Svv, Suv of u (9 cos v, 6.5 sin v, -13) at u = 1."""
    r, r_y, h = 9.0, 6.5, -13.0
    zero = vectors(0 * V, 0 * V, 0 * V)
    return (
        vectors(r * COS, r_y * SIN, h * ONE),
        vectors(r * COS, r_y * SIN, h * ONE),
        vectors(-r * SIN, r_y * COS, 0 * V),
        zero,
        vectors(-r * COS, -r_y * SIN, 0 * V),
        vectors(-r * SIN, r_y * COS, 0 * V),
    )


def cylinder():
    """Return the same of an elliptic cylinder that leans by 25 degrees."""
    a, b, alpha = 3.4, 4.4, math.radians(25)
    x, axis = np.array([math.cos(alpha), 0, -math.sin(alpha)]), np.array([math.sin(alpha), 0, math.cos(alpha)])
    y, zero = np.array([0.0, 1.0, 0.0]), vectors(0 * V, 0 * V, 0 * V)
    ring = a * COS[:, None] * x + b * SIN[:, None] * y
    turn = -a * SIN[:, None] * x + b * COS[:, None] * y
    return np.array([2.5, 0, 0]) + axis + ring, axis + zero, turn, zero, -ring, zero


def hyperboloid():
    a, b, h, h0, u = 7.0, 6.4, 6.0, -11.0, 0.45
    c, s = math.cosh(u), math.sinh(u)
    return (
        vectors(a * c * COS, b * c * SIN, h0 + h * s),
        vectors(a * s * COS, b * s * SIN, h * c),
        vectors(-a * c * SIN, b * c * COS, 0),
        vectors(a * c * COS, b * c * SIN, h * s),
        vectors(-a * c * COS, -b * c * SIN, 0),
        vectors(-a * s * SIN, b * s * COS, 0),
    )


def torus():
    ring, tube, u = 8.5, 2.6, -0.45
    c, s = math.cos(u), math.sin(u)
    r = ring + tube * c
    return (
        vectors(r * COS, r * SIN, tube * s),
        vectors(-tube * s * COS, -tube * s * SIN, tube * c),
        vectors(-r * SIN, r * COS, 0),
        vectors(-tube * c * COS, -tube * c * SIN, -tube * s),
        vectors(-r * COS, -r * SIN, 0),
        vectors(tube * s * SIN, -tube * s * COS, 0),
    )


def normal_and_curvature(first, second, aa, bb, ab, normal):
    """Return the curvature tensor in space (n, 3, 3): it bends two surfaces alike if they agree in it."""
    across = np.cross(first, second)
    n = across / np.linalg.norm(across, axis=1)[:, None]
    n *= np.sign((n * normal).sum(1))[:, None]
    size = (across**2).sum(1)[:, None]
    dual = np.stack([np.cross(second, across) / size, np.cross(across, first) / size], axis=1)
    form = np.array([[(aa * n).sum(1), (ab * n).sum(1)], [(ab * n).sum(1), (bb * n).sum(1)]]).transpose(2, 0, 1)
    return n, np.einsum("nip,nij,njq->npq", dual, form, dual)


def measured(blend, primaries):
    """Return, for both sides, the largest gap, angle, and jump of the normal curvature, by OCCT and closed forms."""
    out = []
    for end, primary in enumerate(primaries):
        point, ht, hv, htt, hvv, htv = occt_jets(blend.face(), V, np.full_like(V, end))
        surface = primary()
        normal = np.cross(surface[1], surface[2])
        n, own = normal_and_curvature(ht, hv, htt, hvv, htv, normal)
        m, wanted = normal_and_curvature(surface[1], surface[2], surface[3], surface[4], surface[5], normal)
        gap = np.linalg.norm(point - surface[0], axis=1).max()
        out.append((gap, angle(n, m).max(), np.abs(np.linalg.eigvalsh(own - wanted)).max()))
    return out


@pytest.mark.parametrize(
    ("example", "primaries"),
    [("pde_cone_with_cylinder", (cone, cylinder)), ("pde_hyperboloid_with_torus", (hyperboloid, torus))],
)
def test_orders_keep_what_the_paper_says(example, primaries):
    made, shown, printed = run(example)
    assert shown[0].isValid()
    for order, blend in made["by_order"].items():
        lowest = min(map(int, order.split("+")))
        for (gap, turn, jump), rail in zip(measured(blend, primaries), blend.certificate.rails, strict=True):
            assert gap < 1e-12
            assert (turn < 1e-10) == (lowest >= 4)
            assert turn > 0.05 or lowest >= 4
            assert (jump < 1e-8) == (lowest == 6)
            assert rail.angle == pytest.approx(turn, rel=1e-3, abs=1e-10)
            if lowest >= 4:  # between planes that differ, jumps are measured in different ways
                assert rail.curvature_jump == pytest.approx(jump, rel=1e-2, abs=1e-8)
        assert blend.certificate.valid
        assert blend.certificate.residual < 1e-8
        assert f"| {order} | 1 |" in printed


def test_mixed_orders_are_worse_below_4_and_better_above():
    """Paper, section 4: a higher order for z harms the joint at order 2, and makes it smoother at order 4."""
    blends = run("pde_cone_with_cylinder")[0]["by_order"]
    found = {order: measured(blend, (cone, cylinder)) for order, blend in blends.items()}
    for mixed in ("2+4", "2+6"):
        assert found[mixed][0][1] > 1.4 * found["2"][0][1]
        assert found[mixed][1][1] > found["2"][1][1]
    for side in (0, 1):
        assert 1e-2 < found["4+6"][side][2] < 0.9 * found["4"][side][2]
        assert found["6"][side][2] < 1e-8


def test_order_2_looks_nearly_smooth_where_surfaces_lead_towards_each_other():
    cone_like = measured(run("pde_cone_with_cylinder")[0]["by_order"]["2"], (cone, cylinder))
    bowl_like = measured(run("pde_hyperboloid_with_torus")[0]["by_order"]["2"], (hyperboloid, torus))
    assert max(side[1] for side in bowl_like) < 0.1 < 0.15 < min(side[1] for side in cone_like)


def test_shape_parameters():
    """A larger s draws the middle in; the fairest blend is none of the extremes; the table is printed."""
    made, _, printed = run("pde_shape_parameters")
    blends, hermite = made["by_parameters"], made["hermite"]
    t = np.linspace(0, 2 * math.pi, 201)
    girth = {name: np.ptp(blend.surface.grid(t, [0.5])[:, 0, 1]) for name, blend in blends.items()}
    assert girth["s = 4"] < girth["s = 2"] < girth["s = 1"]
    assert girth["(1, 2, 60)"] < girth["s = 1"] < girth["(1, 40, 1)"]
    fairness = {name: blend.certificate.fairness for name, blend in blends.items()}
    assert min(fairness, key=fairness.get) == "s = 1"
    assert fairness["s = 1"] < hermite.certificate.fairness < fairness["s = 4"]
    apart = np.abs(blends["s = 0.5"].surface.grid(t, t / 7) - hermite.surface.grid(t, t / 7)).max()
    assert apart < 0.1 < np.abs(blends["s = 4"].surface.grid(t, t / 7) - hermite.surface.grid(t, t / 7)).max()
    assert printed.count("fairness") == 7
