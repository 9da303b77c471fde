"""Networks: chains that touch belong together, however they are given."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.network.edge_networks import group_networks


def reference(vertices: list[frozenset[int]]) -> set[frozenset[int]]:
    """Group by following neighbours one by one."""
    left, groups = set(range(len(vertices))), set()
    while left:
        group, waiting = set(), [min(left)]
        while waiting:
            one = waiting.pop()
            if one in group:
                continue
            group.add(one)
            waiting += [k for k in left if vertices[k] & vertices[one]]
        groups.add(frozenset(group))
        left -= group
    return groups


@pytest.mark.parametrize("seed", range(20))
def test_networks_are_the_connected_parts(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 30))
    chains = [frozenset(rng.integers(0, 40, int(rng.integers(1, 4))).tolist()) for _ in range(count)]
    found = group_networks(chains)
    assert {frozenset(group) for group in found} == reference(chains)
    assert [group[0] for group in found] == sorted(group[0] for group in found)
    assert all(group == sorted(group) for group in found)


def test_no_chains_no_networks():
    assert group_networks([]) == []
