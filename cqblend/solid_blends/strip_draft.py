"""Drafts of strips: each made and planned for itself, with the first ends, of those asked for, that can be built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from cqblend.blends.quality.creases import check_creases
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import CapStations, place_strip
from cqblend.brep.shell_editing.strip_planning import PlannedStrip, plan_strip
from cqblend.errors import CqblendError, SizeError, TopologyError, VerificationError
from cqblend.solid_blends.blend_acceptance import get_crease_limits
from cqblend.solid_blends.end_plan import EndAttempts, EndMethod, EndPlan, plan_ends
from cqblend.solid_blends.size_feasibility import check_size
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


@dataclass(frozen=True)
class StripDraft:
    """A strip as it is to go into the solid: its surface, its plan, and, of an open one, the plan of its ends."""

    context: StripContext
    blend: BlendSurface
    planned: PlannedStrip
    ends: EndPlan | None


class StripDrafts:
    """The drafts of one strip, one after the other: the next one is made if the one before does not verify."""

    def __init__(self, context: StripContext) -> None:
        self.context = context
        request, joint = context.method.request, context.joint
        self.attempts = EndAttempts(request.ends[::-1] if joint.is_backward else request.ends)
        self._methods: Iterator[tuple[EndMethod, EndMethod]] = iter(self.attempts)
        self._tried: tuple[EndMethod, EndMethod] | None = None

    def make_first(self) -> StripDraft:
        """Return the first draft.

        Raises
        ------
        CqblendError
            Why there is none.
        """
        check_size(self.context)
        return self.make_next(None)

    def make_next(self, failure: CqblendError | None) -> StripDraft:
        """Return the next draft, after the one before, if there was one, turned out to fail.

        Raises
        ------
        CqblendError
            If there is none: the first failure.
        """
        if self.context.joint.spine.closed:
            if failure is not None:
                raise failure
            return StripDraft(self.context, *draft_strip(self.context, (None, None), (0.0, 1.0)), None)
        if failure is not None and self._tried is not None:
            self.attempts.record_failure(self._tried, failure)
        for methods in self._methods:
            self._tried = methods
            try:
                plan = plan_ends(self.context, methods)
                return StripDraft(self.context, *draft_strip(self.context, plan.cap_stations, plan.rail_range), plan)
            except (BlendEndError, SizeError, TopologyError, VerificationError) as error:
                self.attempts.record_failure(methods, error)
        raise self.attempts.make_error(self.context.joint)


def draft_strip(
    context: StripContext, caps: CapStations, domain: tuple[float, float]
) -> tuple[BlendSurface, PlannedStrip]:
    """Make a blend between given ends, over at least the given range of t, and plan how it goes into the solid.

    Raises
    ------
    CqblendError
        Why that is not possible.
    """
    first, second = context.joint.face_numbers
    for _ in range(SOLID_BLEND_TOLERANCES.max_rail_fits):
        blend = context.make_blend(domain)
        context.method.check(blend)
        if not all(ribbon.light for ribbon in blend.ribbons):  # light ones run along lines and arcs without knot lines
            check_creases(
                blend,
                get_crease_limits(context.method.request),
                (f"face {first}", f"face {second}"),
                steers=context.method.steers,
            )
        try:
            return blend, plan_strip(place_strip(context.joint, blend), caps)
        except RailsTooShortError as short:
            slack = 0.1 * (short.needed_domain[1] - short.needed_domain[0])
            domain = (min(domain[0], short.needed_domain[0] - slack), max(domain[1], short.needed_domain[1] + slack))
    raise TopologyError("the blend runs on beside the face at the end of the edge without ever meeting it")
