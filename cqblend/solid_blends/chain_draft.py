"""Drafts of chains: each made and planned for itself, with the first ends, of those asked for, that can be built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from cqblend.blends.quality.creases import check_creases
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import CapStations, place_strip
from cqblend.brep.shell_editing.strip_planning import PlannedChain, plan_chain
from cqblend.errors import CqblendError, GeometryError, SizeError, TopologyError, VerificationError
from cqblend.solid_blends.blend_acceptance import get_crease_limits
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.end_plan import EndAttempts, EndMethod, EndPlan, plan_ends
from cqblend.solid_blends.size_feasibility import check_chain_size
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


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


class ChainDrafts:
    """The drafts of one chain, one after the other: the next one is made if the one before does not verify."""

    def __init__(self, context: ChainContext) -> None:
        self._start(context)

    def _start(self, context: ChainContext) -> None:
        """Begin with drafts of a context."""
        self.context = context
        request, first = context.method.request, context.cells[0].joint
        ends = request.ends[::-1] if first.is_backward else request.ends
        self.attempts = EndAttempts(ends, context.find_point_ends(ends))
        self._methods: Iterator[tuple[EndMethod, EndMethod]] = iter(self.attempts)
        self._tried: tuple[EndMethod, EndMethod] | None = None

    def make_first(self) -> ChainDraft:
        """Return the first draft.

        If rails leave faces over smooth edges, that is one of the divided chain; next to the ends of an open chain they
        may also go on beside the face, if that fails.

        Raises
        ------
        CqblendError
            Why there is none.
        """
        whole = self.context
        check_chain_size(whole)
        try:
            divided = whole.divide()
            if divided is not whole:
                self._start(divided)
                return self.make_next(None)
        except CqblendError:
            if whole.must_be_divided:
                raise
            self._start(whole)
        return self.make_next(None)

    def make_next(self, failure: CqblendError | None) -> ChainDraft:
        """Return the next draft, after the one before, if there was one, turned out to fail.

        Raises
        ------
        CqblendError
            If there is none: the first failure.
        """
        context = self.context
        if context.chain.closed:
            if failure is not None:
                raise failure
            return ChainDraft(context, *draft_chain(context, (None, None), (0.0, 1.0)), None)
        if failure is not None and self._tried is not None:
            self.attempts.record_failure(self._tried, failure)
        for methods in self._methods:
            self._tried = methods
            try:
                plan = plan_ends(context.end_cells, methods)
                return ChainDraft(context, *draft_chain(context, plan.cap_stations, plan.rail_range), plan)
            except BlendEndError as error:
                self.attempts.record_failure(methods, self._mention_continuation(methods, error))
            except (SizeError, TopologyError, VerificationError) as error:
                self.attempts.record_failure(methods, error)
        raise self.attempts.make_error(context.end_joints)

    def _mention_continuation(self, methods: tuple[EndMethod, EndMethod], error: BlendEndError) -> BlendEndError:
        """Return an error of a natural end that says in which edge the joint goes on there, if it does."""
        joint = self.context.end_joints[error.end]
        following = joint.find_continuing_edge(error.end) if methods[error.end] == "natural" else None
        if following is None:
            return error
        before = f"the joint goes on there in {joint.name_part(following)}, and "
        after = "" if self.context.method.request.chain else "; chain=True lets it go on"
        return BlendEndError(error.end, error.cause.with_details(before=before, after=after))


def draft_chain(
    context: ChainContext, caps: CapStations, domain: tuple[float, float]
) -> tuple[tuple[BlendSurface, ...], PlannedChain]:
    """Make the blends of a chain between given ends, over at least the given range; plan how they go into the solid.

    ``domain`` is from a t of the first cell to one of the last.

    Raises
    ------
    CqblendError
        Why that is not possible.
    """
    short_end: int | None = None
    for _ in range(SOLID_BLEND_TOLERANCES.max_rail_fits):
        try:
            blends = _make_blends(context, domain)
        except (GeometryError, SizeError) as error:
            if short_end is None:
                raise
            raise BlendEndError(
                short_end, error.with_details(before="it meets no face that it could end on: ")
            ) from error
        placements = [place_strip(cell.joint, blend) for cell, blend in zip(context.cells, blends, strict=True)]
        try:
            return blends, plan_chain(placements, context.chain, caps)
        except RailsTooShortError as short:
            short_end = 0 if short.needed_domain[0] < domain[0] else 1
            domain = lengthen_domain(domain, short.needed_domain)
    nothing = TopologyError("the blend runs on beside the faces there without ever meeting them")
    raise nothing if short_end is None else BlendEndError(short_end, nothing)


def lengthen_domain(domain: tuple[float, float], needed: tuple[float, float]) -> tuple[float, float]:
    """Return a domain that has what is needed, and a little more where it was too short, for the next fit differs."""
    slack = 0.1 * (needed[1] - needed[0])
    before, after = max(domain[0] - needed[0], 0.0), max(needed[1] - domain[1], 0.0)
    return domain[0] - before - min(slack, before), domain[1] + after + min(slack, after)


def _make_blends(context: ChainContext, domain: tuple[float, float]) -> tuple[BlendSurface, ...]:
    """Return the blends of all cells of a chain, over at least a given range, and check them one by one."""
    blends = tuple(context.make_blends(domain))
    for cell, blend in zip(context.cells, blends, strict=True):
        check_blend(cell, blend)
    return blends


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
