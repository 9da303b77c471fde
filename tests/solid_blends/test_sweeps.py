"""Random bodies of eleven families: every blend is valid by OCCT's own judgement, or an error says why there is none.

The draws are those of ``benchmarks/bodies.py``, fixed before the code they try; the benchmarks run many more of them.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from functools import cache

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from places import BENCHMARKS
from spline_witness import along_edge

import cqblend
from cqblend.brep.verification.brep_check import find_flaws
from cqblend.errors import CqblendError

PATH = BENCHMARKS / "bodies.py"
DRAWS = 8
EXACT_DRAWS = 3

spec = importlib.util.spec_from_file_location("cqblend_benchmark_bodies", PATH)
assert spec is not None
assert spec.loader is not None
bodies = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = bodies
spec.loader.exec_module(bodies)

families = pytest.mark.parametrize("family", bodies.FAMILIES, ids=lambda family: family.__name__)


@cache
def case(family, number):
    return bodies.draw(family, number)


def is_convex(body, edge) -> bool:
    """Whether the faces bulge at an edge: then steps along either difference of their normals leave the body."""
    point = edge.positionAt(0.4)
    first, second = (face.normalAt(point) for face in edge.ancestors(body, "Face").Faces())
    step = (first - second).normalized() * 1e-3
    return not body.isInside(point + step, 1e-7) and not body.isInside(point - step, 1e-7)


def measured(result) -> tuple[float, float, float]:
    """Measure gap, angle and edge tolerance of the blend against its two neighbours along the rails."""
    (blend,) = (f for f in result.shape.Faces() if any(f.isSame(b) for b in result.faces))
    neighbours = {rail.face for rail in result.certificate.rails}
    assert len(neighbours) == 2
    gap = angle = tolerance = 0.0
    smooth = 0
    for edge in blend.Edges():
        tolerance = max(tolerance, BRep_Tool.Tolerance_s(edge.wrapped))
        others = [f for f in edge.ancestors(result.shape, "Face").Faces() if not f.isSame(blend)]
        if not others or BRep_Tool.Continuity_s(edge.wrapped, blend.wrapped, others[0].wrapped).value == 0:
            continue
        smooth += 1
        first, last = BRep_Tool.Range_s(edge.wrapped)
        parameters = (first + (last - first) * (np.arange(60) + 0.37) / 60).tolist()
        (p, n), (q, m) = (along_edge(face, edge, parameters) for face in (blend, others[0]))
        gap = max(gap, float(np.linalg.norm(p - q, axis=1).max()))
        turn = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.abs((n * m).sum(1)))
        angle = max(angle, float(turn.max()))
    assert smooth >= 2
    return gap, angle, tolerance


def sweep(family, count: int, form: str, angle: float, gap: float) -> None:
    failed = []
    for number in range(count):
        one = case(family, number)
        try:
            result = cqblend.blend_edges(one.body, one.edge, one.radius, form=form)
        except CqblendError as error:
            failed.append(f"{one.name} {number}: {type(error).__name__}: {error}")
            continue
        name = f"{one.name} {number}"
        assert not find_flaws(result.shape.wrapped), name
        assert result.shape.isInside(one.edge.positionAt(0.4), 1e-9) != is_convex(one.body, one.edge), name
        found = measured(result)
        assert found[0] <= gap, name
        assert found[1] <= angle, name
        assert found[2] <= 5e-7, name
        assert result.certificate.gap <= gap, name
        assert result.certificate.angle <= angle, name
        assert math.isfinite(result.certificate.inner_crease), name
    assert len(failed) <= count // DRAWS, failed


@pytest.mark.slow
@families
def test_blends_are_valid_and_within_their_tolerances(family):
    sweep(family, DRAWS, "auto", angle=1e-5, gap=1e-7)


@pytest.mark.slow
@families
def test_exact_blends_are_exact(family):
    sweep(family, EXACT_DRAWS, "exact", angle=1e-9, gap=1e-7)
