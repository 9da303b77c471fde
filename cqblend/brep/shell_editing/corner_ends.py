"""Corners of a network: where the ends of several chains meet, and end in what they have in common there.

A corner is a node of the network, planned from the placed strips of all its chains at once, after every strip has been
made and before the cells between two nodes are planned. For each way to put a corner together there is one function
from the ends that meet to a :class:`CornerPlan`: what each of them ends in. Edges that two share are one object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cqblend.brep.selection.blend_corners import CornerMethod
from cqblend.brep.shell_editing.mitred_ends import mitre_ends
from cqblend.brep.shell_editing.strip_end import PlacedEnd, StripEnd


@dataclass(frozen=True)
class CornerPlan:
    """What the ends of chains that meet in a corner end in, in the order of the corner's ends."""

    ends: tuple[StripEnd, ...]


def plan_corner(method: CornerMethod, ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan a corner by its method, from the ends that meet there, counter-clockwise seen from outside of the solid.

    The ends may lie past those of the strips as they are: the rails must then be made longer.

    Raises
    ------
    SizeError, TopologyError, GeometryError
        If the strips do not meet there as the method has it.
    """
    return _PLANNERS[method](ends)


def _plan_mitre(ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan two strips that end in each other."""
    first, second = ends
    return CornerPlan(mitre_ends(first, second))


_PLANNERS: Mapping[CornerMethod, Callable[[Sequence[PlacedEnd]], CornerPlan]] = {"mitre": _plan_mitre}
