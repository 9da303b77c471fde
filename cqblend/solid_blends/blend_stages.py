"""In which order the chains of a network are blended, where their ends meet in corners.

Where three blended edges meet, one of them is blended *first*: its blend ends on the face opposite, in a curve that
continues the other two tangentially, so that they and the curve become one chain, blended in a later stage. The first
one is that of the other convexity, if the three are not alike, else the largest, for a ball rolls around the inside of
a blend that is no smaller than itself; of these, rather a straight one square to the face that its blend ends on. Where
two meet beside a sharp edge, they are mitred in one stage; where that cannot be, the larger one is blended before the
other, which ends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cqblend.blend_options import CornerWanted
from cqblend.blends.network.stage_order import Meeting, choose_leaders, find_stages
from cqblend.brep.selection.blend_corners import ChainEnd, find_mitres, group_ends, order_all_ends
from cqblend.errors import UnsupportedError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.surfaces.quadrics import Plane


@dataclass(frozen=True)
class RoundedCorner:
    """A vertex of three blended edges: the end of the chain that is blended first, and those that go on around it."""

    first: ChainEnd
    others: tuple[ChainEnd, ChainEnd]


@dataclass(frozen=True)
class NetworkStages:
    """The chains of a network by their indices, in the stages in which they are blended, and its rounded corners.

    ``obeys_corner`` tells whether the ``corner`` that is wanted has an effect somewhere.
    """

    stages: tuple[tuple[int, ...], ...]
    corners: tuple[RoundedCorner, ...]
    obeys_corner: bool = True

    def list_corners(self, stage: int) -> list[RoundedCorner]:
        """Return the corners around which chains of a stage go on."""
        return [corner for corner in self.corners if corner.others[0].chain in self.stages[stage]]


def plan_stages(
    chains: Sequence[ChainContext], corner: CornerWanted = "auto", *, patches_only: bool = False
) -> NetworkStages:
    """Return the stages of the chains of a network, by the ``corner`` that is wanted where all edges are blended.

    With ``patches_only``, blends go round one another only where not all edges of a vertex are blended.

    Raises
    ------
    UnsupportedError
        If four or more of them, but not all edges, meet at a vertex, or corners demand orders that exclude each other.
    """
    own = [context.chain for context in chains]
    meetings = [_Meeting(chains, ends) for ends in group_ends(own).values() if len(ends) > 1]
    least = 4 if corner == "auto" and not patches_only else 3
    patched = [meeting for meeting in meetings if len(meeting.ends) >= least and meeting.is_all_around]
    meetings = [meeting for meeting in meetings if meeting not in patched]
    if corner == "mitre" and patched:
        raise UnsupportedError(
            f"all edges at {patched[0].name} are blended, and a mitre needs one that stays sharp: leave out corner=, "
            "or pick one edge less"
        )
    for meeting in meetings:
        if len(meeting.ends) > 3:
            raise UnsupportedError(
                f"{len(meeting.ends)} of the edges meet at {meeting.name}, beside others, sharp or smooth: corners of "
                "more than three are built where all edges are blended"
            )
    triples = [meeting for meeting in meetings if len(meeting.ends) == 3]
    mitres = find_mitres(own)
    mitred = {frozenset(corner.ends) for corner in mitres}
    before = [one.order for one in meetings if len(one.ends) == 2 and frozenset(one.ends) not in mitred]
    together = [(one.chain, other.chain) for meeting in patched for one, other in pairwise(meeting.ends)]
    around = [meeting.list_leaders() for meeting in triples]
    leaders = choose_leaders(len(chains), around, together, before)
    for one, leader in zip(around, leaders or [], strict=False):
        in_one_stage, in_order = one.list_constraints(leader)
        together += in_one_stage
        before += in_order
    in_mitres = [(corner.ends[0].chain, corner.ends[1].chain) for corner in mitres]
    stage_of = find_stages(len(chains), [*together, *in_mitres], before) or find_stages(len(chains), together, before)
    if leaders is None or stage_of is None:
        raise UnsupportedError(
            f"the corners of {chains[0].name} and the edges that it is picked with cannot be blended in any order; "
            "blend some of the edges in a call of their own"
        )
    corners = [meeting.round(one) for meeting, one in zip(triples, leaders, strict=True) if one is not None]
    stages = (tuple(k for k, stage in enumerate(stage_of) if stage == n) for n in range(max(stage_of) + 1))
    return NetworkStages(tuple(stages), tuple(corners), bool(mitres if corner == "mitre" else patched))


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

    def list_leaders(self) -> Meeting:
        """Return which of three chains may be blended first: the one of the other convexity, or the largest ones.

        There is none where two chains are larger than the third, or widths are the same, for what turns around the
        blend of one of them would have no room there.
        """
        convex = [self.chains[end.chain].end_joints[end.end].is_convex for end in self.ends]
        items = [end.chain for end in self.ends]
        odd = [k for k in range(3) if convex.count(convex[k]) == 1]
        largest = [k for k in range(3) if self.sizes[k] >= max(self.sizes) * (1 - SOLID_BLEND_TOLERANCES.equal_sizes)]
        is_ball = self.chains[items[0]].method.request.radius is not None
        can_turn = len(largest) == 1 or (len(largest) == 3 and is_ball)
        leaders = [k for k in odd or (largest if can_turn else []) if items.count(items[k]) == 1]
        return Meeting(
            (items[0], items[1], items[2]),
            tuple(items[k] for k in leaders),
            tuple(items[k] for k in leaders if self._ends_square(self.ends[k])),
            can_go_together=self.is_all_around,
        )

    def _ends_square(self, end: ChainEnd) -> bool:
        """Whether a chain is straight and ends on a plane square to it, so that what goes round it may be a torus."""
        joint = self.chains[end.chain].end_joints[end.end]
        across = joint.read_end_face(end.end)
        if across is None or not isinstance(across.primary, Plane):
            return False
        tangents = joint.locate_stations(np.array([0.0, 0.5, 1.0])).tangents
        normal = across.primary.evaluate_normals(np.zeros((1, 2)))[0]
        return bool(np.abs(tangents @ normal).min() > 1 - SOLID_BLEND_TOLERANCES.square_cosine)

    def round(self, leader: int) -> RoundedCorner:
        """Return the corner of three chains of which one is blended first."""
        (first,) = (end for end in self.ends if end.chain == leader)
        one, other = (end for end in self.ends if end.chain != leader)
        return RoundedCorner(first, (one, other))

    @property
    def is_all_around(self) -> bool:
        """Whether the ends are all edges of the vertex."""
        return order_all_ends([context.chain for context in self.chains], self.ends) is not None

    @property
    def order(self) -> tuple[int, int]:
        """Two chains, the one first that is to be blended before the other: the larger one."""
        (first, second), (one, other) = self.sizes, (end.chain for end in self.ends)
        return (one, other) if first >= second else (other, one)
