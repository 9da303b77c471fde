"""The figures of Kim and Elber's paper: the examples that redo them make exact blends that are fair."""

import contextlib
import io
import runpy
from functools import cache

import numpy as np
import pytest
from places import EXAMPLES

BLENDS = [
    ("perpendicular_or_not", "perpendicular"),
    ("perpendicular_or_not", "combination"),
    ("varying_length", "varying length"),
    ("warped", "chord"),
    ("warped", "guide"),
    ("two_magnitudes", "8 mm"),
    ("two_magnitudes", "30 mm"),
]


def test_no_example_is_forgotten():
    """Those that make one solid, ``result``, are tested with the documentation."""
    others = [path for path in EXAMPLES.glob("*.py") if "\nblends = " in path.read_text(encoding="utf-8")]
    assert {path.stem for path in others} == set(dict(BLENDS))


@cache
def run(example):
    """Run it as in CQ-editor, and return its variables, what it has shown and what it has printed."""
    shown, printed = [], io.StringIO()
    with contextlib.redirect_stdout(printed):
        made = runpy.run_path(str(EXAMPLES / f"{example}.py"), {"show_object": lambda shape, name: shown.append(shape)})
    return made, shown, printed.getvalue()


def grid(blend, along=401, across=61):
    """Return t, v, and points and partial derivatives on a dense grid, (along, across, 3)."""
    t, v = np.linspace(*blend.surface.domain[0], along), np.linspace(0, 1, across)
    return t, v, *(blend.surface.grid(t, v, *order) for order in ((0, 0), (1, 0), (0, 1)))


