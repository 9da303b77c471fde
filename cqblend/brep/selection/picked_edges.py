"""Turn picked edges into chains: which edges belong together, and which numbers they have in the input shape."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.blends.network.edge_networks import group_networks
from cqblend.brep.bodies import list_bodies, replace_body
from cqblend.brep.selection.chain_building import build_chain, find_sharp_sides
from cqblend.brep.selection.chain_tracing import TracedEdge, trace_chain
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.selection.unified_faces import ShapeReplacement, UnifiedSolid, unify_faces
from cqblend.brep.topology import ShapeIndex, find_end_vertices, is_among
from cqblend.certificate import NothingToBlend, SkippedEdges
from cqblend.errors import InputError, SelectionError, SizeError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class FoundChain:
    """Picked edges, by their numbers in the input, that are part of one chain; or why there is none.

    ``length`` is that of all edges that were meant (mm): those of the chain, or the picked ones.
    """

    edges: tuple[int, ...]
    length: float
    chain: Chain | None
    error: SelectionError | None = None


@dataclass(frozen=True)
class Selection:
    """What was picked of a shape: its networks of chains that touch, and the shape in which their joints are.

    That is the input but for faces near the joints that have been unified; ``method`` says which. ``skipped`` are
    picked edges at which there is nothing to blend. ``picks`` finds chains anew when some have been blended.
    """

    shape: TopoDS_Shape
    networks: tuple[tuple[FoundChain, ...], ...]
    skipped: tuple[SkippedEdges, ...]
    method: str
    picks: PickedEdges


def select_chains(
    shape: TopoDS_Shape,
    edges: Sequence[TopoDS_Edge],
    side1_face: TopoDS_Face | None,
    reach: Callable[[Joint], float] | None,
    *,
    follow: bool,
    stops: Collection[int] = (),
) -> Selection:
    """Find the chain through every picked edge, and unify the faces of its cells with others on the same surface.

    With ``follow``, chains go on along edges that were not picked, but for ``stops``, by their numbers. Only faces
    within ``reach`` of a cell (mm) are unified; without it, none. That is repeated, as a cell between unified faces may
    be longer and come near to more faces.

    Raises
    ------
    InputError
        No edge was given.
    SelectionError
        An edge, or the face that is to be side 1, does not belong there, or there is nothing to blend at any of them.
    """
    picks = PickedEdges(shape, edges, side1_face, follow=follow, stops=stops)
    chains: list[FoundChain] = []
    nothing_to_blend: list[tuple[int, SelectionError]] = []
    covered: set[int] = set()
    for number in picks.numbers:
        if number in covered:
            continue
        try:
            chain = picks.find_chain(number)
            while reach is not None and picks.unify_faces(chain, reach):
                chain = picks.find_chain(number)
        except SelectionError as error:
            if error.kind in get_args(NothingToBlend):
                nothing_to_blend.append((number, error))
            else:
                chains.append(FoundChain((number,), picks.measure_length(number), None, error))
            covered.add(number)
            continue
        own = picks.list_picks(chain.edges)
        covered.update(own)
        chains.append(FoundChain(own, chain.length, chain))
    if not chains:
        first, *others = (error for _, error in nothing_to_blend)
        raise first.with_details(after="".join(f"; {error}" for error in others))
    chains = [picks.refresh_chain(chain) for chain in chains]
    vertices = ShapeIndex(picks.shape, TopAbs_VERTEX)
    groups = group_networks(
        [
            frozenset(
                map(vertices.find_number, (v for edge in picks.list_edges(chain) for v in find_end_vertices(edge)))
            )
            for chain in chains
        ]
    )
    networks = tuple(tuple(chains[k] for k in group) for group in groups)
    skipped = tuple(SkippedEdges((n,), error.kind, error.place, str(error)) for n, error in nothing_to_blend)
    return Selection(picks.shape, networks, skipped, picks.describe_unified_faces(), picks)


class PickedEdges:
    """The picked edges of a shape, and what has become of them and of their faces by unification and by blends."""

    def __init__(
        self,
        shape: TopoDS_Shape,
        edges: Sequence[TopoDS_Edge],
        side1_face: TopoDS_Face | None,
        *,
        follow: bool,
        stops: Collection[int] = (),
    ) -> None:
        self.shape = shape
        self._input = SolidIndex(shape)
        numbers = [self._input.edges.find_number(edge) for edge in edges]
        if not numbers:
            raise InputError("no edge was given")
        if 0 in numbers:
            raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
        self.numbers = tuple(dict.fromkeys(numbers))
        self._oriented_picks = dict(zip(reversed(numbers), reversed(edges), strict=True))  # as the user oriented them
        self._solids = [self._input if body.IsEqual(shape) else SolidIndex(body) for body in list_bodies(shape)]
        self._follows, self._stops = follow, frozenset(stops)
        # numbers of the faces that are to be side 1: the given one, and those unified with it
        self._side1_numbers = {0 if side1_face is None else self._input.faces.find_number(side1_face)}
        self._replaced_faces: list[tuple[TopoDS_Shape, list[int]]] = []  # new ones, each with the numbers of its parts
        self._replaced_edges: list[tuple[TopoDS_Shape, list[int]]] = []
        self._corner_edges: list[tuple[TopoDS_Edge, int]] = []  # each with the edge whose blend ends in it
        if side1_face is not None and not any(self._side1_numbers & set(self._list_faces(n)) for n in self.numbers):
            raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")

    def _list_faces(self, number: int) -> list[int]:
        """Return the numbers of the faces at an edge of the input, in ascending order."""
        return sorted(map(self._input.faces.find_number, self._input.faces_at_edge(self._input.edges[number])))

    def _may_follow(self, edge: TopoDS_Edge) -> bool:
        """Whether a chain may go on along an edge."""
        if self.list_picks([edge]):
            return True
        return self._follows and self._stops.isdisjoint(self._list_edge_numbers([edge]))

    def _find_current_edge(self, number: int) -> TopoDS_Edge:
        """Return an edge of the input, or what has replaced it."""
        found = (edge for edge, numbers in reversed(self._replaced_edges) if number in numbers)
        return TopoDS.Edge_s(next(found, self._input.edges[number]))

    def copy(self) -> PickedEdges:
        """Return the same picks, to record blends of which this one knows nothing."""
        twin = copy(self)
        twin._solids, twin._corner_edges = list(self._solids), list(self._corner_edges)
        twin._replaced_faces, twin._replaced_edges = list(self._replaced_faces), list(self._replaced_edges)
        return twin

    def record_rewriting(
        self,
        index: SolidIndex,
        solid: TopoDS_Shape,
        faces: Mapping[int, TopoDS_Face],
        edges: Mapping[int, Sequence[TopoDS_Edge]],
    ) -> SolidIndex:
        """Record that a solid was rewritten: its new faces and the pieces of its edges, by the old ones' numbers."""
        for kind, replaced, changes in (
            (index.faces, self._replaced_faces, {number: (face,) for number, face in faces.items()}),
            (index.edges, self._replaced_edges, edges),
        ):
            for number, new in changes.items():
                numbers = self._find_input_numbers(kind[number])
                replaced += [(one, numbers) for one in new if numbers and not one.IsSame(kind[number])]
        rewritten = SolidIndex(solid)
        self._solids = [one for one in self._solids if one is not index] + [rewritten]
        return rewritten

    def record_corner(self, edges: Sequence[TopoDS_Edge], number: int) -> None:
        """Record edges in which the blend of an edge, by its number, ends, and around which others are to go on."""
        self._corner_edges += [(edge, number) for edge in edges]

    def find_chains_round_corners(self, numbers: Sequence[int]) -> list[FoundChain]:
        """Return the chains along some edges of the input, as they are now, and around recorded corners.

        Raises
        ------
        SelectionError
            An edge is no joint of two faces any more.
        SizeError
            Nothing remains of one.
        """
        current = [self._find_current_edge(number) for number in numbers]
        for number, edge in zip(numbers, current, strict=True):
            if not any(edge in index.edges for index in self._solids):
                raise SizeError(
                    f"nothing remains of edge {number} between the blends at its ends: the size is too large",
                    kind="too large",
                    shape=f"edge {number}",
                )
        allowed = ShapeIndex.from_shapes([*current, *(edge for edge, _ in self._corner_edges)], TopAbs_EDGE)
        picked, found, covered = [n for n in numbers if n in self.numbers], list[FoundChain](), set[int]()
        for number in picked:
            if number not in covered:
                chain = self.find_chain(number, allowed.__contains__)
                own = self.list_picks(chain.edges)
                covered.update(own)
                found.append(FoundChain(own, chain.length, chain))
        return found

    def list_picks(self, edges: Sequence[TopoDS_Edge]) -> tuple[int, ...]:
        """Return the numbers of the picked edges that are among some edges, in ascending order."""
        return tuple(sorted(set(self.numbers).intersection(self._list_edge_numbers(edges))))

    def list_edges(self, found: FoundChain) -> Sequence[TopoDS_Edge]:
        """Return the edges of a chain."""
        if found.chain is not None:
            return found.chain.edges
        return [self._find_current_edge(number) for number in found.edges]

    def refresh_chain(self, found: FoundChain) -> FoundChain:
        """Return a chain in the shape as it is now, in which faces have been unified after the chain was found."""
        if found.chain is None or any(found.chain.cells[0].index is index for index in self._solids):
            return found
        chain = self.find_chain(found.edges[0])
        return replace(found, chain=chain, length=chain.length)

    def measure_length(self, number: int) -> float:
        """Return the length (mm) of a picked edge."""
        return EdgeSpine([self._find_current_edge(number)], closed=False).length

    def unify_faces(self, chain: Chain, reach: Callable[[Joint], float]) -> bool:
        """Unify the faces of one cell of a chain with others, and record that; False if there is nothing to unify."""
        for cell in chain.cells:
            united = unify_faces(cell, partial(reach, cell))
            if united is not None:
                self._record_unified_faces(cell, united)
                return True
        return False

    def _record_unified_faces(self, joint: Joint, united: UnifiedSolid) -> None:
        """Record that faces at a joint have been unified, so that numbers and side 1 are found again."""
        faces = self._number_replacements(united.face_replacements)
        for _, numbers in faces:
            if self._side1_numbers & set(numbers):
                self._side1_numbers |= set(numbers)
        edges = self._number_replacements(united.edge_replacements)
        self._replaced_faces += faces
        self._replaced_edges += edges
        self.shape = replace_body(self.shape, joint.solid, united.solid)
        self._solids = [index for index in self._solids if index is not joint.index] + [SolidIndex(united.solid)]

    def _number_replacements(self, replacements: Sequence[ShapeReplacement]) -> list[tuple[TopoDS_Shape, list[int]]]:
        """Return new faces or edges, each with the numbers in the input of those that it replaces."""
        return [
            (one.new, sorted({number for old in one.old for number in self._find_input_numbers(old)}))
            for one in replacements
        ]

    def describe_unified_faces(self) -> str:
        """Say which faces were unified; nothing if none were."""
        groups = [numbers for _, numbers in self._replaced_faces if len(numbers) > 1]
        whole = [numbers for numbers in groups if not any(set(numbers) < set(other) for other in groups)]
        unique = dict.fromkeys(map(tuple, whole))
        return "".join(f", faces {', '.join(map(str, numbers))} taken as one" for numbers in unique)

    def _find_input_numbers(self, part: TopoDS_Shape) -> list[int]:
        """Return the number in the input of a face or edge, or the numbers of all those that it has replaced."""
        is_face = part.ShapeType() == TopAbs_FACE
        number = (self._input.faces if is_face else self._input.edges).find_number(part)
        if number:
            return [number]
        replaced = self._replaced_faces if is_face else self._replaced_edges
        return next((numbers for new, numbers in replaced if new.IsSame(part)), [])

    def find_number(self, part: TopoDS_Shape) -> int:
        """Return the number of a part in the input, the least one for unified parts; 0 if it is new."""
        if part.ShapeType() in (TopAbs_EDGE, TopAbs_FACE):
            return min(self._find_input_numbers(part), default=0)
        return self._input.vertices.find_number(part)

    def _list_edge_numbers(self, edges: Sequence[TopoDS_Edge]) -> list[int]:
        """Return the numbers in the input of all edges that some edges are, or have replaced."""
        return [number for edge in edges for number in self._find_input_numbers(edge)]

    def find_chain(self, number: int, may_follow: Callable[[TopoDS_Edge], bool] | None = None) -> Chain:
        """Return the chain through a picked edge, with the sense and sides that its lowest picked edge gives it.

        It goes on along edges for which ``may_follow`` holds; without it, along those that the picks may go on along.

        Raises
        ------
        SelectionError
            It is not a joint of two faces; see :func:`cqblend.brep.selection.chain_building.find_sharp_sides`.
        """
        current = self._find_current_edge(number)
        if self._replaced_faces and not any(current in index.edges for index in self._solids):
            raise SelectionError(
                f"edge {number} is smooth already: the faces beside it are on one surface, and were taken as one",
                kind="smooth",
                value=0.0,
            )
        index, sides = find_sharp_sides(self._solids, current, f"edge {number}")
        trace = trace_chain(index, sides, may_follow or self._may_follow)
        start_number = self.list_picks([traced.use for traced in trace.edges])[0]
        start = self._find_current_edge(start_number)
        traced = trace.edges[trace.find_position(start)]
        if not self._is_side1_left([traced, *trace.edges], self._list_faces(start_number)[0]):
            trace = trace.reverse()
        chain = build_chain(index, trace, start, self._number_cell, self.find_number)
        chain = replace(chain, edge_numbers=tuple(self._list_edge_numbers(chain.edges)))
        cell = next(cell for cell in chain.cells if is_among(start, cell.spine.edges))
        if _is_backward(cell, self._oriented_picks[start_number]):
            return replace(chain, cells=tuple(replace(one, is_backward=True) for one in chain.cells))
        return chain

    def _is_side1_left(self, edges: Sequence[TracedEdge], low: int) -> bool:
        """Whether side 1 is to the left of a chain; ``low`` is the face that counts as side 1 if none was given."""
        for wanted in (self._side1_numbers, {low}):
            for edge in edges:
                left, right = (bool(wanted.intersection(self._find_input_numbers(face))) for face in edge.faces)
                if left != right:
                    return left
        return True

    def _number_cell(
        self, edges: Sequence[TopoDS_Edge], faces: tuple[TopoDS_Face, TopoDS_Face]
    ) -> tuple[int, tuple[int, int]]:
        """Return the numbers of a cell's edge and faces: of the lowest picked edge in it, else of the lowest edge."""
        at_corner = (number for corner, number in self._corner_edges if is_among(corner, edges))
        number = min([*(self.list_picks(edges) or self._list_edge_numbers(edges)), *at_corner])
        own = self._list_faces(number)
        first, second = (
            next((n for n in own if n in self._find_input_numbers(face)), self.find_number(face)) for face in faces
        )
        return number, (first, second)


def _is_backward(joint: Joint, edge: TopoDS_Edge) -> bool:
    """Whether the spine of a joint has the sense opposite to that of an edge of it, as that is oriented."""
    middle, direction = _evaluate_middle(edge)
    points = joint.spine.evaluate_points(np.linspace(0, 1, SELECT_TOLERANCES.spine_samples))
    i = int(np.clip(np.linalg.norm(points - middle, axis=1).argmin(), 1, len(points) - 2))
    return bool((points[i + 1] - points[i - 1]) @ direction < 0)


def _evaluate_middle(use: TopoDS_Edge) -> tuple[Array, Array]:
    """Return the point in the middle of an edge's parameters and the direction of its use there, (3,) each."""
    curve, point, tangent = BRepAdaptor_Curve(use), gp_Pnt(), gp_Vec()
    curve.D1((curve.FirstParameter() + curve.LastParameter()) / 2, point, tangent)
    sign = -1.0 if use.Orientation() == TopAbs_REVERSED else 1.0
    return np.array(point.Coord()), sign * np.array(tangent.Coord())
