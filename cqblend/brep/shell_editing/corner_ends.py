"""Corners of a network: where the ends of several chains meet, and end in what they have in common there.

A corner is a node of the network, planned from the placed strips of all its chains at once, after every strip has been
made and before the cells between two nodes are planned. For each way to put a corner together there is one function
from the ends that meet to a :class:`CornerPlan`: what each of them ends in. Edges that two share are one object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from cqblend.brep.selection.blend_corners import BlendCorner, CornerMethod
from cqblend.brep.shell_editing.ball_corner import rest_ball
from cqblend.brep.shell_editing.corner_patches import patch_crossing_rails, patch_set_back_ends
from cqblend.brep.shell_editing.corner_plan import CornerPlan
from cqblend.brep.shell_editing.mitred_ends import mitre_ends
from cqblend.brep.shell_editing.mitred_strip import pair_strips
from cqblend.brep.shell_editing.strip_end import PlacedEnd, StripsTooShortError
from cqblend.brep.shell_editing.turned_ends import turn_ends
from cqblend.errors import DegreeError, GeometryError, SizeError


def plan_corner(corner: BlendCorner, ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan a corner by the first of its methods that fits, from the ends that meet there.

    They go around the vertex counter-clockwise, seen from outside of the solid.

    The ends may lie past those of the strips as they are: the rails must then be made longer.

    Raises
    ------
    StripsTooShortError
        If the strips must reach further to meet.
    SizeError, TopologyError, GeometryError
        If the strips do not meet there as the methods have it: why the last one fails.
    """
    methods = (corner.method, *corner.alternatives)
    for method in methods[:-1]:
        try:
            return _plan_by_method(method, corner, ends)
        except StripsTooShortError:
            raise
        except (GeometryError, SizeError, DegreeError):
            continue
    return _plan_by_method(methods[-1], corner, ends)


def _plan_by_method(method: CornerMethod, corner: BlendCorner, ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan a corner by one method."""
    if method == "setback":
        return patch_set_back_ends(ends, corner.setbacks or (None,) * len(ends))
    return _PLANNERS[method](ends)


def _plan_mitre(ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan two strips that end in each other."""
    return mitre_ends(*pair_strips(ends))


def _plan_turn(ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan two strips between which their ball turns about the sharp edge beside them."""
    return turn_ends(*pair_strips(ends))


_PLANNERS: Mapping[CornerMethod, Callable[[Sequence[PlacedEnd]], CornerPlan]] = {
    "ball": rest_ball,
    "cross": patch_crossing_rails,
    "mitre": _plan_mitre,
    "turn": _plan_turn,
}
