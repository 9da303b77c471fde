"""Drafts of chains, and the ends that are tried for one: the first, of those asked for, that can be built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from cqblend.blends.quality.creases import check_creases
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.strip_planning import PlannedChain
from cqblend.errors import CqblendError, SizeError, TopologyError, VerificationError
from cqblend.solid_blends.blend_acceptance import get_crease_limits
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.end_plan import EndAttempts, EndMethod, EndPlan, plan_ends
from cqblend.solid_blends.strip_context import StripContext


@dataclass(frozen=True)
class ChainDraft:
    """A chain as it is to go into the solid: the surfaces of its cells, its plan, and, if open, that of its ends."""

    context: ChainContext
    blends: tuple[BlendSurface, ...]
    planned: PlannedChain
    ends: EndPlan | None

    @property
    def uncovered(self) -> float:
        """The length (mm) of the chain's edges that is not blended, beyond flat caps."""
        return 0.0 if self.ends is None else self.ends.measure_uncovered(self.context.lengths)


class EndTrials:
    """The plans of the ends of one chain, one after the other; ``plan`` is the present one, and None if it is closed.

    ``corners`` are the methods that the corners demand which it starts and stops at, if it does.
    """

    def __init__(self, context: ChainContext, corners: tuple[EndMethod | None, EndMethod | None]) -> None:
        self.context = context
        request, first = context.method.request, context.cells[0].joint
        ends = request.ends[::-1] if first.is_backward else request.ends
        self.attempts = EndAttempts(ends, context.find_point_ends(ends), corners)
        self.plan: EndPlan | None = None
        self._methods: Iterator[tuple[EndMethod, EndMethod]] = iter(self.attempts)

    def advance(self, failure: CqblendError | None) -> None:
        """Make the next plan, after the one before, if there was one, turned out to fail.

        Raises
        ------
        CqblendError
            If there is none: the first failure.
        """
        context = self.context
        if context.chain.closed:
            if failure is not None:
                raise failure.cause if isinstance(failure, BlendEndError) else failure
            return
        if failure is not None and self.plan is not None:
            self._record_failure(self.plan.methods, failure)
        for methods in self._methods:
            try:
                self.plan = plan_ends(context.end_cells, methods)
            except (BlendEndError, SizeError, TopologyError, VerificationError) as error:
                self._record_failure(methods, error)
            else:
                return
        raise self.attempts.make_error(context.end_joints)

    def _record_failure(self, methods: tuple[EndMethod, EndMethod], error: CqblendError) -> None:
        """Record why an attempt failed."""
        if isinstance(error, BlendEndError):
            error = self._mention_continuation(methods, error)
        self.attempts.record_failure(methods, error)

    def _mention_continuation(self, methods: tuple[EndMethod, EndMethod], error: BlendEndError) -> BlendEndError:
        """Return an error of a natural end that says in which edge the joint goes on there, if it does."""
        joint = self.context.end_joints[error.end]
        following = joint.find_continuing_edge(error.end) if methods[error.end] == "natural" else None
        if following is None:
            return error
        before = f"the joint goes on there in {joint.name_part(following)}, and "
        after = "" if self.context.method.request.chain else "; chain=True lets it go on"
        return BlendEndError(error.end, error.cause.with_details(before=before, after=after))


def check_blend(context: StripContext, blend: BlendSurface) -> None:
    """Check that a blend neither folds nor has a sharper crease inside than is allowed."""
    context.method.check(blend)
    if all(ribbon.light for ribbon in blend.ribbons):  # these run along lines and arcs without knot lines
        return
    first, second = context.joint.face_numbers
    check_creases(
        blend,
        get_crease_limits(context.method.request),
        (f"face {first}", f"face {second}"),
        steers=context.method.steers,
    )
