"""Blends of networks with mitres, made below the pipeline, and the volumes of prisms with mitred edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cqblend.blend_options import BlendOptions
from cqblend.brep.selection.blend_corners import find_mitres
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.certificate import Certificate
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.size_assignment import assign_sizes
from cqblend.solid_blends.solid_rewriting import DraftedNetwork, rewrite_solid
from cqblend.solid_blends.strip_context import StripContext


@dataclass(frozen=True)
class MitredSolid:
    """A blended solid, its blend faces, and their certificate."""

    shape: cq.Shape
    faces: tuple[cq.Face, ...]
    certificate: Certificate


def blend_with_mitres(body: cq.Shape, edges: Sequence[cq.Edge], radius, **options) -> MitredSolid:
    """Blend edges of a body with mitres wherever two of them and another edge meet, in one pass."""
    sizes = {edge.wrapped: size for edge, size in radius.items()} if isinstance(radius, dict) else radius
    request = BlendOptions(sizes, **options).to_request()
    picked = [edge.wrapped for edge in edges]
    networks = []
    for found in select_chains(body.wrapped, picked, None, lambda _: 0.0, follow=request.chain).networks:
        contexts = []
        for one in found:
            assert one.chain is not None
            requests = assign_sizes(request, one.chain, one.edges)
            cells = zip(one.chain.cells, requests, strict=True)
            contexts.append(
                ChainContext(one.chain, tuple(StripContext(cell, choose_section_method(own)) for cell, own in cells))
            )
        corners = find_mitres([context.chain for context in contexts])
        networks.append(DraftedNetwork([n for one in found for n in one.edges], contexts, corners))
    rewritten = rewrite_solid(networks[0].index, networks)
    strips = [strip for network in networks for strip in rewritten.strips[network]]
    return MitredSolid(
        cq.Shape.cast(rewritten.solid),
        tuple(cq.Face(strip.face) for strip in strips),
        Certificate.merge([strip.certificate for strip in strips]),
    )


def integrate_insets(outline: Sequence[tuple[float, float]], radii: Sequence[float]) -> float:
    """Return by how much the area of an outline shrinks, integrated over the depth, if edges are rounded by radii.

    Edge k runs from corner k to the next one, counter-clockwise. At depth z, it is moved inside by what an arc of its
    radius takes away there, and neighbours meet where their lines cross: which is what a mitre is, at convex corners
    and at reflex ones.
    """
    corners = np.array(outline)
    rates = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-rates[:, 1], rates[:, 0]], axis=1) / np.linalg.norm(rates, axis=1, keepdims=True)
    heights = (normals * corners).sum(axis=1)
    sizes = np.array(radii)

    def measure_area(depth: float) -> float:
        below = np.clip(sizes - depth, 0.0, None)
        moved = heights + sizes - np.sqrt(sizes**2 - below**2)
        points = np.array([np.linalg.solve(normals[[k - 1, k]], moved[[k - 1, k]]) for k in range(len(corners))])
        x, y = points.T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2

    whole = measure_area(float(sizes.max()))
    return integrate_by_angle(lambda depth: whole - measure_area(depth), np.unique(sizes))


def integrate_by_angle(function: Callable[[float], float], stops: Sequence[float]) -> float:
    """Integrate a function from 0 to the last of some stops that behaves like a root at 0 and at each of them."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in zip([0.0, *stops[:-1]], stops, strict=True):
        angle = (nodes + 1) * np.pi / 2
        depths = (low + high) / 2 - (high - low) / 2 * np.cos(angle)
        values = np.array([function(depth) for depth in depths.tolist()])
        total += float((weights * values * np.sin(angle)).sum()) * (high - low) / 2 * np.pi / 2
    return total
