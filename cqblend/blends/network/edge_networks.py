"""Which blended edges belong together: a network is a largest set of chains of edges that touch one another."""

from __future__ import annotations

from collections.abc import Sequence


def group_networks(vertices: Sequence[frozenset[int]]) -> list[list[int]]:
    """Group chains of edges, each given by the numbers of its vertices, into networks; return lists of their indices.

    Networks and the chains in them come in the order in which the chains are given.

    Examples
    --------
    >>> group_networks([frozenset({1, 2}), frozenset({5}), frozenset({2, 3}), frozenset({3, 4})])
    [[0, 2, 3], [1]]
    """
    network_of = list(range(len(vertices)))
    chain_at: dict[int, int] = {}
    for chain, own in enumerate(vertices):
        for vertex in sorted(own):
            first, other = network_of[chain], network_of[chain_at.setdefault(vertex, chain)]
            if first != other:
                network_of = [min(first, other) if one in (first, other) else one for one in network_of]
    groups: dict[int, list[int]] = {}
    for chain, network in enumerate(network_of):
        groups.setdefault(network, []).append(chain)
    return list(groups.values())
