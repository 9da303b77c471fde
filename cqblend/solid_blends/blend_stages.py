"""In which order the chains of a network are blended, where their ends meet in corners.

Where three blended edges meet, one of them is blended *first*: its blend ends on the face opposite, in a curve that
continues the other two tangentially, so that they and the curve become one chain, blended in a later stage. The first
one is that of the other convexity, if the three are not alike, else the largest, for a ball rolls around the inside of
a blend that is no smaller than itself. Where two meet beside a sharp edge, they are mitred in one stage; where that
cannot be, the larger one is blended before the other, which ends on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cqblend.blend_options import CornerWanted
from cqblend.brep.selection.blend_corners import ChainEnd, find_mitres, order_all_ends
from cqblend.errors import UnsupportedError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


@dataclass(frozen=True)
class RoundedCorner:
    """A vertex of three blended edges: the end of the chain that is blended first, and those that go on around it."""

    first: ChainEnd
    others: tuple[ChainEnd, ChainEnd]


@dataclass(frozen=True)
class NetworkStages:
    """The chains of a network by their indices, in the stages in which they are blended, and its rounded corners.

    ``has_patches`` tells whether there are corners with faces of their own.
    """

    stages: tuple[tuple[int, ...], ...]
    corners: tuple[RoundedCorner, ...]
    has_patches: bool = False

    def list_corners(self, stage: int) -> list[RoundedCorner]:
        """Return the corners around which chains of a stage go on."""
        return [corner for corner in self.corners if corner.others[0].chain in self.stages[stage]]


def plan_stages(chains: Sequence[ChainContext], corner: CornerWanted = "auto") -> NetworkStages:
    """Return the stages of the chains of a network, by the ``corner`` that is wanted where all edges are blended.

    Raises
    ------
    UnsupportedError
        If four or more of them, but not all edges, meet at a vertex, or corners demand orders that exclude each other.
    """
    meetings = [_Meeting(chains, ends) for ends in _find_meetings(chains).values() if len(ends) > 1]
    patched = [meeting for meeting in meetings if meeting.takes_patches(corner)]
    meetings = [meeting for meeting in meetings if meeting not in patched]
    for meeting in meetings:
        if len(meeting.ends) > 3:
            raise UnsupportedError(
                f"{len(meeting.ends)} of the edges meet at {meeting.name}, and others, too: corners of more than three "
                "are built where all edges are blended"
            )
    triples = [meeting for meeting in meetings if len(meeting.ends) == 3]
    corners = tuple(
        RoundedCorner(meeting.ends[k], (meeting.ends[k - 2], meeting.ends[k - 1]))
        for meeting, k in zip(triples, _choose_first_ends(triples), strict=True)
    )
    joined = [(corner.others[0].chain, corner.others[1].chain) for corner in corners]
    joined += [(one.chain, other.chain) for meeting in patched for one, other in pairwise(meeting.ends)]
    before = [(corner.first.chain, other.chain) for corner in corners for other in corner.others]
    pairs = [meeting for meeting in meetings if len(meeting.ends) == 2]
    mitres = find_mitres([context.chain for context in chains])
    mitred = {frozenset(corner.ends) for corner in mitres}
    before += [meeting.order for meeting in pairs if frozenset(meeting.ends) not in mitred]
    levels = _find_levels(len(chains), joined, before)
    if levels is None:
        raise UnsupportedError(
            f"the corners of {chains[0].name} and the edges that it is picked with cannot be blended in any order; "
            "blend some of the edges in a call of their own"
        )
    together = [(corner.ends[0].chain, corner.ends[1].chain) for corner in mitres]
    levels = _find_levels(len(chains), [*joined, *together], before) or levels
    stages = (tuple(k for k, level in enumerate(levels) if level == stage) for stage in range(max(levels) + 1))
    return NetworkStages(tuple(stages), corners, bool(patched))


def _find_meetings(chains: Sequence[ChainContext]) -> Mapping[int, list[ChainEnd]]:
    """Return the ends of open chains at each vertex, by its number in the solid."""
    found: dict[int, list[ChainEnd]] = {}
    for k, context in enumerate(chains):
        if not context.chain.closed:
            for end, joint in enumerate(context.end_joints):
                vertex = joint.index.vertices.find_number(joint.spine.vertices[end])
                found.setdefault(vertex, []).append(ChainEnd(k, end))
    return found


@dataclass(frozen=True)
class _Meeting:
    """Ends of chains at one vertex."""

    chains: Sequence[ChainContext]
    ends: Sequence[ChainEnd]

    @property
    def name(self) -> str:
        """What messages call the vertex."""
        end = self.ends[0]
        return self.chains[end.chain].end_joints[end.end].name_end(end.end)

    @cached_property
    def sizes(self) -> list[float]:
        """The size (mm) of each chain there."""
        return [self._measure_size(end) for end in self.ends]

    def _measure_size(self, end: ChainEnd) -> float:
        sizes = self.chains[end.chain].end_cells[end.end].method.sizes
        return float(np.max(sizes.measure(np.array([float(end.end)]))))

    @property
    def candidates(self) -> list[int]:
        """Which of three ends may be blended first: the one of the other convexity, or the largest ones."""
        convex = [self.chains[end.chain].end_joints[end.end].is_convex for end in self.ends]
        loops = [[other.chain for other in self.ends].count(end.chain) > 1 for end in self.ends]
        odd = [k for k, one in enumerate(convex) if convex.count(one) == 1]
        if odd:
            return odd
        free = [k for k, is_loop in enumerate(loops) if not is_loop]
        largest = max(self.sizes[k] for k in free)
        return [k for k in free if self.sizes[k] >= largest * (1 - SOLID_BLEND_TOLERANCES.equal_sizes)]

    def takes_patches(self, corner: CornerWanted) -> bool:
        """Whether the blends are put together by patches: all edges are blended, and more than three, or so wanted."""
        if len(self.ends) <= (3 if corner == "auto" else 2):
            return False
        return order_all_ends([context.chain for context in self.chains], self.ends) is not None

    @property
    def order(self) -> tuple[int, int]:
        """Two chains, the one first that is to be blended before the other: the larger one."""
        (first, second), (one, other) = self.sizes, (end.chain for end in self.ends)
        return (one, other) if first >= second else (other, one)


def _choose_first_ends(meetings: Sequence[_Meeting]) -> list[int]:
    """Return for each vertex of three ends the index of that which is blended first.

    Chains that are first at both of their ends are preferred, since all others can then be blended in one stage.
    """
    chosen: dict[int, int] = {}
    firsts: set[int] = set()
    waiting = set(range(len(meetings)))
    found = _match_vertices(meetings)
    for k in sorted(waiting, key=lambda k: len(meetings[k].candidates)):
        candidates = meetings[k].candidates
        chain_of = [meetings[k].ends[one].chain for one in candidates]
        preferred = next((one for one, chain in zip(candidates, chain_of, strict=True) if chain in found), None)
        if preferred is None:
            preferred = next(
                (one for one, chain in zip(candidates, chain_of, strict=True) if chain in firsts), candidates[0]
            )
        chosen[k] = preferred
        firsts.add(meetings[k].ends[preferred].chain)
    return [chosen[k] for k in range(len(meetings))]


def _match_vertices(meetings: Sequence[_Meeting]) -> set[int]:
    """Return chains such that each vertex has exactly one of them, as far as that can be.

    They are found by trial and error: next comes the vertex with the fewest chains left to choose from.
    """
    options = [{meeting.ends[k].chain for k in meeting.candidates} for meeting in meetings]
    every = [{end.chain for end in meeting.ends} for meeting in meetings]
    at_chain: dict[int, list[int]] = {}
    for k, own in enumerate(every):
        for chain in own:
            at_chain.setdefault(chain, []).append(k)
    budget = SOLID_BLEND_TOLERANCES.matching_trials

    def extend(matched: frozenset[int], chains: frozenset[int]) -> frozenset[int] | None:
        nonlocal budget
        waiting = [k for k in range(len(meetings)) if k not in matched]
        if not waiting:
            return chains
        budget -= 1
        usable = {
            k: [c for c in options[k] if all(c in options[j] and j not in matched for j in at_chain[c])]
            for k in waiting
        }
        k = min(waiting, key=lambda k: len(usable[k]))
        for chain in sorted(usable[k]):
            if budget <= 0:
                return None
            found = extend(matched | set(at_chain[chain]), chains | {chain})
            if found is not None:
                return found
        return None

    return set(extend(frozenset(), frozenset()) or ())


def _find_levels(
    count: int, together: Sequence[tuple[int, int]], before: Sequence[tuple[int, int]]
) -> list[int] | None:
    """Return the least level of each of some items, so that some are on one level, and some before others.

    None if that cannot be.
    """
    level = [0] * count
    for _ in range(count + 1):
        last = list(level)
        for one, other in before:
            level[other] = max(level[other], level[one] + 1)
        for one, other in together:
            level[one] = level[other] = max(level[one], level[other])
        if level == last:
            return level
    return None
