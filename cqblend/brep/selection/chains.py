"""Chains: rows of joints that go on tangentially from one pair of faces to the next, each a cell of one blend."""

from __future__ import annotations

from dataclasses import dataclass

from OCP.TopoDS import TopoDS_Edge, TopoDS_Vertex

from cqblend.brep.selection.joint import Joint


@dataclass(frozen=True, eq=False)
class Junction:
    """Where one cell of a chain ends and the next one starts: at a vertex that the edges pass tangentially.

    ``crossed`` are, for side 1 and side 2, the smooth edges at the vertex that lie between the face of the cell before
    and that of the cell after, in the order in which the rail crosses them; none if that is one and the same face.
    """

    vertex: TopoDS_Vertex
    crossed: tuple[tuple[TopoDS_Edge, ...], tuple[TopoDS_Edge, ...]]


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints that follow one another, with the same sense and the same side first.

    Junction k is between cells k and k + 1; of a closed chain of several cells, the last one is between the last cell
    and the first.
    """

    cells: tuple[Joint, ...]
    junctions: tuple[Junction, ...]
    closed: bool
