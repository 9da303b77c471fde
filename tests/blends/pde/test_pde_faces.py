"""Surfaces and faces of PDE blends: within the tolerance of the closed forms, and exact at the boundary data."""

import numpy as np
import pytest
from pde_data import DATA, INSIDE, LAPLACE, blend_of, boundary, laplacians, measured, wavy
from pde_witness import hyperboloid_with_torus, occt_jets

import cqblend


@pytest.mark.parametrize("data", DATA)
@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize("tolerance", [1e-7, 1e-9])
@pytest.mark.parametrize("order", [2, 4, 6, (2, 4, 6)])
def test_the_face_is_the_closed_form_within_the_tolerance(data, form, tolerance, order):
    waves = DATA[data]()
    equations = laplacians(order)
    blend = blend_of(waves, equations, form=form, tolerance=tolerance)
    assert blend.form == form
    t = np.linspace(0, 2 * np.pi, 24)
    closed_form = waves.solution(equations, t, INSIDE)
    apart = np.linalg.norm(blend.surface(t[:, None], INSIDE) - closed_form, axis=-1).max()
    assert apart <= tolerance
    tt, vv = (x.ravel() for x in np.meshgrid(t, INSIDE, indexing="ij"))
    points = occt_jets(blend.face(), tt, vv)[0].reshape(closed_form.shape)
    assert np.linalg.norm(points - closed_form, axis=-1).max() <= tolerance


@pytest.mark.parametrize("data", DATA)
@pytest.mark.parametrize("order", [2, 4, 6, (2, 2, 4), (2, 2, 6), (4, 4, 6), (2, 4, 6)])
def test_exact_faces_keep_position_planes_and_curvature_of_the_data(data, order):
    """1e-13 of the size, 1e-10 rad, 1e-7 of 1/size: as much as the lowest order says, and no more."""
    waves = DATA[data]()
    lowest = min(np.atleast_1d(order))
    sides = [boundary(waves, side) for side in (0, 1)]
    blend = cqblend.pde_blend(*sides, order=order, parameters=1.0, form="exact")
    t = np.linspace(0, 2 * np.pi, 120)
    for side in (0, 1):
        gap, angle, jump = measured(blend, waves, side, t)
        record = blend.certificate.rails[side]
        assert gap <= 1e-13 * waves.size()
        assert record.gap <= 1e-13 * waves.size()
        if lowest >= 4:
            assert angle <= 1e-10
            assert record.angle <= 1e-10
        else:
            assert angle > 1e-2
            assert record.angle == pytest.approx(angle, rel=1e-2)
        if lowest == 6:
            assert jump <= 1e-7 / waves.size()
            assert record.curvature_jump <= 1e-7 / waves.size()
        else:
            assert jump > 1e-3
        if lowest == 4:
            assert record.curvature_jump == pytest.approx(jump, rel=1e-2)


@pytest.mark.parametrize(("tolerance", "angular"), [(1e-7, 1e-5), (1e-5, 1e-4)])
@pytest.mark.parametrize("order", [4, 6])
def test_compact_faces_keep_position_and_planes_within_the_tolerances(order, tolerance, angular):
    waves = hyperboloid_with_torus()
    blend = blend_of(waves, [LAPLACE[order]] * 3, form="compact", tolerance=tolerance, angular_tolerance=angular)
    for side in (0, 1):
        gap, angle, _ = measured(blend, waves, side, np.linspace(0, 2 * np.pi, 120))
        assert gap <= tolerance
        assert angle <= angular
        assert blend.certificate.rails[side].gap <= tolerance


def test_what_is_not_known_of_the_data_is_not_a_number():
    """Without derivatives there is no tangent plane to measure against, nor a curvature."""
    waves = wavy()
    for half, known in ((1, (False, False)), (2, (True, False)), (3, (True, True))):
        sides = [boundary(waves, side, half) for side in (0, 1)]
        record = cqblend.pde_blend(*sides, order=2, parameters=1.0).certificate.rails[0]
        assert (np.isfinite(record.angle), np.isfinite(record.curvature_jump)) == known
        assert record.gap < 1e-12