def angles(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


@pytest.mark.parametrize("example", dict(BLENDS))
def test_example_prints_its_certificates_and_shows_what_it_made(example):
    made, shown, printed = run(example)
    assert sorted(made["blends"]) == sorted(name for other, name in BLENDS if other == example)
    assert printed.count("valid blend, exact, ") == len(made["blends"])
    (shape,) = shown
    assert len(shape.Faces()) == len(made["primaries"]) + 1
    assert all(face.isValid() for face in shape.Faces())


@pytest.mark.parametrize(("example", "name"), BLENDS)
def test_blend_is_exact(example, name):
    certificate = run(example)[0]["blends"][name].certificate
    assert certificate.valid
    assert certificate.form == "exact"
    assert certificate.gap <= 1e-10
    assert certificate.angle <= 1e-10
    assert certificate.inner_crease <= 1e-9
    assert certificate.direction <= 2e-5
    assert certificate.length <= 1e-3


@pytest.mark.parametrize(("example", "name"), BLENDS)
def test_blend_meets_its_surfaces_by_finite_differences_too(example, name):
    """The step inwards from the rail, of second order, leaves the tangent plane by its square."""
    blend = run(example)[0]["blends"][name]
    for end, rail in enumerate(blend.rails):
        t = np.linspace(*rail.domain, 101)
        u, v = rail.curve(t).T
        h = 1e-4
        (low_u, high_u), (low_v, high_v) = rail.surface.domain
        inside = [np.clip(u - h, low_u, high_u), np.clip(u + h, low_u, high_u)]
        du = rail.surface(inside[1], v) - rail.surface(inside[0], v)
        dv = rail.surface(u, np.clip(v + h, low_v, high_v)) - rail.surface(u, np.clip(v - h, low_v, high_v))
        normal = np.cross(du, dv)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        foot = rail.surface(u, v)
        rise = []
        for step in (1e-3, 5e-4):
            away = blend.surface(t, np.full_like(t, abs(end - step))) - foot
            rise.append(np.abs((away * normal).sum(1)).max() / np.linalg.norm(away, axis=1).min())
        assert rise[0] < 0.02
        assert rise[1] < 0.55 * rise[0]


@pytest.mark.parametrize(("example", "name"), BLENDS)
def test_blend_has_no_folds(example, name):
    """Its normal never vanishes and turns by little from each point of a dense grid to the next ones."""
    _, _, _, along, across = grid(run(example)[0]["blends"][name])
    normal = np.cross(along, across)
    size = np.linalg.norm(normal, axis=-1)
    assert size.min() > 0.05 * size.max()
    for a, b in (
        (normal[1:], normal[:-1]),
        (normal[:, 1:], normal[:, :-1]),
        (normal[1:, 1:], normal[:-1, :-1]),
        (normal[1:, :-1], normal[:-1, 1:]),
    ):
        assert angles(a, b).max() < np.radians(10)


@pytest.mark.parametrize(("example", "name"), BLENDS)
def test_sections_are_fair_and_do_not_cross(example, name):
    """A section bends at most twice, turns by less than a half circle, and its neighbours stay on their own sides."""
    _, _, points, _, across = grid(run(example)[0]["blends"][name])
    assert angles(across[:, 1:], across[:, :-1]).sum(1).max() < np.pi
    step = points[1:] - points[:-1]  # from each section to the next
    sideways = step - (step * across[:-1]).sum(-1, keepdims=True) * across[:-1] / (across[:-1] ** 2).sum(-1)[..., None]
    assert angles(sideways[:, 1:], sideways[:, :-1]).max() < np.radians(15)
    assert np.linalg.norm(sideways, axis=-1).min() > 1e-3


def test_perpendicular_directions_bend_out_of_the_sheets_and_chosen_ones_do_not():
    """Figures 4 and 7."""
    blends = run("perpendicular_or_not")[0]["blends"]
    low, high = ((grid(blends[name])[2][..., 0]) for name in ("perpendicular", "combination"))
    assert low.min() < -1
    assert low.max() > 25
    assert high.min() > -1e-12
    assert high.max() < 24 + 1e-12
    for rail in blends["perpendicular"].rails:
        t = np.linspace(0, 1, 201)
        end = 0.0 if rail is blends["perpendicular"].rails[0] else 1.0
        away = blends["perpendicular"].surface.grid(t, [end], 0, 1)[:, 0]
        assert np.abs(angles(away, rail.curve3d()(t, 1)) - np.pi / 2).max() < 2e-5


def test_length_is_the_scaling_curve_where_the_foot_is_wide_and_narrow():
    """Figure 5."""
    made = run("varying_length")[0]
    blend, k = made["blends"]["varying length"], made["k"]
    t, _, points, _, across = grid(blend)
    width = np.linalg.norm(points[:, -1] - points[:, 0], axis=1)
    assert width.max() > 2 * width.min()
    np.testing.assert_allclose(np.linalg.norm(across[:, 0], axis=1), k(t)[:, 0], rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(across[:, -1], axis=1), 7, rtol=1e-3)
    assert np.corrcoef(width, k(t)[:, 0])[0, 1] > 0.9
    assert np.abs(points[0] - points[-1]).max() < 1e-12


def test_guiding_curves_warp():
    """Figure 6: the cross derivatives are the projections of K, and sections turn out of the planes of the chords."""
    made = run("warped")[0]
    blend = made["blends"]["guide"]
    t = np.linspace(0, 1, 201)
    for end, guide in enumerate((made["turning"], made["leaning"])):
        rail = blend.rails[end]
        u, v = rail.curve(t).T
        normal = np.cross(rail.surface(u, v, 1, 0), rail.surface(u, v, 0, 1))
        wanted = guide(t) - (guide(t) * normal).sum(1)[:, None] / (normal**2).sum(1)[:, None] * normal
        actual = blend.surface.grid(t, [float(end)], 0, 1)[:, 0] * (1 - 2 * end)
        assert angles(actual, wanted).max() < 2e-5
        np.testing.assert_allclose(np.linalg.norm(actual, axis=1), np.linalg.norm(wanted, axis=1), rtol=1e-3)


def test_magnitude_alone_makes_the_neck_narrow():
    """Figure 8."""
    blends = run("two_magnitudes")[0]["blends"]
    wide, narrow = (grid(blends[name])[2] for name in ("8 mm", "30 mm"))
    np.testing.assert_allclose(wide[:, [0, -1]], narrow[:, [0, -1]], rtol=0, atol=1e-12)
    for points, length in ((wide, 8), (narrow, 30)):
        radius = np.hypot(points[..., 1], points[..., 2])
        assert np.ptp(radius, axis=0).max() < 1e-12  # round about the x axis
        rim, waist = radius[0, 0], radius[0, radius.shape[1] // 2]
        assert waist == radius[0].min()
        sine = (14 - abs(points[0, 0, 0])) / 10  # of the latitude of the rails: the slope at which the blend leaves
        assert rim == pytest.approx(10 * np.sqrt(1 - sine**2), rel=1e-12)
        assert waist == pytest.approx(rim - length * sine / 4, rel=1e-12)
