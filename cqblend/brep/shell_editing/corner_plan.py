"""What a corner of a network is planned to be: the ends of its strips, and the faces between them."""

from __future__ import annotations

from dataclasses import dataclass

from cqblend.blends.network.blend_plan import PatchPlan
from cqblend.brep.selection.blend_corners import CornerMethod
from cqblend.brep.shell_editing.strip_end import StripEnd


@dataclass(frozen=True)
class CornerPlan:
    """What the ends of chains that meet in a corner end in, in their order, and the faces between them."""

    method: CornerMethod
    ends: tuple[StripEnd, ...]
    patches: tuple[PatchPlan, ...] = ()
