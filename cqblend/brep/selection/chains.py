"""Chains: rows of joints that go on tangentially from one pair of faces to the next, each a cell of one blend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from OCP.TopoDS import TopoDS_Edge, TopoDS_Vertex

from cqblend.brep.selection.joint import Joint

ChainEnd = Literal["corner", "sharp edge", "fading", "unlike edge", "not picked"]
"""Why a chain ends at a vertex.

- ``"corner"``: no edge goes on tangentially there;
- ``"sharp edge"``: one does, but on one side another sharp edge meets the chain, or the faces have a border;
- ``"fading"``: the faces become tangent to each other there;
- ``"unlike edge"``: the edge that goes on has not the same convexity all along, or is a knife edge or a seam;
- ``"not picked"``: the edge that goes on was not picked, and only picked edges are to be blended.
"""


@dataclass(frozen=True, eq=False)
class Junction:
    """Where one cell of a chain ends and the next one starts: at a vertex that the edges pass tangentially.

    Or inside an edge, where a rail leaves its face over a smooth edge: then there is no ``vertex``.
    ``crossed`` are, for side 1 and side 2, the smooth edges at the vertex that lie between the face of the cell before
    and that of the cell after, in the order in which the rail crosses them; none if that is one and the same face.
    """

    vertex: TopoDS_Vertex | None
    crossed: tuple[tuple[TopoDS_Edge, ...], tuple[TopoDS_Edge, ...]]


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints that follow one another, with the same sense and the same side first.

    Junction k is between cells k and k + 1; of a closed chain, the last one is between the last cell and the first. A
    joint that closes without a junction, such as the rim of a cylinder, is a closed chain of one cell and no junction.

    Attributes
    ----------
    ends : tuple of ChainEnd
        Why an open chain ends at its start and at its stop; none of a closed one.
    edge_numbers : tuple of int
        The numbers in the input of all edges, in the order of the chain.
    origin : float
        Arc length (mm) from the start of the first cell to the start of the edge at which the chain is said to start:
        0 but for closed chains in which that edge lies inside the first cell.
    divides : Chain or None
        Where rails leave faces over smooth edges inside cells, the same chain with one cell for each pair of faces at
        its edges; this one has more.
    """

    cells: tuple[Joint, ...]
    junctions: tuple[Junction, ...]
    closed: bool
    ends: tuple[ChainEnd, ...] = ()
    edge_numbers: tuple[int, ...] = ()
    origin: float = 0.0
    divides: Chain | None = None

    @property
    def edge_cells(self) -> tuple[Joint, ...]:
        """Those cells, in the order of the chain, of which each has edges of its own."""
        return self.cells if self.divides is None else self.divides.cells

    @property
    def edges(self) -> list[TopoDS_Edge]:
        """The edges of all cells, in the order of the chain."""
        return [edge for cell in self.edge_cells for edge in cell.spine.edges]

    @property
    def length(self) -> float:
        """Arc length of all edges (mm)."""
        return sum(cell.spine.length for cell in self.edge_cells)
