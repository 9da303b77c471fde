"""What hangs on a swallowed loop goes with it only if nothing of it reaches further."""

from __future__ import annotations

import cadquery as cq
import pytest

import cqblend
from cqblend.errors import SizeError

RADIUS = 5.0


def block() -> cq.Workplane:
    return cq.Workplane().box(40, 30, 10)


def step() -> cq.Workplane:
    return block().union(cq.Workplane().box(10, 30, 30).translate((-15, 0, 10)))


def top_edge(body: cq.Workplane) -> cq.Edge:
    (edge,) = [one for one in body.edges("|Y").vals() if (one.Center() - cq.Vector(20, 0, 5)).Length < 1e-6]
    return edge


def foot(body: cq.Workplane) -> cq.Edge:
    (edge,) = [one for one in body.edges("|Y").vals() if (one.Center() - cq.Vector(-10, 0, 5)).Length < 1e-6]
    return edge


def rod(radius: float, length: float, start, along=(0, 0, 1)) -> cq.Workplane:
    return cq.Workplane(cq.Solid.makeCylinder(radius, length, cq.Vector(*start), cq.Vector(*along)))


def dimple(depth: float) -> cq.Workplane:
    return block().faces(">Z").workplane().center(18, 0).hole(1, depth)


def measure(result: cqblend.BlendResult) -> float:
    found = cqblend.verify(result.shape, result.faces)
    assert found.ok, found.problems
    return found.volume


CONSUMED = {
    "dimple": (lambda: dimple(0.2), top_edge, block),
    "two dimples": (
        lambda: block().faces(">Z").workplane().pushPoints([(18, -5), (18, 5)]).hole(1, 0.3),
        top_edge,
        block,
    ),
    "pocket": (lambda: block().faces(">Z").workplane().center(18, 0).rect(1, 4).cutBlind(-0.3), top_edge, block),
    "hole from face to face": (lambda: block().cut(rod(0.25, 6, (17.2, 0, 7), (1, 0, -1))), top_edge, block),
    "hole along the edge": (lambda: block().cut(rod(0.2, 40, (19.5, -20, 4.5), (0, 1, 0))), top_edge, block),
    "pad in a corner": (lambda: step().union(rod(0.5, 0.5, (-8, 0, 5))), foot, step),
}


@pytest.mark.parametrize("case", CONSUMED)
def test_what_lies_in_the_strip_goes(case):
    """The blended body is the one that never had it."""
    make, pick, plain = CONSUMED[case]
    body, expected = make(), plain()
    assert len(body.val().Faces()) > len(expected.val().Faces())
    result = cqblend.blend_edges(body, pick(body), RADIUS)
    assert " gone" in result.certificate.method
    reference = cqblend.blend_edges(expected, pick(expected), RADIUS)
    assert len(result.shape.Faces()) == len(reference.shape.Faces())
    assert measure(result) == pytest.approx(measure(reference), rel=1e-12)


LIVE = {
    "deep hole": (lambda: dimple(3.0), top_edge, "swallows the rim of face .*, which reaches through it"),
    "boss": (lambda: block().union(rod(0.5, 1, (18, 0, 5))), top_edge, "but face .* stands on it"),
    "dimple in a corner": (lambda: step().cut(rod(0.5, 0.5, (-8, 0, 4.5))), foot, "face .* leads on into the solid"),
    "pin in a corner": (lambda: step().union(rod(0.5, 6, (-8, 0, 5))), foot, "which reaches through it"),
    "hole to the far side": (
        lambda: block().cut(rod(0.4, 12, (18, 0, -6))),
        top_edge,
        "face .* behind it goes on to face|which reaches through it",
    ),
}


@pytest.mark.parametrize("case", LIVE)
def test_what_reaches_further_is_named(case):
    make, pick, message = LIVE[case]
    body = make()
    with pytest.raises(SizeError, match=message) as caught:
        cqblend.blend_edges(body, pick(body), RADIUS)
    assert caught.value.kind == "too large"
    assert 0 < caught.value.room < 1
    measure(cqblend.blend_edges(body, pick(body), 0.98 * caught.value.room * RADIUS))
