"""Chains of edges of CadQuery bodies, as cells and the smooth edges between them; and how finished cells meet.

Chains are put together here from joints and vertices alone, apart from what selects chains in the package.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopoDS import TopoDS_Edge

from cqblend.blend_options import BlendOptions
from cqblend.blends.network.chain_cell import CellRails
from cqblend.blends.network.chain_ribbons import ChainRibbons, fit_chain_ribbons
from cqblend.blends.network.junction_stations import CrossedEdge, Crossings, CurveOnSurface
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_sides import find_edge_sides, read_pcurve
from cqblend.brep.selection.joint import Joint, make_joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.topology import explore_subshapes, is_among, orient_forward
from cqblend.solid_blends.section_methods import choose_section_method, get_largest_arc
from cqblend.solid_blends.section_strategy import SectionMethod
from cqblend.solid_blends.strip_context import StripContext
from cqblend.splines import Surface


@dataclass
class ChainCase:
    """A chain of a body, cell by cell."""

    contexts: list[StripContext]
    cells: list[CellRails]
    crossings: list[Crossings]
    closed: bool

    def fit(self, domain: tuple[float, float] = (0.0, 1.0)) -> ChainRibbons:
        """Fit the ribbons of all cells; an open chain over the given domain."""
        return fit_chain_ribbons(self.cells, self.crossings, None if self.closed else domain)

    def fill(self, ribbons: ChainRibbons) -> list[BlendSurface]:
        """Return the blends of all cells."""
        return [context.section.fill(pair) for context, pair in zip(self.contexts, ribbons.cells, strict=True)]

    def measure(self, blends: Sequence[BlendSurface]) -> tuple[float, float]:
        """Return the largest gap (mm) and angle (rad) between consecutive cells, as their surfaces have it."""
        pairs = [(k, (k + 1) % len(self.cells)) for k in range(len(self.crossings))]
        found = [measure_seam(blends[a].surface, blends[b].surface) for a, b in pairs]
        gap, angle = np.max(found, axis=0)
        return float(gap), float(angle)


def measure_seam(before: Surface, after: Surface) -> tuple[float, float]:
    """Return the largest gap and angle between the last section of one blend and the first one of another."""
    v = np.linspace(0, 1, 101)
    rows = []
    for surface, end, side in ((before, 1, "left"), (after, 0, "right")):
        u = np.full(len(v), surface.domain[0][end])
        point, along, across = (surface(u, v, *order, side=side) for order in ((0, 0), (1, 0), (0, 1)))
        normal = np.cross(along, across)
        rows.append((point, normal / np.linalg.norm(normal, axis=1)[:, None]))
    (p, n), (q, m) = rows
    angle = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(axis=1))
    return float(np.linalg.norm(p - q, axis=1).max()), float(angle.max())


def chain_of(shape: cq.Shape, edges: Iterable[cq.Edge], first: cq.Face, **options: Any) -> ChainCase:
    """Put edges, in any order, into a chain whose first cell has the given face on side 1."""
    index = SolidIndex(next(iter(explore_subshapes(shape.wrapped, TopAbs_SOLID))))
    method = choose_section_method(BlendOptions(**options).to_request())
    waiting = [edge.wrapped for edge in edges]
    start = next(edge for edge in waiting if any(face.IsSame(first.wrapped) for face in index.faces_at_edge(edge)))
    joints = [next(one for one in both_ways(index, start) if one.sides[0].face.IsSame(first.wrapped))]
    while waiting := [edge for edge in waiting if not any(is_among(edge, joint.spine.edges) for joint in joints)]:
        if not add_following(index, joints, waiting):
            raise ValueError("the edges are no chain")
    closed = len(joints) > 1 and joints[-1].spine.vertices[1].IsSame(joints[0].spine.vertices[0])
    contexts = [StripContext(one, method) for one in joints]
    pairs = list(zip(joints, joints[1:] + joints[:1], strict=True))[: None if closed else -1]
    return ChainCase(
        contexts,
        [cell_of(context, method) for context in contexts],
        [crossings_of(index, before, after) for before, after in pairs],
        closed,
    )


def both_ways(index: SolidIndex, edge: TopoDS_Edge) -> list[Joint]:
    """Return the joint of an edge with either face first, and so in both senses."""
    (face1, use1), (face2, use2) = find_edge_sides(index.solid, edge)
    number = index.edges.find_number(edge)
    return [
        make_joint(index, EdgeSpine([use], closed=False), faces, number, (0, 0), index.edges.find_number)
        for use, faces in ((use1, (face1, face2)), (use2, (face2, face1)))
    ]


def add_following(index: SolidIndex, joints: list[Joint], waiting: Sequence[TopoDS_Edge]) -> bool:
    """Add the joint of one of some edges to either end of a chain; return whether there is one."""
    for edge in waiting:
        for joint in both_ways(index, edge):
            if joint.spine.vertices[0].IsSame(joints[-1].spine.vertices[1]):
                joints.append(joint)
                return True
            if joint.spine.vertices[1].IsSame(joints[0].spine.vertices[0]):
                joints.insert(0, joint)
                return True
    return False


def cell_of(context: StripContext, method: SectionMethod) -> CellRails:
    """Return what a joint brings to a chain."""
    joint, targets = context.joint, method.targets

    def fit_light(domain: tuple[float, float]) -> tuple[Ribbon, Ribbon] | None:
        straight = fit_straight_ribbons(joint.primaries, context.solve, domain, targets, joint.extent)
        turn = joint.spine.measure_arc_angle()
        if straight is not None or turn is None:
            return straight
        layout = ArcLayout(domain, turn, get_largest_arc(joint))
        return fit_circular_ribbons(joint.primaries, context.solve, layout, targets, joint.extent)

    return CellRails(joint.primaries, context.solve, targets, joint.spine.length, fit_light)


def crossings_of(index: SolidIndex, before: Joint, after: Joint) -> Crossings:
    """Return the smooth edges between the faces of two consecutive joints."""
    found: list[CrossedEdge | None] = []
    for first, second in zip(before.sides, after.sides, strict=True):
        if first.face.IsSame(second.face):
            found.append(None)
            continue
        (edge,) = (
            edge
            for edge in index.edges_at_vertex(before.spine.vertices[1])
            if all(any(face.IsSame(one.face) for face in index.faces_at_edge(edge)) for one in (first, second))
        )
        found.append(CrossedEdge(curve_on(edge, first), curve_on(edge, second), BRep_Tool.Range_s(edge)))
    return found[0], found[1]


def curve_on(edge: TopoDS_Edge, side: SupportFace) -> CurveOnSurface:
    """Return an edge of a face as a curve on its support surface, from its pcurve."""
    pcurve = CurveEvaluator(read_pcurve(orient_forward(edge), side.face)[0])

    def evaluate(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        uv, rate = pcurve(sigma, 1).swapaxes(1, 2)
        jet = side.face_primary.jet(uv)
        return side.to_working_parameters(uv), rate[:, :1] * jet[1] + rate[:, 1:] * jet[2]

    return evaluate


def rim_of(body: cq.Workplane, face: cq.Face | None = None, **options: Any) -> ChainCase:
    """Return the rim of a face of a body, the topmost if none is given."""
    top: Any = body.faces(">Z").val() if face is None else face
    return chain_of(body.val(), top.Edges(), top, **options)  # type: ignore[arg-type]
