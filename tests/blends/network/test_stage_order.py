"""The order in which items are done that meet in threes, on random networks."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from cqblend.blends.network.stage_order import Meeting, choose_leaders, find_stages


def draw_network(seed: int) -> tuple[int, list[Meeting]]:
    """Return items that meet in threes, each at two meetings, with some of them that must lead or may not."""
    rng = np.random.default_rng(seed)
    count = 2 * int(rng.integers(2, 5))
    stubs = rng.permutation(np.repeat(np.arange(3 * count // 2), 2)).reshape(count, 3).tolist()
    meetings = []
    for items in stubs:
        free = [item for item in items if items.count(item) == 1]
        leaders = [item for item in free if rng.random() < 0.7]
        meetings.append(Meeting(tuple(items), tuple(leaders), can_go_together=bool(rng.random() < 0.5)))
    return 3 * count // 2, meetings


def collect(meetings: list[Meeting], leaders: list[int | None]) -> tuple[list, list]:
    together, before = [], []
    for meeting, leader in zip(meetings, leaders, strict=True):
        others = [item for item in meeting.items if item != leader]
        together += [(one, other) for one, other in permutations(others, 2)]
        before += [(leader, other) for other in others if leader is not None]
    return together, before


@pytest.mark.parametrize("seed", range(60))
def test_what_is_chosen_may_lead_and_can_be_done_in_stages(seed):
    count, meetings = draw_network(seed)
    leaders = choose_leaders(count, meetings)
    if leaders is None:
        assert not any_order(count, meetings)
        return
    for meeting, leader in zip(meetings, leaders, strict=True):
        assert leader in meeting.leaders if leader is not None else meeting.can_go_together
    together, before = collect(meetings, leaders)
    stages = find_stages(count, together, before)
    assert stages is not None
    assert all(stages[one] == stages[other] for one, other in together)
    assert all(stages[one] < stages[other] for one, other in before)


def any_order(count: int, meetings: list[Meeting]) -> bool:
    """Whether any choice can be done in stages, by trying all of them."""
    choices = [[*one.leaders, *([None] if one.can_go_together else [])] for one in meetings]
    if not all(choices):
        return False
    total = np.prod([len(one) for one in choices], dtype=float)
    assert total < 1e5
    for index in np.ndindex(*(len(one) for one in choices)):
        leaders = [own[k] for own, k in zip(choices, index, strict=True)]
        if find_stages(count, *collect(meetings, leaders)) is not None:
            return True
    return False


def test_a_choice_that_would_go_in_a_circle_is_not_made():
    meetings = [Meeting((0, 1, 2), (0,)), Meeting((1, 3, 4), (1, 3))]
    assert choose_leaders(5, meetings, before=[(3, 0)]) == [0, 3]


def test_prisms_take_two_stages():
    for n in (3, 4, 9):
        top = [Meeting((k, (k + 1) % n, 2 * n + k), (k, (k + 1) % n, 2 * n + k)) for k in range(n)]
        base = [Meeting((n + k, n + (k + 1) % n, 2 * n + k), (n + k, n + (k + 1) % n, 2 * n + k)) for k in range(n)]
        leaders = choose_leaders(3 * n, top + base)
        assert leaders is not None
        stages = find_stages(3 * n, *collect(top + base, leaders))
        assert max(stages) == 1
