"""What reports of patterns claim, against dense measurements that share nothing with them.

Surfaces are evaluated in long doubles by Cox and de Boor's recursion, strips and pieces are those that are returned;
distances of strips in space are OCCT's.
"""

from itertools import pairwise

import cadquery as cq
import numpy as np
import pytest
from unroll_witness import dense, distance, faces_of, length, lengths, points_on

import cqblend
from cqblend.splines import Surface

LONG = np.longdouble
MOST = 5
OFFSETS = (0.0, 1.0, 1e2, 1e3, 1e4, 1e5)


def basis(degree, knots, t):
    """B-spline basis functions (n, poles), in long doubles."""
    knots = np.asarray(knots, LONG)
    count = len(knots) - degree - 1
    span = np.clip(np.searchsorted(knots, t, "right") - 1, degree, count - 1)
    values = np.zeros((len(t), len(knots) - 1), LONG)
    values[np.arange(len(t)), span] = 1
    for p in range(1, degree + 1):
        rise, fall = knots[p:-1] - knots[: -p - 1], knots[p + 1 :] - knots[1:-p]
        left = np.divide(t[:, None] - knots[: -p - 1], rise, out=np.zeros((len(t), len(rise)), LONG), where=rise > 0)
        right = np.divide(knots[p + 1 :] - t[:, None], fall, out=np.zeros((len(t), len(fall)), LONG), where=fall > 0)
        values = left * values[:, :-1] + right * values[:, 1:]
    return values


def evaluator(surface):
    """Points (n, 3) of a surface at parameters (n,), in long doubles."""
    (p, q), (u_knots, v_knots), poles, weights = surface.to_bspline()
    poles = np.asarray(poles, LONG)
    weights = np.ones(poles.shape[:2], LONG) if weights is None else np.asarray(weights, LONG)

    def points(u, v):
        u, v = np.broadcast_arrays(np.asarray(u, LONG), np.asarray(v, LONG))
        along, across = basis(p, u_knots, u.ravel()), basis(q, v_knots, v.ravel())
        both = along[:, :, None] * across[:, None, :] * weights
        found = np.einsum("nij,ijd->nd", both, poles) / both.sum(axis=(1, 2))[:, None]
        return found.reshape(*u.shape, 3)

    return points


def random_surface(seed):
    """A patch of random degrees and knots, polynomial, rational or ruled, near the origin or up to 1e5 from it."""
    rng = np.random.default_rng(seed)
    p, q = rng.integers(1, 6), rng.integers(1, 5)
    nu, nv = p + 1 + rng.integers(0, 4), q + 1 + rng.integers(0, 4)

    def knots(degree, count):
        return [*[0.0] * (degree + 1), *np.sort(rng.uniform(0.05, 0.95, count - degree - 1)), *[1.0] * (degree + 1)]

    x, y = np.meshgrid(np.linspace(0, 1, nu), np.linspace(0, 1, nv), indexing="ij")
    z = rng.uniform(0, 0.4) * np.sin(3 * x + rng.uniform(0, 6)) + rng.uniform(0, 0.4) * np.cos(
        2 * y + rng.uniform(0, 6)
    )
    poles = np.stack([x, y * rng.uniform(0.3, 1.5), z], axis=-1) + rng.normal(0, 0.02, (nu, nv, 3))
    size = 10 ** rng.uniform(0, 2.5)
    away = rng.normal(size=3)
    weights = rng.uniform(0.5, 2, (nu, nv)) if seed % 3 == 1 else None
    poles = poles * size + OFFSETS[seed % 6] * away / np.linalg.norm(away)
    return Surface.from_bspline((int(p), int(q)), (knots(p, nu), knots(q, nv)), poles, weights), size


def turned(first, second):
    """Angles between vectors (n, 3)."""
    return np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1))


