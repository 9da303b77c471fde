"""Make chains of joints from traced edges, and check the edges that are picked to be blended."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.bodies import is_solid
from cqblend.brep.measurement.edge_sides import EdgeSide
from cqblend.brep.selection.chain_tracing import ChainTrace
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.joint import make_joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import drop_duplicate_shapes, find_end_vertices
from cqblend.errors import SelectionError

CellNumbering = Callable[[Sequence[TopoDS_Edge], tuple[TopoDS_Face, TopoDS_Face]], tuple[int, tuple[int, int]]]
"""Returns the numbers of a cell's edge and of its two faces in the input, by its edges and faces."""


def find_sharp_sides(
    solids: Sequence[SolidIndex], edge: TopoDS_Edge, name: str
) -> tuple[SolidIndex, tuple[EdgeSide, EdgeSide]]:
    """Return the body that an edge is part of, and its two sides, if there is something to blend.

    Raises
    ------
    SelectionError
        If there is nothing to blend at the edge, and ``kind`` tells why: ``"degenerate"``, ``"seam"`` or ``"smooth"``.
        Or, without a kind, if it is for another reason no sharp joint of two faces.
    """
    owners = [index for index in solids if edge in index.edges]
    if len(owners) != 1:
        many = f"part of {len(owners)} bodies: take them apart first" if owners else "not part of a solid or a shell"
        raise SelectionError(f"{name} is {many}; a blend takes an edge between two faces of one body")
    (index,) = owners
    faces = index.faces_at_edge(edge)
    if BRep_Tool.Degenerated_s(edge):
        raise SelectionError(f"{name} is degenerate (a pole): it has no length to blend along", kind="degenerate")
    if len(faces) == 1 and BRep_Tool.IsClosed_s(edge, faces[0]):
        raise SelectionError(f"{name} is a seam of one closed face, not a joint of two", kind="seam")
    sides = index.find_sides(edge)
    if len(faces) != 2 or sides is None:
        what = (
            "1 face: it is in the border of an open shell" if len(faces) == 1 else f"{len(faces)} faces: not manifold"
        )
        raise SelectionError(f"{name} has {what}; a blend takes an edge between two faces")
    _check_senses(index, [edge], name)
    _check_sharp(index, edge, name)
    return index, sides


def _check_senses(index: SolidIndex, edges: Sequence[TopoDS_Edge], name: str) -> None:
    """Refuse edges of a shell if faces at them, or at their ends, do not bound an inside together."""
    if is_solid(index.solid):
        return
    vertices = (vertex for edge in edges for vertex in find_end_vertices(edge))
    around = [edge for vertex in vertices for edge in index.edges_at_vertex(vertex)]
    for edge in drop_duplicate_shapes([*edges, *around]):
        sides = index.find_sides(edge)
        if sides is not None and sides[0][1].Orientation() == sides[1][1].Orientation():
            raise SelectionError(
                f"{name} has faces beside it, or at its ends, that are oriented against each other, so that inside and "
                "outside are not defined: orient the shell first (OCCT's ShapeFix_Shell does, and so does sewing)"
            )


def _check_sharp(index: SolidIndex, edge: TopoDS_Edge, name: str) -> None:
    """Refuse an edge that is smooth, or a knife edge, anywhere inside."""
    angles = index.measure_dihedral_angles(edge)
    if angles is None:
        raise SelectionError(f"{name} lies where its faces have no normals: there is no angle to blend")
    size = np.abs(angles.middle)
    if size.max() < SELECT_TOLERANCES.smooth_angle:
        raise SelectionError(
            f"{name} is smooth already: its faces meet at {size.max():.2g} rad", kind="smooth", value=float(size.max())
        )
    if size.min() < SELECT_TOLERANCES.smooth_angle:
        raise SelectionError(f"{name} is smooth already in part: there its faces meet at {size.min():.2g} rad")
    if size.max() > np.pi - SELECT_TOLERANCES.smooth_angle:
        raise SelectionError(f"{name} is a knife edge: its faces fold back onto each other")
    if not angles.is_sharp:
        raise SelectionError(f"{name} is convex in part and concave in part: split it where it turns over")


def build_chain(
    index: SolidIndex,
    trace: ChainTrace,
    start: TopoDS_Edge,
    number_cell: CellNumbering,
    lookup_number: Callable[[TopoDS_Shape], int],
) -> Chain:
    """Return the chain of traced edges, divided into cells where the face changes on either side.

    A closed chain starts with the cell in which the edge ``start`` is. ``lookup_number`` is that of
    :class:`~cqblend.brep.selection.joint.Joint`.

    Raises
    ------
    SelectionError
        If faces of a shell are oriented against each other there.
    """
    count, position = len(trace.edges), trace.find_position(start)
    if trace.closed:
        cell_start = next((k for k in range(position, position - count, -1) if _is_cell_start(trace, k)), position)
        trace, position = trace.rotate(cell_start % count), position - cell_start
    starts = [0, *(k for k in range(1, count) if _is_cell_start(trace, k))]
    closes_smoothly = trace.closed and len(starts) == 1 and not _is_cell_start(trace, 0)
    cells = []
    for first, last in zip(starts, [*starts[1:], count], strict=True):
        spine = EdgeSpine([traced.use for traced in trace.edges[first:last]], closes_smoothly)
        faces = trace.edges[first].faces
        cells.append(make_joint(index, spine, faces, *number_cell(spine.edges, faces), lookup_number))
    _check_senses(index, [traced.use for traced in trace.edges], cells[0].name)
    return Chain(
        tuple(cells),
        tuple(junction for junction in trace.junctions if any(junction.crossed)),
        trace.closed,
        trace.ends,
        origin=sum(table.length for table in cells[0].spine.tables[:position]) if trace.closed else 0.0,
    )


def _is_cell_start(trace: ChainTrace, position: int) -> bool:
    """Whether an edge of a chain, which is not the first of an open one, begins a cell: past smooth edges."""
    return any(trace.junctions[position - 1].crossed)
