"""Least-squares systems by spans, against NumPy's solution of the whole system at once."""

import numpy as np
import pytest

from cqblend.blends.pde.span_system import SpanSystem


def random_system(spans, width, m, fixed, seed, rows=None):
    rng = np.random.default_rng(seed)
    rows = 2 * width * m if rows is None else rows
    free = np.ones(spans + width - 1, bool)
    free[:fixed] = free[len(free) - fixed :] = False
    scale = 10.0 ** rng.uniform(-6, 6, m)  # bubbles differ by as much
    return SpanSystem(rng.normal(size=(spans, rows, width, m)) * scale, rng.normal(size=(spans, rows, 2)), free)


def whole_solution(system):
    """Return the unknowns (count, m, c) of the same system as one dense matrix, and the norm of what they take."""
    spans, rows, width, m = system.blocks.shape
    matrix = np.zeros((spans * rows, len(system.free), m))
    for k, block in enumerate(system.blocks):
        matrix[k * rows : (k + 1) * rows, k : k + width] = block
    matrix = matrix[:, system.free].reshape(spans * rows, -1)
    size = np.linalg.norm(matrix, axis=0)
    found = np.linalg.lstsq(matrix / size, system.rights.reshape(spans * rows, -1), rcond=None)[0] / size[:, None]
    out = np.zeros((len(system.free), m, 2))
    out[system.free] = found.reshape(-1, m, 2)
    return out, np.linalg.norm(matrix @ found, axis=0)


@pytest.mark.parametrize("fixed", [0, 1, 3])
@pytest.mark.parametrize(("spans", "width", "m"), [(1, 8, 3), (5, 6, 4), (12, 4, 1), (9, 8, 5)])
def test_span_by_span_is_all_at_once(spans, width, m, fixed):
    system = random_system(spans, width, m, fixed, seed=spans)
    wanted, norm = whole_solution(system)
    size = np.abs(wanted).max(axis=(0, 2))[:, None]
    assert np.abs((system.solution - wanted) / size).max() < 1e-12
    np.testing.assert_allclose(system.solution_norm, norm, rtol=1e-12)


def test_few_rows_of_a_span_are_enough_where_all_of_them_are():
    system = random_system(30, 6, 3, 1, seed=4, rows=5)  # 150 rows for 99 unknowns, 5 for the first 15 of them
    wanted, _ = whole_solution(system)
    assert np.abs(system.solution - wanted).max() < 1e-9 * np.abs(wanted).max()
