"""In which stages items are done, of which some go together and some before others.

Items are numbers from 0. Where three of them meet, one *leads*: it is done before the other two, which go together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from cqblend.blends.network.tolerances import NETWORK_TOLERANCES

Pairs = Sequence[tuple[int, int]]


def find_stages(count: int, together: Pairs, before: Pairs) -> list[int] | None:
    """Return the least stage of each item, from 0, so that some pairs share one, and others come one before the other.

    None if these exclude each other.

    Examples
    --------
    >>> find_stages(4, together=[(1, 2)], before=[(0, 1), (2, 3)])
    [0, 1, 1, 2]
    >>> find_stages(3, together=[(1, 2)], before=[(0, 1), (2, 0)])
    """
    stage = [0] * count
    for _ in range(count + 1):
        last = list(stage)
        for one, other in before:
            stage[other] = max(stage[other], stage[one] + 1)
        for one, other in together:
            stage[one] = stage[other] = max(stage[one], stage[other])
        if stage == last:
            return stage
    return None


@dataclass(frozen=True)
class Meeting:
    """Three items that meet, and which of them may lead, those rather that are ``preferred``.

    ``can_go_together`` tells whether all three may go in one stage, without a leader.
    """

    items: tuple[int, int, int]
    leaders: tuple[int, ...]
    preferred: tuple[int, ...] = ()
    can_go_together: bool = False

    def list_constraints(self, leader: int | None) -> tuple[Pairs, Pairs]:
        """Return the pairs that go together, and those of one before the other, if one leads; or all go together."""
        if leader is None:
            return list(zip(self.items, self.items[1:], strict=False)), []
        first, second = (one for one in self.items if one != leader)
        return [(first, second)], [(leader, first), (leader, second)]


@dataclass
class _Search:
    """A search for leaders that exclude no others, one meeting after the other."""

    count: int
    meetings: Sequence[Meeting]
    together: Pairs
    before: Pairs
    trials: int = NETWORK_TOLERANCES.order_trials
    chosen: list[int | None] = field(default_factory=list)

    def find_stages(self) -> list[int] | None:
        together, before = list(self.together), list(self.before)
        for meeting, leader in zip(self.meetings, self.chosen, strict=False):
            own = meeting.list_constraints(leader)
            together += own[0]
            before += own[1]
        return find_stages(self.count, together, before)

    def run(self) -> bool:
        """Choose a leader at every meeting, or none; whether that was possible."""
        if not self.meetings:
            return True
        untried = [self._rank_leaders()]
        while untried and self.trials > 0:
            if not untried[-1]:
                untried.pop()
                del self.chosen[-1:]
                continue
            self.chosen.append(untried[-1].pop(0))
            if len(self.chosen) == len(self.meetings):
                return True
            untried.append(self._rank_leaders())
        return False

    def _rank_leaders(self) -> list[int | None]:
        """Return who may lead at the next meeting: first who is preferred, needs few stages, or leads already."""
        leading, meeting = set(self.chosen), self.meetings[len(self.chosen)]
        ranks: dict[int | None, tuple[bool, bool, int, bool]] = {}
        for leader in (*meeting.leaders, *([None] if meeting.can_go_together else [])):
            self.trials -= 1
            self.chosen.append(leader)
            stages = self.find_stages()
            self.chosen.pop()
            if stages is not None:
                disliked = leader not in meeting.preferred
                ranks[leader] = (leader is None, disliked, max(stages), leader not in leading)
        return sorted(ranks, key=lambda leader: ranks[leader])


def choose_leaders(
    count: int, meetings: Sequence[Meeting], together: Pairs = (), before: Pairs = ()
) -> list[int | None] | None:
    """Return which item leads at each meeting, so that all can be done in some stages; in few, if preferences allow it.

    Some pairs go ``together`` anyhow, and in some the first comes ``before`` the second.

    None in the place of a leader stands for all three together, which is the last resort; None for all of them says
    that no choice was found.

    Examples
    --------
    The corners of a cube, by the numbers of its edges: four edges lead at two corners each, all others follow.

    >>> rim = [Meeting((k, (k + 1) % 4, 4 + k), (k, (k + 1) % 4, 4 + k)) for k in range(4)]
    >>> base = [Meeting((8 + k, 8 + (k + 1) % 4, 4 + k), (4 + k,)) for k in range(4)]
    >>> choose_leaders(12, rim + base)
    [4, 5, 6, 7, 4, 5, 6, 7]
    """
    order = sorted(range(len(meetings)), key=lambda k: len(meetings[k].leaders))
    liked = [replace(one, leaders=one.preferred or one.leaders) for one in meetings]
    matching = _match_meetings(liked) or _match_meetings(meetings)
    sorted_meetings = [
        replace(one, leaders=tuple(sorted(one.leaders, key=lambda item: item not in matching)))
        for one in (meetings[k] for k in order)
    ]
    search = _Search(count, sorted_meetings, together, before)
    if not search.run():
        return None
    leaders = dict(zip(order, search.chosen, strict=True))
    return [leaders[k] for k in range(len(meetings))]


def _match_meetings(meetings: Sequence[Meeting]) -> frozenset[int]:
    """Return items such that each meeting has exactly one of them, which may lead there; none if that was not found.

    They are found by trial and error: next comes the meeting with the fewest items left to choose from.
    """
    at_item: dict[int, list[int]] = {}
    for k, meeting in enumerate(meetings):
        for item in meeting.items:
            at_item.setdefault(item, []).append(k)
    trials = NETWORK_TOLERANCES.matching_trials

    def extend(matched: frozenset[int], items: frozenset[int]) -> frozenset[int] | None:
        nonlocal trials
        waiting = [k for k in range(len(meetings)) if k not in matched]
        if not waiting:
            return items
        trials -= 1
        usable = {
            k: [
                item
                for item in meetings[k].leaders
                if all(item in meetings[j].leaders and j not in matched for j in at_item[item])
            ]
            for k in waiting
        }
        k = min(waiting, key=lambda k: len(usable[k]))
        for item in usable[k]:
            if trials <= 0:
                return None
            found = extend(matched | set(at_item[item]), items | {item})
            if found is not None:
                return found
        return None

    return extend(frozenset(), frozenset()) or frozenset()
