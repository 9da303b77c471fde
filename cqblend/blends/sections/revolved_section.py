"""Recognises blends that are surfaces of revolution, and gives the profile that is turned, and about which axis.

Between two ribbons that are circular about one axis, a blend is one profile, its section, turned about that axis: in
homogeneous coordinates the product of the profile and of a chain of rational arcs. CAD systems store and process such
surfaces far more cheaply than tensor products, and their rails are circles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import locate_on_rational_arcs, measure_rational_arcs
from cqblend.surfaces.vectors import LocalFrame, cross_product, normalise_vectors


@dataclass(frozen=True)
class RevolvedSection:
    """A blend H(t, v) as a profile that is turned about the Z axis of a frame, by an angle that depends on t.

    Attributes
    ----------
    profile
        The section, a curve v -> (radius, height) of dim 2, polynomial or rational as the blend is across: the point of
        the frame at angle 0 is (radius, 0, height).
    frame
        Right-handed and orthonormal. Its origin is on the axis, the section at the first t in its half plane y = 0,
        x > 0, and angles grow with t.
    breaks
        The ends of the arcs that the rails consist of, (n + 1,), the breaks of the blend in t.
    angles
        The angles there (rad), from 0; the last one is 2 pi where the blend goes once around.
    deviation
        A bound (mm) on the distance between a point of the blend and the same point of the turned profile, from the
        coefficients of both.
    """

    profile: Curve
    frame: LocalFrame
    breaks: Array
    angles: Array
    deviation: float

    @property
    def turn(self) -> float:
        """The angle (rad) from the first section to the last."""
        return float(self.angles[-1])

    @property
    def closed(self) -> bool:
        """Whether the blend goes once around."""
        return self.turn == 2 * np.pi

    def map_to_angles(self, t: Array) -> Array:
        """Return the angles (n,) of the sections at parameters t (n,) of the rails."""
        return measure_rational_arcs(t, self.angles, self.breaks)

    def map_to_parameters(self, angles: Array) -> Array:
        """Return the parameters t (n,) of the rails at angles (n,): the inverse of :meth:`map_to_angles`."""
        return locate_on_rational_arcs(angles, self.angles, self.breaks)

    def place_profile(self, angle: float) -> Curve:
        """Return the profile in space, turned to an angle (rad): a curve v -> H of dim 3."""
        x, y, z = self.frame.axes
        x = np.cos(angle) * x + np.sin(angle) * y
        homogeneous = self.profile.coefs if self.profile.rational else _append_weight(self.profile.coefs)
        radius, height, weight = (homogeneous[:, k] for k in range(3))
        xyz = (
            np.einsum("in,k->ikn", one, axis) for one, axis in ((radius, x), (height, z), (weight, self.frame.origin))
        )
        points = sum(xyz)
        coefs = np.concatenate([points, weight[:, None]], axis=1) if self.profile.rational else points
        return Curve(self.profile.breaks, coefs, rational=self.profile.rational, continuity=self.profile.continuity)


def _append_weight(coefs: Array) -> Array:
    """Return coefficients (q + 1, 2, n) with weights that are 1, (q + 1, 3, n)."""
    return np.concatenate([coefs, np.ones_like(coefs[:, :1])], axis=1)


def find_revolved_section(blend: BlendSurface) -> RevolvedSection | None:
    """Return a blend between two circular ribbons as a turned profile; None if it is none, to rounding."""
    surface = blend.surface
    if not all(ribbon.light for ribbon in blend.ribbons) or surface.degree[0] < 2 or not surface.rational:
        return None
    frame = _find_axis_frame(surface)
    if frame is None:
        return None
    angles = _measure_break_angles(surface, frame)
    if not np.all(np.diff(angles) > 0):
        return None
    coefs = _to_frame_coordinates(surface, frame)
    profile = np.stack([coefs[0, :, 0, 0], coefs[0, :, 2, 0], coefs[0, :, 3, 0]], axis=1)  # (q + 1, 3, nv)
    size = float(np.abs(coefs).max())
    deviation = _bound_deviation(coefs, profile, angles)
    if not deviation <= SECTION_TOLERANCES.revolved_deviation * size:
        return None
    weight = profile[:, 2:]
    rational = bool(np.abs(weight - weight[:1, :, :1]).max() > SECTION_TOLERANCES.unit_weight_share * weight.max())
    across, continuity = surface.breaks[1], surface.continuity[1]
    section = Curve(across, profile if rational else profile[:, :2] / weight, rational=rational, continuity=continuity)
    return RevolvedSection(section, frame, surface.breaks[0], angles, deviation)


def _find_axis_frame(surface: Surface) -> LocalFrame | None:
    """Return the frame of the axis of that boundary of a blend, a chain of arcs, which is the wider one.

    None if the ends and the middles of its arcs are on no circle about an axis that the first section meets.
    """
    breaks = surface.breaks[0]
    t = np.interp(np.arange(2 * len(breaks) - 1) / 2, np.arange(len(breaks)), breaks)
    rails = surface.grid(t, np.array([0.0, 1.0])).swapaxes(0, 1)
    chords = np.linalg.norm(rails[:, 1] - rails[:, 0], axis=1)
    points = rails[int(chords.argmax())]
    if np.linalg.norm(points[-1] - points[0]) <= SECTION_TOLERANCES.revolved_gap * np.ptp(points, axis=0).max():
        points = points[:-1]
    middle = points.mean(axis=0)
    arms = points - middle
    normal = cross_product(arms[:-1], arms[1:]).sum(axis=0) + cross_product(arms[-1], arms[0])
    try:
        axis = normalise_vectors(normal)
        # the centre has the same distance from all points
        system = np.concatenate([2 * (points[1:] - points[0]), axis[None]])
        square = ((points[1:] - middle) ** 2).sum(axis=1) - ((points[0] - middle) ** 2).sum()
        centre = middle + np.linalg.lstsq(system, np.append(square, 0.0))[0]
        arm = points[0] - centre
        x = normalise_vectors(arm - (arm @ axis) * axis)
    except GeometryError:
        return None
    return LocalFrame(centre, np.stack([x, cross_product(axis, x), axis]))


def _measure_break_angles(surface: Surface, frame: LocalFrame) -> Array:
    """Return the angles (n + 1,) of the rails at the breaks; arcs turn by less than half a turn."""
    points = (surface.grid(surface.breaks[0], np.array([0.0, 1.0])) - frame.origin) @ frame.axes.T
    x, y = points[..., 0].sum(axis=1), points[..., 1].sum(axis=1)
    turns = np.arctan2(x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:])
    angles = np.append(0.0, np.cumsum(turns))
    if abs(angles[-1] - 2 * np.pi) <= SECTION_TOLERANCES.revolved_full_turn:
        angles *= 2 * np.pi / angles[-1]
        angles[-1] = 2 * np.pi
    return angles


def _to_frame_coordinates(surface: Surface, frame: LocalFrame) -> Array:
    """Return the homogeneous coefficients of a surface (p + 1, q + 1, 4, n, nv) in the coordinates of a frame."""
    coefs = np.moveaxis(surface.coefs, 2, -1)
    xyz = (coefs[..., :3] - coefs[..., 3:] * frame.origin) @ frame.axes.T
    return np.moveaxis(np.concatenate([xyz, coefs[..., 3:]], axis=-1), -1, 2)


def _bound_deviation(coefs: Array, profile: Array, angles: Array) -> float:
    """Bound how far (mm) homogeneous coefficients (p + 1, q + 1, 4, n, nv) are from those of a turned profile.

    For X / W and Y / V, |X / W - Y / V| = |X - Y - (W - V) Y / V| / W, in which every term is bounded by coefficients.
    """
    start, half = angles[:-1], np.diff(angles) / 2
    one = np.ones_like(half)
    # of the arc about the axis from one break to the next, whose half-angle pair is linear
    weight = np.stack([one, np.cos(half), one])  # (3, n)
    x, y = (np.stack([f(start), f(start + half), f(start + 2 * half)]) for f in (np.cos, np.sin))
    weight, x, y = (bernstein.elevate_degree(rows, len(coefs) - 3) for rows in (weight, x, y))
    radius, height, scale = (profile[:, k] for k in range(3))  # (q + 1, nv)
    turned = np.stack(
        [
            np.einsum("in,jm->ijnm", factor, row)
            for factor, row in ((x, radius), (y, radius), (weight, height), (weight, scale))
        ],
        axis=2,
    )
    offset = coefs - turned
    reach = np.linalg.norm(turned[:, :, :3] / turned[:, :, 3:], axis=2).max()
    lengths = np.linalg.norm(offset[:, :, :3], axis=2) + np.abs(offset[:, :, 3]) * reach
    return float(lengths.max() / coefs[:, :, 3].min())
