"""Whether new faces of a solid cut through others that they share no vertex with.

Boxes of whole faces tell most pairs apart. For the others, both surfaces are cut into pieces inside the boxes of their
poles; quadrics, planes and tori tell how far a piece is from them. What is left is measured by OCCT.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_OffsetSurface, Geom_RectangularTrimmedSurface, Geom_Surface
from OCP.GeomConvert import GeomConvert
from OCP.Standard import Standard_Failure
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.conversion.spline_arrays import surface_from_arrays, surface_to_arrays
from cqblend.brep.topology import CONFUSION, ShapeIndex
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.surface_distance import find_distance
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array


def find_collisions(replaced: ReplacedFaces, boxes: FaceBoxes) -> list[ReplacementProblem]:
    """Return a problem for every face that a new one touches or crosses without sharing a vertex with it.

    ``boxes`` are those of the faces of the result, in their order.
    """
    numbers = [replaced.index_after.find_number(face) for face in replaced.new_faces]
    present = [(i, number) for i, number in enumerate(numbers) if number]
    overlaps = boxes.find_overlaps(np.array([number - 1 for _, number in present], dtype=np.intp))
    problems = []
    for (i, number), row in zip(present, overlaps, strict=True):
        face = replaced.new_faces[i]
        own = ShapeIndex(face, TopAbs_VERTEX)
        pieces = _FacePieces(face)
        for other_number in (np.flatnonzero(row) + 1).tolist():
            other = replaced.index_after[other_number]
            is_done = other_number == number or (other_number in numbers and other_number < number)
            if is_done or any(vertex in own for vertex in ShapeIndex(other, TopAbs_VERTEX)):
                continue
            if pieces.may_touch(other) and BRepExtrema_DistShapeShape(face, other).Value() <= CONFUSION:
                concerned = sorted({i, *(k for k, n in enumerate(numbers) if n == other_number)})
                line = f"a new face cuts through face {other_number}"
                problems.append(
                    ReplacementProblem(line, Check.COLLISIONS, tuple(concerned), (face, other), crosses=True)
                )
    return problems


class _FacePieces:
    """A face as pieces of its surface in boxes, cut finer where that is needed."""

    def __init__(self, face: TopoDS_Face) -> None:
        self.face = face
        self._boxes: dict[int, tuple[Array, Array] | None] = {}

    def find_boxes(self, level: int) -> tuple[Array, Array] | None:
        """Return the corners (n, 3) of boxes around pieces; None of a surface that is not made of poles."""
        if level not in self._boxes:
            self._boxes[level] = _cut_into_boxes(self.face, VERIFICATION_TOLERANCES.piece_counts[level])
        return self._boxes[level]

    def may_touch(self, other: TopoDS_Face) -> bool:
        """Whether a face may touch another: whether no level of pieces keeps them apart."""
        surface = BRep_Tool.Surface_s(other)
        measure = find_distance(surface)
        cut = None if measure is not None else _FacePieces(other)
        box = FaceBoxes([other])
        for level in range(len(VERIFICATION_TOLERANCES.piece_counts)):
            boxes = self.find_boxes(level)
            if boxes is None:
                return True
            low, high = boxes
            near = (low <= box.high).all(axis=1) & (high >= box.low).all(axis=1)
            low, high = low[near], high[near]
            if measure is not None:
                reach = np.linalg.norm(high - low, axis=1) / 2 + 2 * CONFUSION
                is_apart = bool((np.abs(measure((low + high) / 2)) > reach).all())
            else:
                others = cut.find_boxes(level) if cut is not None else None
                if others is None:
                    return True
                (low, high), others = _keep_near((low, high), others), _keep_near(others, (low, high))
                if len(low) * len(others[0]) > VERIFICATION_TOLERANCES.most_piece_pairs:
                    return True
                before = (high[:, None] + 2 * CONFUSION < others[0][None]).any(axis=-1)
                is_apart = bool((before | (low[:, None] - 2 * CONFUSION > others[1][None]).any(axis=-1)).all())
            if is_apart:
                return False
        return True


def _keep_near(boxes: tuple[Array, Array], others: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return those of some boxes, by their corners (n, 3), that meet the box around others."""
    (low, high), (other_low, other_high) = boxes, others
    if not len(other_low):
        return low[:0], high[:0]
    least, largest = other_low.min(axis=0) - 2 * CONFUSION, other_high.max(axis=0) + 2 * CONFUSION
    near = ((low <= largest) & (high >= least)).all(axis=1)
    return low[near], high[near]


