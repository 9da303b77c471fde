"""How an open blend is to end: what is asked, in which order it is tried, and where its rails and caps must reach.

An end is *natural*, on the one face that crosses the edge at its vertex, or *flat*, in a planar cap across the edge: at
the vertex, or, only where that is asked for, some way before it. Where the size goes to 0, it is a *point*, the vertex.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from cqblend.blend_options import EndWanted
from cqblend.blends.contacts.contact_solver import ContactSolver
from cqblend.brep.selection.blend_corners import CORNER_METHODS, CornerMethod
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.strip_placement import CapStations
from cqblend.certificate import EndKind, EndRecord
from cqblend.errors import CqblendError, FlatEndWarning, GeometryError, SizeError, TopologyError, warn
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES

SMALLER_SIZE_HINT = "A smaller size may help"
EARLIER_BLEND_HINT = "It helps to blend all of a chain, or to blend before the edges there are rounded"

EndMethod = Literal["natural", "flat at the vertex", "flat", "point"] | CornerMethod
"""On the faces around the end; in a cap at the vertex; in a cap at the vertex or before it; in a point; at a corner."""

METHODS_TO_TRY: dict[EndWanted, tuple[EndMethod, ...]] = {
    "natural": ("natural",),
    "flat": ("flat",),
    "auto": ("natural", "flat at the vertex"),
}
"""Methods tried at one end, in this order, by what is asked for."""

POINT_METHODS: tuple[EndMethod, ...] = ("point",)
"""The same where the size goes to 0, whatever is asked for."""


@dataclass(frozen=True)
class EndPlan:
    """How a chain ends: in flat caps at these t of its first and last cell, or naturally (None), and where rails reach.

    ``rail_range`` is from a t of the first cell to one of the last.
    """

    methods: tuple[EndMethod, EndMethod]
    cap_stations: CapStations
    rail_range: tuple[float, float]

    def settle_corners(self, methods: tuple[CornerMethod | None, CornerMethod | None]) -> EndPlan:
        """Return the plan with the methods by which corners at both ends have been put together."""
        first, last = (found or own for found, own in zip(methods, self.methods, strict=True))
        return replace(self, methods=(first, last))

    @classmethod
    def natural_at_both_ends(cls, domain: tuple[float, float]) -> EndPlan:
        """Return the plan of natural ends at both ends."""
        return cls(("natural", "natural"), (None, None), domain)

    def turn_at(self, end: int) -> EndPlan:
        """Return the plan with the rails up to the vertex at one end, past which the ball turns in place."""
        methods, reach = list(self.methods), list(self.rail_range)
        methods[end], reach[end] = "turn", float(end)
        return EndPlan((methods[0], methods[1]), self.cap_stations, (reach[0], reach[1]))

    def lengthen(self, needed: tuple[float, float]) -> EndPlan:
        """Return the plan with rails that reach as far as is needed, but where the ball turns."""
        reach = [
            here if method == "turn" else longer
            for method, here, longer in zip(
                self.methods, self.rail_range, lengthen_domain(self.rail_range, needed), strict=True
            )
        ]
        return EndPlan(self.methods, self.cap_stations, (reach[0], reach[1]))

    def measure_uncovered(self, lengths: Sequence[float]) -> float:
        """Return the length (mm) that is not blended of a chain, by the lengths of its cells."""
        first, last = self.cap_stations
        return (first or 0.0) * lengths[0] + (0.0 if last is None else 1.0 - last) * lengths[-1]


def lengthen_domain(domain: tuple[float, float], needed: tuple[float, float]) -> tuple[float, float]:
    """Return a domain that has what is needed, and a little more where it was too short, for the next fit differs."""
    slack = 0.1 * (needed[1] - needed[0])
    before, after = max(domain[0] - needed[0], 0.0), max(needed[1] - domain[1], 0.0)
    return domain[0] - before - min(slack, before), domain[1] + after + min(slack, after)


class EndAttempts:
    """Which methods to try at both ends, in order; one that failed at an end is not tried there again.

    Iterate over pairs of methods, and record by :meth:`record_failure` why an attempt failed.
    """

    def __init__(
        self,
        wanted: tuple[EndWanted, EndWanted],
        vanishes: tuple[bool, bool] = (False, False),
        corners: tuple[EndMethod | None, EndMethod | None] = (None, None),
    ) -> None:
        methods: list[tuple[EndMethod, ...]] = []
        for one, is_point, corner in zip(wanted, vanishes, corners, strict=True):
            methods.append((corner,) if corner else POINT_METHODS if is_point else METHODS_TO_TRY[one])
        first, last = methods
        self._methods = first, last
        self._combinations = list(product(first, last))
        self._failed: dict[tuple[int, EndMethod], CqblendError] = {}
        self._errors: list[CqblendError] = []
        self._errors_of_both_ends: list[CqblendError] = []

    def __iter__(self) -> Iterator[tuple[EndMethod, EndMethod]]:
        for methods in self._combinations:
            if not any((end, methods[end]) in self._failed for end in (0, 1)):
                yield methods

    def record_failure(self, methods: tuple[EndMethod, EndMethod], error: CqblendError) -> None:
        """Record why an attempt failed: at one end, if the error says at which, or as a whole."""
        if isinstance(error, BlendEndError):
            self._failed.setdefault((error.end, methods[error.end]), error.cause)
            error = error.cause
        else:
            self._errors_of_both_ends.append(error)
        self._errors.append(error)

    def get_first_cause(self, end: int) -> CqblendError:
        """Return why the natural end failed at an end: there, or else in the first attempt that failed as a whole."""
        return self._failed.get((end, "natural"), (self._errors_of_both_ends or self._errors)[0])

    def make_error(self, joints: tuple[Joint, Joint]) -> CqblendError:
        """Return the error to raise when all attempts failed: the first one, and why a flat end failed too.

        ``joints`` are those of the cells at both ends.
        """
        for end in (0, 1):
            failures = {method: error for (where, method), error in self._failed.items() if where == end}
            if len(failures) == len(self._methods[end]):
                first, *others = failures.values()
                others_too = "".join(f"; nor can it end flat at the vertex: {other}" for other in others)
                advice = "" if "natural" not in failures else '; ends="flat" lets it end in a cap before the vertex'
                return first.with_details(
                    before=f"the blend cannot end at {joints[end].name_end(end)}: ", after=f"{others_too}{advice}"
                )
        return self._errors[0]


def plan_ends(contexts: tuple[StripContext, StripContext], methods: tuple[EndMethod, EndMethod]) -> EndPlan:
    """Return where an open chain ends, by the given methods, and how far its rails reach.

    ``contexts`` are those of its first and its last cell.

    They reach the planes of the faces at their ends, or of the caps, and a little more.

    Raises
    ------
    BlendEndError
        One of the ends cannot be built by its method.
    """
    caps: list[float | None] = []
    domain = []
    for end, (context, method) in enumerate(zip(contexts, methods, strict=True)):
        joint, solve = context.joint, context.solve
        length, sign = joint.spine.length, 1.0 if end else -1.0
        if method == "point":
            caps.append(None)
            domain.append(float(end))
            continue
        try:
            at = float(end) if context.method.sizes.laws else sum(context.window) / 2
            reach = float(solve(np.array([at])).cross_lengths.max())
            if method == "natural" or method in CORNER_METHODS:
                caps.append(None)
                domain.append(end + sign * (_measure_end_overrun(joint, solve, end) + reach / 5) / length)
            else:
                offsets = SOLID_BLEND_TOLERANCES.cap_offsets if method == "flat" else (0.0,)
                cap = _place_cap(joint, solve, end, reach, offsets)
                caps.append(cap)
                domain.append(cap + sign * 0.02 * reach / length)
        except (TopologyError, SizeError, GeometryError) as error:
            raise BlendEndError(end, error) from error
    return EndPlan(methods, (caps[0], caps[1]), (domain[0], domain[1]))


def record_ends(
    joints: tuple[Joint, Joint], plan: EndPlan, attempts: EndAttempts | None = None
) -> tuple[EndRecord, ...]:
    """Return the certificate's records of both ends, and warn of those that are flat although it was not asked for.

    ``joints`` are those of the cells at both ends.
    """
    records = []
    for end, (joint, method, cap) in enumerate(zip(joints, plan.methods, plan.cap_stations, strict=True)):
        uncovered = 0.0 if cap is None else abs(end - cap) * joint.spine.length
        why = ""
        if method == "flat at the vertex" and attempts is not None:
            cause = attempts.get_first_cause(end)
            why, help_ = str(cause), SMALLER_SIZE_HINT if isinstance(cause, SizeError) else EARLIER_BLEND_HINT
            where = f"{joint.name}: the blend ends in a flat cap at {joint.name_end(end)}"
            warn(FlatEndWarning(f'{where}: {why}. {help_}; ends="natural" makes this an error'))
        kind: EndKind = "flat" if method == "flat at the vertex" else method
        records.append(EndRecord(joint.edge_number, joint.find_vertex_number(end), kind, uncovered, why))
    return tuple(records)


def _measure_end_overrun(joint: Joint, solve: ContactSolver, end: int) -> float:
    """Return how far (mm) the rails overrun the end of the edge before they meet the planes of the faces there."""
    t = np.array([float(end)])
    try:
        contacts = solve(t)
    except (GeometryError, SizeError) as error:
        raise TopologyError("the joint fades out before it gets there") from error
    direction = joint.locate_stations(t).tangents[0] * (1.0 if end else -1.0)
    points = [primary.jet(uv)[0, 0] for primary, uv in zip(joint.primaries, contacts.uv, strict=True)]
    overruns = [0.0]
    for corner, normal in joint.list_end_planes(end):
        cosine = float(direction @ normal)
        if abs(cosine) > SOLID_BLEND_TOLERANCES.parallel_cosine:  # else it runs along the edge
            overruns += [float((corner - point) @ normal) / cosine for point in points]
    return max(overruns)


def _place_cap(joint: Joint, solve: ContactSolver, end: int, reach: float, offsets: tuple[float, ...]) -> float:
    """Return the t nearest to an end of the edge at which a flat cap stands on both faces.

    ``offsets`` are distances from the end, in units of ``reach`` (mm), that are tried in order.
    """
    error: CqblendError | None = None
    for offset in offsets:
        step = offset * reach / joint.spine.length
        if step > SOLID_BLEND_TOLERANCES.max_uncovered:
            break
        t = np.array([end + step if end == 0 else end - step])
        try:
            joint.check_end_cap(solve(t), joint.locate_on_surfaces(t), end)
            return float(t[0])
        except CqblendError as failure:
            error = error or failure
    raise TopologyError(f"there is no room for a flat end: {error}")
