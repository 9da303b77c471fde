r"""What is proven of a blend by arcs: how far the analytic surface in the solid is from the spline that is the same.

:mod:`cqblend.blends.quality.smoothness_proof` bounds how the rational spline meets both faces. Here its coefficients
are compared with those of the cylinder, torus or sphere, as doubles, which has the same parameters. With d a bound on
the differences of homogeneous coefficients (and of weights, times the largest coordinate) of degree p on pieces of
length h, and with weights at the rail from w to 1, points differ by at most d / w and derivatives by at most

.. math:: \frac{1}{w} \Big(\frac{2 p d}{h} + \frac{2 p}{h} \frac{d}{w}\Big) \le \frac{4 p d}{h w^2} .

Derivatives along and across are orthogonal, so that their relative errors add up to how far the tangent plane turns.
OCCT evaluates these surfaces by formulas, with the errors ``PROOF_TOLERANCES.point`` and ``.closed_form``.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from cqblend.blends.quality.smoothness_proof import Proof, prove_side
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.blends.sections.arc_section import ArcSection
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.splines import Surface, bernstein
from cqblend.splines.bernstein import Array


def prove_arc_side(
    blend: BlendSurface, arc: ArcSection | TurnedArcs, end: Literal[0, 1], rail_shift: float, rail_turn: float
) -> Proof:
    """Prove how a blend by arcs meets the surface of one of its rails.

    Parameters
    ----------
    blend
        The blend, with its rational spline.
    arc
        The analytic surface as it is in the solid.
    end
        0 for the rail at v = 0, 1 for that at v = 1.
    rail_shift, rail_turn
        By how much the rail in the parameters of the face is off (mm), and its normal there (rad).
    """
    surface = Surface.from_bspline(*blend.surface.to_bspline())
    proof = prove_side(surface, end, blend.ribbons[end], 1)
    shift, turn = _bound_difference(surface, arc, end)
    return Proof(proof.gap + shift + rail_shift, proof.angle + turn + rail_turn)


def _bound_difference(surface: Surface, arc: ArcSection | TurnedArcs, end: Literal[0, 1]) -> tuple[float, float]:
    """Bound by how much points (mm) and tangent planes (rad) of a spline and of arcs differ along a rail."""
    net = arc.build_rational_net() if isinstance(arc, TurnedArcs) else _build_rational_net(arc)
    net = bernstein.elevate_degree(net, surface.degree[0] + 1 - len(net))
    rows = [0, 1] if end == 0 else [2, 1]  # on which points and derivatives at the rail depend
    weight, reach = float(net[:, rows[0], 3].min()), float(np.abs(net[:, :, :3] / net[:, :, 3:]).max())
    offset = (net - surface.coefs)[:, rows]
    difference = np.linalg.norm(offset[:, :, :3], axis=2) + np.abs(offset[:, :, 3]) * reach
    along, across = float(difference[:, 0].max()), float(difference.max())
    steps, angles = np.diff(surface.breaks[0]), np.diff(arc.stops)
    if arc.is_straight:
        speeds = angles / steps
    elif isinstance(arc, TurnedArcs):
        speeds = 2 * np.sin(angles / 2) / steps * arc.radius
    else:
        first = arc.surface.jet(arc.map_to_surface(np.zeros(2), np.array([0.0, 1.0])))[:, end]
        speeds = 2 * np.sin(angles / 2) / steps * float(np.linalg.norm(first[1]))
    along_turn = 4 * surface.degree[0] * along / (float((steps * speeds).min()) * weight**2)
    across_turn = 8 * across / (2 * arc.radius * np.sin(arc.least_opening / 2) * weight**2)
    turn = along_turn + across_turn + PROOF_TOLERANCES.closed_form
    largest = reach + float(np.abs(arc.surface.frame.origin).max())
    return along / weight + PROOF_TOLERANCES.point * largest, float(np.arcsin(min(turn, 1.0)))


def _build_rational_net(arc: ArcSection) -> Array:
    """Return the homogeneous Bernstein coefficients (p + 1, 3, 4, n, 1) of the rational spline of arcs."""
    frame, half, radius = arc.surface.frame, arc.opening / 2, arc.radius
    jet = arc.surface.jet(arc.map_to_surface(np.zeros(1), np.zeros(1)))[:, 0]
    point, tangent = jet[0], jet[1 if arc.is_straight else 2]
    sense = np.sign(arc.across).sum()
    y = sense * tangent / np.linalg.norm(tangent)
    x = -(jet[3] if arc.is_straight else jet[5]) / radius
    centre = point - radius * x
    turns = np.array([0.0, half, 2 * half])
    weights = np.array([1.0, np.cos(half), 1.0])
    section = weights[:, None] * centre + radius * (np.cos(turns)[:, None] * x + np.sin(turns)[:, None] * y)
    if arc.is_straight:
        far = section + weights[:, None] * (arc.length * arc.along[1] * frame.axes[2])
        xyz = np.stack([section, far])
        return np.concatenate([xyz, np.broadcast_to(weights[:, None], (2, 3, 1))], axis=2)[..., None, None]
    local = (section - weights[:, None] * frame.origin) @ frame.axes.T  # (3, 3)
    start, step = arc.stops[:-1], np.diff(arc.stops) / 2
    angles = start + np.multiply.outer(np.arange(3), step)  # (3, n)
    scale = np.stack([np.ones_like(step), np.cos(step), np.ones_like(step)])
    turned = np.stack(
        [
            np.einsum("in,j->ijn", np.cos(angles), local[:, 0]) - np.einsum("in,j->ijn", np.sin(angles), local[:, 1]),
            np.einsum("in,j->ijn", np.sin(angles), local[:, 0]) + np.einsum("in,j->ijn", np.cos(angles), local[:, 1]),
            np.einsum("in,j->ijn", scale, local[:, 2]),
        ],
        axis=-1,
    )  # (3, 3, n, 3)
    weight = np.einsum("in,j->ijn", scale, weights)[..., None]
    xyz = turned @ frame.axes + weight * frame.origin
    return np.moveaxis(np.concatenate([xyz, weight], axis=-1), -1, 2)[..., None]
