"""Proofs of arcs bound what is measured, and see what is off by as little as rounding allows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arc_cases import RADIUS, fit_ribbons, make_edges

from cqblend.blends.quality.arc_proof import prove_arc_side
from cqblend.blends.sections.arc_blend import blend_by_arcs
from cqblend.blends.sections.arc_section import ArcSection
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.surfaces.vectors import LocalFrame


def measure(blend: BlendSurface, arc: ArcSection, end: int) -> tuple[float, float]:
    """Return the gap and the angle between arcs and the surface of a rail, by the closed forms of both."""
    s, ribbon = np.linspace(0, arc.length, 101), blend.ribbons[end]
    own = arc.surface.jet(arc.map_to_surface(s, np.full(101, float(end))))
    other = ribbon.primary.jet(ribbon.find_native_parameters(arc.map_to_parameters(s)))
    normals = [np.cross(jet[1], jet[2]) for jet in (own, other)]
    unit = [normal / np.linalg.norm(normal, axis=1)[:, None] for normal in normals]
    gap = np.linalg.norm(own[0] - other[0], axis=1).max()
    return float(gap), float(np.arcsin(np.linalg.norm(np.cross(*unit), axis=1)).max())


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("name", make_edges())
def test_bounds_are_near_to_rounding(name, end):
    blend = blend_by_arcs(fit_ribbons(name), RADIUS)
    proof = prove_arc_side(blend, blend.arc, end, 0.0, 0.0)
    gap, angle = measure(blend, blend.arc, end)
    assert gap <= proof.gap < 1e-11
    assert angle <= proof.angle < 1e-10


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-4])
@pytest.mark.parametrize("name", make_edges())
def test_a_surface_that_is_moved_and_turned_shows(name, size):
    blend = blend_by_arcs(fit_ribbons(name), RADIUS)
    arc, rng = blend.arc, np.random.default_rng(4)
    axes = np.linalg.qr(arc.surface.frame.axes + size * rng.normal(size=(3, 3)))[0]
    axes = axes * np.sign((axes * arc.surface.frame.axes).sum(axis=1))[:, None]
    frame = LocalFrame(arc.surface.frame.origin + size * rng.normal(size=3), axes)
    moved = replace(arc, surface=replace(arc.surface, frame=frame))
    for end in (0, 1):
        proof = prove_arc_side(blend, moved, end, 0.0, 0.0)
        gap, angle = measure(blend, moved, end)
        assert size / 30 < gap <= proof.gap < 1000 * size
        assert angle <= proof.angle < 1000 * size


def test_what_a_pcurve_is_off_is_added():
    blend = blend_by_arcs(fit_ribbons("rod"), RADIUS)
    clean, off = (prove_arc_side(blend, blend.arc, 0, *errors) for errors in ((0.0, 0.0), (1e-7, 1e-6)))
    assert off.gap == pytest.approx(clean.gap + 1e-7, rel=1e-9)
    assert off.angle == pytest.approx(clean.angle + 1e-6, rel=1e-9)
