"""Shape parameters that are functions along edges: what they are called with, and what they change."""

import cadquery as cq
import numpy as np
import pytest

import cqblend
from cqblend.errors import InputError


def stadium():
    """Return a body whose upper rim is one closed chain of lines and arcs."""
    return cq.Workplane().slot2D(40, 20).extrude(10)


def crossed():
    """Return a leaning pipe out of a ball, and the closed edge between them."""
    ball = cq.Workplane().sphere(10)
    pipe = cq.Workplane(cq.Solid.makeCylinder(4.5, 20, cq.Vector(0, 0, 0), cq.Vector(1, -0.15, 0.1)))
    body = ball.union(pipe)
    return body, body.edges(cq.NearestToPointSelector((9, -4, 0)))


class Recorded:
    """A function of t that remembers what it was called with."""

    def __init__(self, function):
        self.function, self.t = function, np.empty(0)

    def __call__(self, t):
        self.t = np.concatenate([self.t, np.ravel(t)])
        return self.function(t)


def round_and_round(t):
    return 1 + 0.4 * np.cos(2 * np.pi * t)


@pytest.mark.parametrize("order", [4, 6])
def test_around_a_closed_edge(order):
    body, edge = crossed()
    given = Recorded(round_and_round)
    result = cqblend.blend_edges(body, edge, 3, section="pde", order=order, parameters=given)
    assert result.certificate.valid
    assert result.certificate.angle < 1e-10
    assert 0 <= given.t.min() < 0.01
    assert 0.99 < given.t.max() <= 1
    plain = cqblend.blend_edges(body, edge, 3, section="pde", order=order)
    assert abs(result.certificate.fairness - plain.certificate.fairness) > 1e-5


def test_cells_of_a_chain_get_their_share():
    body = stadium()
    given = Recorded(round_and_round)
    result = cqblend.blend_edges(body, body.faces(">Z").edges(), 2, section="pde", parameters=(1, given, 1))
    assert result.certificate.valid
    assert len(result.faces) == 4
    assert 0 <= given.t.min() < 0.01
    assert 0.99 < given.t.max() <= 1
    assert np.diff(np.unique(given.t)).max() < 0.01
    assert result.certificate.angle < 1e-10
    assert max(edge.angle for edge in result.certificate.edges) < 1e-10
    assert max(edge.gap for edge in result.certificate.edges) < 1e-9


def test_along_an_open_edge_they_run_from_its_start_to_its_end():
    box = cq.Workplane().box(30, 20, 10)
    given = Recorded(lambda t: 0.3 + t)
    result = cqblend.blend_edges(
        box, box.edges("|Z and >X and >Y"), lambda t: 1 + 3 * t, section="pde", order=2, parameters=given
    )
    assert result.certificate.valid
    assert (given.t.min(), given.t.max()) == (0, 1)


def test_functions_that_do_not_close_are_refused():
    body, edge = crossed()
    with pytest.raises(InputError, match="at the start of closed rails"):
        cqblend.blend_edges(body, edge, 3, section="pde", parameters=lambda t: 1 + t)