def check_strip(source, record):
    """Deviation, angle, strain and areas of a strip against what its record says; what lengths are in the plane."""
    unrolled = source.unrolled_strip
    surface, ruled = evaluator(unrolled.strip.surface), evaluator(source.to_trimmed_surface().surface)
    (t0, t1), rng = source.to_trimmed_surface().surface.domain[0], np.random.default_rng(0)
    # both directions at once: rulings are parallel to the parameter lines and the fractions go from 0 to 1
    if unrolled.original_parameters is None:
        t, v = np.meshgrid(np.linspace(t0, t1, 67), np.linspace(*unrolled.strip.span, 17), indexing="ij")
        off = surface(t, v) - ruled(t, unrolled.strip.find_fractions(t, v))
        assert np.sqrt((off**2).sum(axis=-1)).max() <= record.bound
    h = LONG(1e-6) * (t1 - t0)
    t = np.linspace(t0, t1, 301)[1:-1]
    rulings = ruled(t, 1.0) - ruled(t, 0.0)
    speeds = [ruled(t + h, w) - ruled(t - h, w) for w in (0.0, 1.0)]
    normals = [np.cross(speed, rulings).astype(float) for speed in speeds]
    sizes = np.array([np.linalg.norm(normal, axis=1) for normal in normals])
    clear = sizes.min(axis=0) > 1e-6 * sizes.max()  # where no rail stands still
    assert turned(*(normal[clear] for normal in normals)).max(initial=0.0) <= record.twist + 1e-8
    # lengths in the plane and in space, in many directions
    t, w = rng.uniform(t0 + 1e-3 * (t1 - t0), t1 - 1e-3 * (t1 - t0), 200), rng.uniform(0.01, 0.99, 200)
    step, part = 1e-4 * (t1 - t0), 1e-4
    smooth = (
        np.abs(t[:, None] - source.to_trimmed_surface().surface.breaks[0]).min(axis=1) > step
    )  # rails may have kinks
    t, w = t[smooth], w[smooth]
    flat = [
        unrolled.flat(t + step, w) - unrolled.flat(t - step, w),
        unrolled.flat(t, w + part) - unrolled.flat(t, w - part),
    ]
    space = [ruled(t + step, w) - ruled(t - step, w), ruled(t, w + part) - ruled(t, w - part)]
    ratio = np.linalg.norm(space[0].astype(float), axis=1) / np.linalg.norm(space[1].astype(float), axis=1)
    reach = np.abs(unrolled.flat(t, w)).max() + np.abs(unrolled.rails[0](t)).max()
    noise = 1e-9 + 1e-15 * reach / np.linalg.norm(flat, axis=2).min()
    for angle in np.linspace(0, np.pi, 13):
        cos, sin = np.cos(angle), np.sin(angle) * ratio[:, None]
        grown = [np.linalg.norm((cos * along + sin * across).astype(float), axis=1) for along, across in (flat, space)]
        assert np.abs(grown[0] / grown[1] - 1).max() <= record.strain + 3e-7 + noise
    # area in space
    nodes, weights = np.polynomial.legendre.leggauss(12)
    area, breaks = 0.0, np.unique(source.to_trimmed_surface().surface.breaks[0])
    for low, high in pairwise(breaks):
        for start, stop in pairwise(np.linspace(low, high, 7)):
            t, w = np.meshgrid((start + stop + nodes * (stop - start)) / 2, (1 + nodes) / 2, indexing="ij")
            tiny = LONG(1e-5) * (stop - start)
            along, across = ruled(t + tiny, w) - ruled(t - tiny, w), ruled(t, 1.0 + 0 * t) - ruled(t, 0.0 * t)
            rate = np.linalg.norm(np.cross(along, across).astype(float), axis=-1) / float(2 * tiny)
            area += (weights[:, None] * weights / 4 * rate).sum() * (stop - start)
    assert record.area == pytest.approx(area, rel=1e-7)
    assert abs(record.flat_area / record.area - 1) <= 2 * record.strain + 1e-9