def _cut_into_boxes(face: TopoDS_Face, counts: tuple[int, int]) -> tuple[Array, Array] | None:
    """Return the corners (n, 3) of boxes around pieces of a face's surface: at least so many in u and in v.

    The poles that matter to a span of a B-spline bound it, its weights being positive; more knots make them close.
    """
    surface, bounds = BRep_Tool.Surface_s(face), np.array(BRepTools.UVBounds_s(face)).reshape(2, 2)
    spline = _copy_as_spline(surface, bounds)
    if spline is None:
        return None
    for insert, count, read, knot_count in (
        (spline.InsertUKnots, counts[0], spline.UKnot, spline.NbUKnots()),
        (spline.InsertVKnots, counts[1], spline.VKnot, spline.NbVKnots()),
    ):
        _insert_knots(insert, count, read, knot_count)
    degrees, knots, poles, _ = surface_to_arrays(spline)
    windows = sliding_window_view(poles, (degrees[0] + 1, degrees[1] + 1), axis=(0, 1))
    u, v = (
        _find_spans(vector[degree : len(vector) - degree], ends)
        for vector, degree, ends in zip(knots, degrees, bounds, strict=True)
    )
    windows = windows[u][:, v]
    return windows.min(axis=(-2, -1)).reshape(-1, 3), windows.max(axis=(-2, -1)).reshape(-1, 3)


def _copy_as_spline(surface: Geom_Surface, bounds: Array) -> Geom_BSplineSurface | None:
    """Return a surface, over bounds (2, 2) at least, as a B-spline of its own; None if OCCT cannot do so exactly."""
    if isinstance(surface, Geom_OffsetSurface):
        return None
    try:
        if not isinstance(surface, Geom_BSplineSurface):
            surface = Geom_RectangularTrimmedSurface(surface, *bounds.ravel().tolist())
            surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
        return surface_from_arrays(*surface_to_arrays(surface))
    except Standard_Failure:
        return None


def _find_spans(knots: Array, ends: Array) -> NDArray[np.bool_]:
    """Tell which spans between knots are met by a range; all of them if it goes on beyond, round a periodic surface."""
    slack = 1e-9 * (knots[-1] - knots[0])
    is_span = np.diff(knots) > 0.0
    if ends[0] < knots[0] - slack or ends[1] > knots[-1] + slack:
        return np.asarray(is_span)
    return np.asarray(is_span & (knots[1:] >= ends[0] - slack) & (knots[:-1] <= ends[1] + slack))


def _insert_knots(insert: Callable[..., None], count: int, read: Callable[[int], float], knot_count: int) -> None:
    """Insert knots into a spline so that its spans are at least so many, and equally many parts of those there were."""
    each = -(-count // (knot_count - 1))
    knots = np.array([read(i) for i in range(1, knot_count + 1)])
    inner = (knots[:-1, None] + np.diff(knots)[:, None] * (np.arange(1, each) / each)).ravel()
    if not inner.size:
        return
    values, multiplicities = TColStd_Array1OfReal(1, len(inner)), TColStd_Array1OfInteger(1, len(inner))
    multiplicities.Init(1)
    for i, knot in enumerate(inner.tolist(), 1):
        values.SetValue(i, knot)
    insert(values, multiplicities, 0.0, True)
