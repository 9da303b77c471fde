r"""What one section proves of a blend around an axis: by symmetry it bounds the joint along the whole circle.

The bounds hold for the surface that is returned: a profile of doubles, turned by sines and
cosines about an axis of doubles. With C = H(0, v) - O at the rail, O on the axis and Z along it, the turned profile has

.. math:: a = H_s = Z \times C, \quad b = H_v = C', \quad
          H_{ss} = Z \times a, \quad H_{sv} = Z \times C', \quad H_{vv} = C'' .

At the angle s all of these are turned by R(s), and so are the normal n and the second fundamental form, as a tensor K
of space. The support is a plane, or a meridian that is turned by R'(s) about an axis Z' of its own. So

*Angle.* n' turns with R'. Its axis is off by delta, so that R and R' differ by at most 2 delta, and the angle at s is
at most the one at 0 plus 2 delta. The normal of a plane stands still: there it is the angle between n and Z, plus that
between Z and the plane's normal.

*Gap.* Both rails are c + a cos s + b sin s: the distance is at most |dc| + (|da|^2 + |db|^2)^(1/2).

*Jump of the normal curvature.* K - K' at 0, and 4 delta |K'|.

Where the axes of the support's frame, doubles as well, are not quite orthonormal, with F F^T - I = e, what is turned in
that frame is off from a rotation by 2 e, and normals by 4 e. Angles are doubles, off by half a unit in the last place.

*Evaluation.* OCCT evaluates the profile by the algorithm of :mod:`cqblend.blends.quality.evaluation_rounding`, and
turns points and derivatives by one matrix, with an error of ``PROOF_TOLERANCES.rotation``; closed forms have an error
of ``PROOF_TOLERANCES.closed_form``. As along splines, errors E_a, E_b of the derivatives turn the plane by at most
psi = (E_a/|a| + E_b/|b|) / sin(theta), and change the form by E_ij + psi |H_ij|.

The section itself is compared in long doubles, where the machine has them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cqblend.blends.quality.evaluation_rounding import bound_curve_rounding
from cqblend.blends.quality.rail_bounds import bound_largest_curvature
from cqblend.blends.quality.smoothness_proof import Proof
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.knots import extract_pieces
from cqblend.surfaces.circle import PlanarCircle
from cqblend.surfaces.coaxial_surfaces import CoaxialSurface
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.vectors import LocalFrame, cross_product

_LONG = np.longdouble


@dataclass(frozen=True)
class TurnedProfile:
    """A B-spline curve in space that is turned about an axis, as it is in a finished face.

    Attributes
    ----------
    origin, axis
        A point (3,) of the axis, and its direction (3,).
    profile
        Degree, full clamped knot vector, poles (n, 3), and weights (n,) or None.
    """

    origin: Array
    axis: Array
    profile: tuple[int, Array, Array, Array | None]


@dataclass(frozen=True)
class AngularLine:
    """A line in the parameters of a support, along its angle: (u, v) = start + (sign s, 0)."""

    start: Array  # (2,)
    sign: float  # 1 or -1


@dataclass(frozen=True)
class _TurnedSection:
    """What is turned about an axis to make a surface along a circle, in long doubles, relative to a common origin.

    ``tangents`` a, b (2, 3) are the derivatives along the circle and across it, ``second`` (3, 3) those of second order
    (along twice, mixed, across twice); ``circle`` (3, 3) has the rows c, a, b of the rail c + a cos s + b sin s.
    ``errors`` (5,) bound the rounding of OCCT's evaluation of the tangents and of the second derivatives, and the
    error of the section itself, both in space; ``point_error`` is that of points (mm).
    """

    tangents: Array
    second: Array
    circle: Array
    errors: Array
    point_error: float

    @property
    def normal(self) -> Array:
        """The unit normal (3,)."""
        normal = cross_product(self.tangents[0], self.tangents[1])
        return np.asarray(normal / _measure_length(normal))

    @property
    def lengths(self) -> tuple[float, float]:
        """The lengths of the tangents."""
        return _measure_length(self.tangents[0]), _measure_length(self.tangents[1])

    @property
    def sine(self) -> float:
        """The sine of the angle between the tangents."""
        first, second = self.lengths
        return _measure_length(cross_product(self.tangents[0], self.tangents[1])) / (first * second)

    @property
    def evaluation_turn(self) -> float:
        """By how much the errors turn the tangent plane (rad), at most."""
        first, second = self.lengths
        return float(self.errors[0] / first + self.errors[1] / second) / self.sine

    def form_curvature_tensor(self, normal: Array) -> Array:
        """Return the second fundamental form, for a normal, as a tensor (3, 3) of space, 0 along it."""
        gram = self.tangents @ self.tangents.T
        determinant = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
        inverse = np.array([[gram[1, 1], -gram[0, 1]], [-gram[0, 1], gram[0, 0]]]) / determinant
        dual = inverse @ self.tangents
        along, mixed, across = self.second @ normal
        return np.asarray(dual.T @ np.array([[along, mixed], [mixed, across]]) @ dual)

    def bound_evaluated_curvature(self, curvature: float) -> float:
        """Bound by how much the errors change normal curvatures, of which ``curvature`` is the largest (1/mm)."""
        turn, sine = self.evaluation_turn, self.sine
        sizes = np.linalg.norm(self.second.astype(float), axis=1)
        forms = self.errors[2:] + turn * sizes
        first, second = (np.array(length) for length in self.lengths)
        slant = np.array(sine), np.array(np.sqrt(max(1 - sine**2, 0.0)))
        changed = float(bound_largest_curvature((forms[0], forms[1], forms[2]), (first, second), slant))
        return (1 + turn) ** 2 * changed + turn * (2 + turn) * curvature


def _measure_length(vector: Array) -> float:
    return float(np.sqrt((vector * vector).sum()))


def prove_circular_joint(
    strip: TurnedProfile,
    end: Literal[0, 1],
    support: Plane | CoaxialSurface,
    rail: PlanarCircle | AngularLine,
    turn: float,
    order: int,
) -> Proof:
    """Prove how a turned profile meets its support along the circle of one of its ends.

    Parameters
    ----------
    strip
        The profile, v -> C(v).
    end
        0 for its start, 1 for its end.
    support
        What it is to meet there.
    rail
        The circle in the support's parameters, by the angle s about the strip's axis: on a plane a circle, else a line.
    turn
        The largest |s| (rad).
    order
        0 for the gap and the angle alone, 2 for the jump of curvature as well.
    """
    axis = strip.axis.astype(_LONG)
    axis = axis / _measure_length(axis)
    blend = _describe_strip(strip, axis, end)
    if isinstance(support, Plane):
        if not isinstance(rail, PlanarCircle):
            raise TypeError("a rail on a plane is a circle")
        normal = cross_product(support.frame.axes[0].astype(_LONG), support.frame.axes[1].astype(_LONG))
        normal = normal / _measure_length(normal)
        aligned = axis if normal @ axis >= 0 else -axis
        other = _describe_plane(support, rail, strip.origin)
        apart = _measure_angle(blend.normal, aligned) + _measure_angle(aligned, normal)
        misaligned = angle_error = 0.0
    else:
        if not isinstance(rail, AngularLine):
            raise TypeError("a rail around an axis is a line along the angle")
        other = _describe_coaxial_support(support, rail, strip.origin)
        off_axis = _measure_angle(axis, support.frame.axes[2].astype(_LONG))
        misaligned = 2 * off_axis + 6 * _measure_frame_defect(support.frame)
        angle_error = EPSILON * (float(np.abs(rail.start[0])) + turn)
        apart = _measure_angle(blend.normal, other.normal) + misaligned + angle_error
    sections = (blend, other)
    between = np.linalg.norm((blend.circle - other.circle).astype(float), axis=1)
    radius = max(section.lengths[0] for section in sections)
    gap = between[0] + np.hypot(between[1], between[2]) + sum(section.point_error for section in sections)
    gap = float(gap + angle_error * radius)
    turns = [section.evaluation_turn for section in sections]
    angle = PROOF_TOLERANCES.normal_comparison + apart + float(np.arcsin(min(sum(turns), 1.0)))
    if not angle < np.pi / 2:
        return Proof(gap, np.pi)
    if order < 2:
        return Proof(gap, angle)
    normal = blend.normal
    opposite = other.normal if other.normal @ normal >= 0 else -other.normal
    one, two = blend.form_curvature_tensor(normal), other.form_curvature_tensor(opposite)
    jump = _measure_norm(one - two)
    curvature = _measure_norm(one) + _measure_norm(two)
    evaluated = sum(section.bound_evaluated_curvature(curvature) for section in sections)
    return Proof(gap, angle, float(jump + evaluated + 2 * (angle + misaligned + angle_error) * curvature))


def _measure_angle(one: Array, other: Array) -> float:
    """Return the angle between two unit vectors, or one and the opposite of the other (rad)."""
    return float(np.arctan2(_measure_length(cross_product(one, other)), abs(one @ other)))


def _measure_norm(tensor: Array) -> float:
    """Return the largest |w.T w| of a symmetric tensor (3, 3) for unit w."""
    return float(np.abs(np.linalg.eigvalsh(tensor.astype(float))).max())


def _measure_frame_defect(frame: LocalFrame) -> float:
    """Return by how much the axes of a frame are not orthonormal, but for the lengths of equally long ones."""
    axes = frame.axes.astype(_LONG)
    lengths = np.sqrt((axes * axes).sum(axis=1))
    axes = axes / np.array([lengths[0], lengths[0], lengths[2]])[:, None]
    return float(np.linalg.norm((axes @ axes.T - np.eye(3)).astype(float)))


def _describe_strip(strip: TurnedProfile, axis: Array, end: Literal[0, 1]) -> _TurnedSection:
    """Return a turned profile at one of its ends."""
    _, knots, poles, _ = strip.profile
    jet, own_error = _differentiate_end(strip, end)
    arm = jet[0] - (jet[0] @ axis) * axis
    along = cross_product(axis, arm)
    rounding = bound_curve_rounding(strip.profile, float(knots[-end]))
    distance, across, bend = (_measure_length(part) for part in jet)
    rotation = PROOF_TOLERANCES.rotation
    errors = np.array(
        [
            rounding[0] + rotation * distance,
            rounding[1] + rotation * across,
            rounding[0] + rotation * distance,
            rounding[1] + rotation * across,
            rounding[2] + rotation * bend,
        ]
    )
    largest = float(np.abs(poles).max() + np.abs(strip.origin).max())
    return _TurnedSection(
        tangents=np.stack([along, jet[1]]),
        second=np.stack([cross_product(axis, along), cross_product(axis, jet[1]), jet[2]]),
        circle=np.stack([jet[0] - arm, arm, along]),
        errors=errors + own_error[[0, 1, 0, 1, 2]],
        point_error=float(rounding[0] + PROOF_TOLERANCES.point * largest),
    )


def _differentiate_end(strip: TurnedProfile, end: Literal[0, 1]) -> tuple[Array, Array]:
    """Return point, relative to the origin, and derivatives of the profile (3, 3), and bounds of their errors (3,)."""
    degree, knots, poles, weights = strip.profile
    factor = np.ones(len(poles), _LONG) if weights is None else weights.astype(_LONG)
    net = np.concatenate([(poles - strip.origin.astype(_LONG)) * factor[:, None], factor[:, None]], axis=1)
    breaks, coefs, _ = extract_pieces(degree, knots.astype(_LONG), net)
    coefs, length = coefs[..., -end], np.diff(breaks)[-end]
    rows, table = [], coefs
    for _ in range(3):
        rows.append(table[-end])
        table = bernstein.differentiate_coefs(table) / length
    (point, weight), (rate, weight_rate), (bend, weight_bend) = ((row[:3], row[3]) for row in rows)
    first = point / weight
    second = (rate - weight_rate * first) / weight
    third = (bend - 2 * weight_rate * second - weight_bend * first) / weight
    step = 2 * degree / float(length)
    share = PROOF_TOLERANCES.section * float(np.finfo(_LONG).eps) * (degree + 1)
    spread = float(factor.max() / factor.min()) ** 3
    size = float(np.abs(coefs[:, :3] / coefs[:, 3:]).max())
    return np.stack([first, second, third]), share * spread * size * np.array([1.0, step, step**2])


def _describe_plane(plane: Plane, rail: PlanarCircle, origin: Array) -> _TurnedSection:
    """Return a plane along a circle; its tangents are those of the plane."""
    axes = plane.frame.axes[:2].astype(_LONG)
    centre = plane.frame.origin.astype(_LONG) - origin + rail.centre.astype(_LONG) @ axes
    arms = rail.radius * rail.axes.astype(_LONG) @ axes
    largest = float(np.abs(plane.frame.origin).max() + np.abs(rail.centre).max() + rail.radius)
    return _TurnedSection(
        tangents=arms[::-1],
        second=np.zeros((3, 3), _LONG),
        circle=np.concatenate([centre[None], arms]),
        errors=np.zeros(5),  # derivatives of a plane are its axes
        point_error=PROOF_TOLERANCES.point * largest,
    )


def _describe_coaxial_support(support: CoaxialSurface, rail: AngularLine, origin: Array) -> _TurnedSection:
    """Return a support around an axis at the start of a rail."""
    frame = LocalFrame(support.frame.origin.astype(_LONG) - origin, support.frame.axes.astype(_LONG))
    jet = _evaluate_jet(support, frame, rail.start[None].astype(_LONG))
    along, across = rail.sign * jet[1], jet[2]
    second = np.stack([jet[3], rail.sign * jet[4], jet[5]])
    sizes = np.linalg.norm(np.concatenate([jet[1:3], second]).astype(float), axis=1)
    errors = PROOF_TOLERANCES.closed_form * sizes / 2  # of two tangents together
    point_error = 0.0
    if isinstance(support, RevolvedEllipse):
        errors = errors + PROOF_TOLERANCES.torus_zero * float(np.abs(support.ellipse).sum())
    elif isinstance(support, RevolvedSpline):
        extra = _bound_spline_errors(support, float(rail.start[1]))
        errors = errors + extra[[0, 1, 0, 1, 2]]
        point_error = float(extra[0])
    largest = float(np.abs(support.frame.origin).max() + np.abs(jet[0] - frame.origin).max()) + abs(rail.start[1])
    return _TurnedSection(
        tangents=np.stack([along, across]),
        second=second,
        circle=np.stack([jet[0] + jet[3], -jet[3], along]),
        errors=errors,
        point_error=float(point_error + PROOF_TOLERANCES.point * largest),
    )


def _evaluate_jet(support: CoaxialSurface, frame: LocalFrame, uv: Array) -> Array:
    """Return the native jet (6, 3) of a support that is moved to a frame, at parameters (1, 2)."""
    return np.asarray(replace(support, frame=frame).jet(uv)[:, 0], _LONG)


def _bound_spline_errors(support: RevolvedSpline, v: float) -> Array:
    """Bound the errors of a turned spline and of its first two derivatives by v (3,), as it is evaluated and read."""
    frame, (degree, knots, poles, weights) = support.frame, support.profile.to_bspline()
    at = float(support.wrap_parameters(np.array([[0.0, v]]))[0, 1])
    evaluated = bound_curve_rounding((degree, knots, frame.origin + poles @ frame.axes, weights), at)
    breaks = support.profile.breaks
    span = int(np.clip(np.searchsorted(breaks, at, "right") - 1, 0, len(breaks) - 2))
    step = 2 * degree / float(np.diff(breaks)[span])
    spread = 1.0 if weights is None else float(weights.max() / weights.min()) ** 3
    share = PROOF_TOLERANCES.section * EPSILON * (degree + 1)
    read = share * spread * float(np.abs(poles).max()) * np.array([1.0, step, step**2])
    return np.asarray(evaluated + read)
