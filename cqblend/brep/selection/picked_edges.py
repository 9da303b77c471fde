"""Turn picked edges into joints: which edges belong together, and which numbers they have in the input shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import get_args

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.blends.network.edge_networks import group_networks
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.joint import Joint, find_joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.selection.unified_faces import UnifiedSolid, unify_faces
from cqblend.brep.topology import ShapeIndex, explore_subshapes, find_end_vertices, is_among, replace_solid
from cqblend.certificate import NothingToBlend, SkippedEdges
from cqblend.errors import InputError, SelectionError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class FoundChain:
    """Picked edges, by their numbers in the input, that make one chain; or the error that says why they do not."""

    edges: tuple[int, ...]
    joint: Joint | None
    error: SelectionError | None = None

    @property
    def chain(self) -> Chain | None:
        """The chain."""
        return None if self.joint is None else Chain((self.joint,), (), self.joint.spine.closed)


@dataclass(frozen=True)
class Selection:
    """What was picked of a shape: its networks of edges that touch, and the shape in which their joints are.

    That is the input but for faces near the joints that have been unified; ``method`` says which. ``skipped`` are
    picked edges at which there is nothing to blend.
    """

    shape: TopoDS_Shape
    networks: tuple[tuple[FoundChain, ...], ...]
    skipped: tuple[SkippedEdges, ...]
    method: str


def select_joints(
    shape: TopoDS_Shape,
    edges: Sequence[TopoDS_Edge],
    side1_face: TopoDS_Face | None,
    reach: Callable[[Joint], float] | None,
) -> Selection:
    """Find the joint of every picked edge, and unify its faces with others on the same surface.

    Only faces within ``reach`` of a joint (mm) are unified; without it, none. That is repeated, as a joint between
    unified faces may be longer and come near to more faces.

    Raises
    ------
    InputError
        No edge was given.
    SelectionError
        An edge, or the face that is to be side 1, does not belong there, or there is nothing to blend at any of them.
    """
    picks = _PickedEdges(shape, edges, side1_face)
    chains: list[FoundChain] = []
    nothing_to_blend: list[tuple[int, SelectionError]] = []
    covered: set[int] = set()
    for number in picks.numbers:
        if number in covered:
            continue
        try:
            joint = picks.find_joint(number)
            while reach is not None and (united := unify_faces(joint, partial(reach, joint))) is not None:
                picks.record_unified_faces(joint, united)
                joint = picks.find_joint(number)
        except SelectionError as error:
            if error.kind in get_args(NothingToBlend):
                nothing_to_blend.append((number, error))
            else:
                chains.append(FoundChain((number,), None, error))
            covered.add(number)
            continue
        own = picks.list_picks(joint)
        covered.update(own)
        chains.append(FoundChain(own, joint))
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
    return Selection(picks.shape, networks, skipped, picks.describe_unified_faces())


class _PickedEdges:
    """The picked edges of a shape, and what has become of them and of their faces by unification."""

    def __init__(self, shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], side1_face: TopoDS_Face | None) -> None:
        self.shape = shape
        self._input = SolidIndex(shape)
        numbers = [self._input.edges.find_number(edge) for edge in edges]
        if not numbers:
            raise InputError("no edge was given")
        if 0 in numbers:
            raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
        self.numbers = tuple(dict.fromkeys(numbers))
        self._oriented_picks = dict(zip(reversed(numbers), reversed(edges), strict=True))  # as the user oriented them
        solids = explore_subshapes(shape, TopAbs_SOLID)
        self._solids = [self._input if solid.IsEqual(shape) else SolidIndex(solid) for solid in solids]
        self._faces_of_edge = {
            n: sorted(map(self._input.faces.find_number, self._input.faces_at_edge(self._input.edges[n])))
            for n in self.numbers
        }
        # numbers of the faces that are to be side 1: the given one, and those unified with it
        self._side1_numbers = {0 if side1_face is None else self._input.faces.find_number(side1_face)}
        self._unified_faces: list[tuple[TopoDS_Face, list[int]]] = []  # each with the numbers of its parts
        self._representatives: dict[int, int] = {}  # of faces that were unified, the least number of their parts
        self._rebuilt_edges: dict[int, TopoDS_Edge] = {}  # picked edges that unification has replaced
        if side1_face is not None and not any(self._side1_numbers & set(pair) for pair in self._faces_of_edge.values()):
            raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")

    def _find_current_edge(self, number: int) -> TopoDS_Edge:
        """Return a picked edge, or what has replaced it."""
        return self._rebuilt_edges.get(number) or self._input.edges[number]

    def list_picks(self, joint: Joint) -> tuple[int, ...]:
        """Return the numbers of the picked edges that are part of a joint."""
        own = self._picks_between[self._find_pair(joint.edge_number)]
        return tuple(n for n in own if is_among(self._find_current_edge(n), joint.spine.edges))

    @cached_property
    def _picks_between(self) -> dict[frozenset[int], list[int]]:
        """The picked edges between each pair of faces; of unified faces, the least number counts."""
        picks: dict[frozenset[int], list[int]] = {}
        for number in self.numbers:
            picks.setdefault(self._find_pair(number), []).append(number)
        return picks

    def _find_pair(self, number: int) -> frozenset[int]:
        """Return the faces at a picked edge, by their numbers in the input; of unified ones, by the least number."""
        return frozenset(self._representatives.get(face, face) for face in self._faces_of_edge[number])

    def list_edges(self, chain: FoundChain) -> Sequence[TopoDS_Edge]:
        """Return the edges of a chain."""
        if chain.joint is not None:
            return chain.joint.spine.edges
        return [self._find_current_edge(number) for number in chain.edges]

    def refresh_chain(self, chain: FoundChain) -> FoundChain:
        """Return a chain in the shape as it is now, in which faces have been unified after the chain was found."""
        if chain.joint is None or any(chain.joint.index is index for index in self._solids):
            return chain
        return replace(chain, joint=self.find_joint(chain.edges[0]))

    def record_unified_faces(self, joint: Joint, united: UnifiedSolid) -> None:
        """Record that faces at a joint have been unified, so that numbers and side 1 are found again."""
        for new, faces in united.face_replacements:
            numbers = sorted({number for face in faces for number in self._find_input_numbers(face)})
            if len(numbers) > 1:
                self._unified_faces.append((new, numbers))
                self._representatives |= dict.fromkeys(numbers, numbers[0])
                if self._side1_numbers & set(numbers):
                    self._side1_numbers |= set(numbers)
        for new, edges in united.edge_replacements:
            for number in self.numbers:
                if is_among(self._find_current_edge(number), edges):
                    self._rebuilt_edges[number] = TopoDS.Edge_s(new)
        self.__dict__.pop("_picks_between", None)  # which is found anew when asked for
        self.shape = replace_solid(self.shape, joint.solid, united.solid)
        self._solids = [index for index in self._solids if index is not joint.index] + [SolidIndex(united.solid)]

    def describe_unified_faces(self) -> str:
        """Say which faces were unified; nothing if none were."""
        groups = [numbers for _, numbers in self._unified_faces]
        whole = [numbers for numbers in groups if not any(set(numbers) < set(other) for other in groups)]
        return "".join(f", faces {', '.join(map(str, numbers))} taken as one" for numbers in whole)

    def _find_input_numbers(self, face: TopoDS_Face) -> list[int]:
        """Return the numbers in the input of a face, or of all those that were unified to it."""
        parts = next((numbers for new, numbers in reversed(self._unified_faces) if new.IsSame(face)), None)
        number = self._input.faces.find_number(face)
        return parts or ([number] if number else [])

    def find_number(self, part: TopoDS_Shape) -> int:
        """Return the number of a part in the input, the least one for unified faces; 0 if it is new."""
        if part.ShapeType() != TopAbs_FACE:
            return (self._input.edges if part.ShapeType() == TopAbs_EDGE else self._input.vertices).find_number(part)
        unified = (numbers[0] for new, numbers in self._unified_faces if new.IsSame(part))
        return self._input.faces.find_number(part) or next(unified, 0)

    def find_joint(self, number: int) -> Joint:
        """Return the joint of a picked edge, with the faces as its sides as they are numbered in the input.

        Raises
        ------
        SelectionError
            It is not a joint of two faces; see :func:`cqblend.brep.selection.joint.find_joint`.
        """
        low, high = min(self._faces_of_edge[number], default=0), max(self._faces_of_edge[number], default=0)
        swap = low != high and high in self._side1_numbers and low not in self._side1_numbers
        faces = (high, low) if swap else (low, high)
        others = (n for n in self._picks_between[self._find_pair(number)] if n != number)
        edges = [self._find_current_edge(one) for one in (number, *others)]
        joint = find_joint(self._solids, edges, number, faces, swap=swap, lookup_number=self.find_number)
        if self._unified_faces and not self._is_side1_first(joint, number, faces[0]):
            # unified faces come in another order, so that the sides are the other way round
            joint = find_joint(self._solids, edges, number, faces, swap=not swap, lookup_number=self.find_number)
        return replace(joint, is_backward=_is_backward(joint, self._oriented_picks[number]))

    def _is_side1_first(self, joint: Joint, number: int, face_number: int) -> bool:
        """Whether the first side of a joint is, or contains, a face of the input at a picked edge."""
        side = joint.sides[0]
        side_face = side.face if side.outward > 0 else side.face.Reversed()
        before = _find_boundary_direction(self._input.edges[number], self._input.faces[face_number])
        return bool(before @ _find_boundary_direction(self._find_current_edge(number), side_face) >= 0)


def _is_backward(joint: Joint, edge: TopoDS_Edge) -> bool:
    """Whether the spine of a joint has the sense opposite to that of an edge of it, as that is oriented."""
    middle, direction = _evaluate_middle(edge)
    points = joint.spine.evaluate_points(np.linspace(0, 1, SELECT_TOLERANCES.spine_samples))
    i = int(np.clip(np.linalg.norm(points - middle, axis=1).argmin(), 1, len(points) - 2))
    return bool((points[i + 1] - points[i - 1]) @ direction < 0)


def _find_boundary_direction(edge: TopoDS_Edge, face: TopoDS_Shape) -> Array:
    """Return the direction (3,) of an edge in the boundary of a face, in the middle of the edge."""
    return _evaluate_middle(next(use for use in explore_subshapes(face, TopAbs_EDGE) if use.IsSame(edge)))[1]


def _evaluate_middle(use: TopoDS_Edge) -> tuple[Array, Array]:
    """Return the point in the middle of an edge's parameters and the direction of its use there, (3,) each."""
    curve, point, tangent = BRepAdaptor_Curve(use), gp_Pnt(), gp_Vec()
    curve.D1((curve.FirstParameter() + curve.LastParameter()) / 2, point, tangent)
    sign = -1.0 if use.Orientation() == TopAbs_REVERSED else 1.0
    return np.array(point.Coord()), sign * np.array(tangent.Coord())