def check_border(source, piece, record):
    """Points of the piece's outline, rolled, are on the strip or as far from it as the record says."""
    unrolled, ruled = source.unrolled_strip, evaluator(source.to_trimmed_surface().surface)
    t = np.linspace(*source.to_trimmed_surface().surface.domain[0], 2001)
    rails = [ruled(t, np.full(len(t), w)).astype(float) for w in (0.0, 1.0)]
    for _, _, run in piece.runs():
        flat = dense(run.path.points, run.path.bulges, 6)
        _, w = unrolled.flat.chart.to_parameters(flat[:, 0] + 1j * flat[:, 1])
        beyond = np.flatnonzero((w < -1e-9) | (w > 1 + 1e-9))
        folded = unrolled.flat.fold(flat[beyond]) if len(beyond) else ()
        for point, side in zip(folded, w[beyond] > 0.5, strict=True):
            start, step = rails[int(side)][:-1], np.diff(rails[int(side)], axis=0)
            part = np.clip(((point - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300), 0, 1)
            off = np.linalg.norm(point - start - part[:, None] * step, axis=1).min()
            assert off <= record.error * (1 + 1e-4) + 1e-11  # the rail is a polygon here


def check_pattern(pattern):
    report = pattern.report
    sources = pattern._unrolled.sources
    looked_at = np.unique(np.linspace(0, len(sources) - 1, MOST).astype(int))  # the others are alike
    for i, (source, record, piece) in enumerate(zip(sources, report.pieces, pattern.strips, strict=True)):
        if source.unrolled_strip is not None and i in looked_at:
            check_strip(source, record)
            check_border(source, piece, record)
        around = sum(length(run.path.points, run.path.bulges) for _, _, run in piece.runs())
        assert record.width == pytest.approx(2 * piece.area / around, rel=1e-12)
    for seam in pattern.seams:
        sides = [lengths(path.points, path.bulges).sum() for path in (pattern.pieces.run(s).path for s in seam.sides)]
        assert abs(sides[0] - sides[1]) <= report.seam_mismatch * max(sides)


@pytest.mark.parametrize("seed", range(18))
def test_every_bound_holds_on_random_surfaces(seed):
    surface, size = random_surface(seed)
    rng = np.random.default_rng(seed)
    options = {"direction": ("auto", "u", "v")[seed % 3], "even": seed % 4 == 3}
    pattern = cqblend.unroll(surface, size * 10 ** rng.uniform(-2.5, -1.3), strain=0.05, **options)
    check_pattern(pattern)


def drilled_sphere():
    return cq.Solid.makeSphere(9, angleDegrees1=-90).cut(cq.Solid.makeCylinder(2, 40, cq.Vector(3, 1, -20)))


def lofted():
    return cq.Workplane().circle(5).workplane(offset=4).circle(6).workplane(offset=4).circle(3).loft().val()


SHAPES = {
    "cone": lambda: cq.Solid.makeCone(8, 3, 12),
    "oblique cone": lambda: cq.Solid.makeCone(8, 0, 12).cut(cq.Solid.makeBox(9, 30, 30, cq.Vector(2, -15, -1))),
    "ruled loft": lambda: cq.Workplane().rect(9, 6).workplane(offset=8).circle(4).loft(ruled=True).val(),
    "smooth loft": lofted,
    "drilled sphere": drilled_sphere,
    "tiles": lambda: cq.Workplane().box(9, 7, 5).edges("|Z").fillet(2).val(),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("away", [0.0, 1e5])
def test_every_bound_holds_on_solids(name, away):
    shape = SHAPES[name]().moved(cq.Location((away, -0.7 * away, 0.2 * away), (1, 2, 3), 25))
    pattern = cqblend.unroll(shape, 0.2)
    check_pattern(pattern)
    report, faces, rng = pattern.report, faces_of(shape.wrapped), np.random.default_rng(5)
    rounding = 1e-15 * away  # of the points themselves, which are doubles
    for source, record in zip(pattern._unrolled.sources, report.pieces, strict=True):
        strip = cqblend.api.flat_pattern.wrap_like(shape, source_face(source))
        for point in points_on(faces_of(strip.wrapped)[0], 3, rng):
            assert min(distance(point, faces[k - 1]) for k in record.faces) <= record.bound + 4 * rounding
    for areas in report.areas:
        exact = sum(cq.Shape.cast(faces[k - 1]).Area() for k in areas.faces)
        assert areas.face == pytest.approx(exact, rel=2e-4)
    assert report.area == pytest.approx(sum(areas.pieces for areas in report.areas), rel=1e-12)
    assert report.face_area == pytest.approx(sum(areas.face for areas in report.areas), rel=1e-12)


def source_face(source):
    """The strip or plane of a piece, trimmed, as a face of its own."""
    from cqblend.brep.conversion.pattern_shapes import sew_strip_faces

    return sew_strip_faces([source.to_trimmed_surface()], 1e-6)
