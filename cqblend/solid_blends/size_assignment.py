"""Which size each blend face gets: sizes given for edges, or for a whole chain of them, brought to its own t.

A size that varies is given along all edges that are blended in one: t runs from 0 to 1 by arc length, in the sense of
the picked edge with the lowest index; on a closed chain from where that edge starts. A blend face knows its own t only,
so it gets its share of the law. Where each edge has its own size, these are joined to one law first.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cqblend.blend_numbers import Size
from cqblend.blend_options import BlendRequest
from cqblend.blends.pde.varying_equation import has_functions
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.topology import find_end_vertices
from cqblend.errors import InputError
from cqblend.sizes.joined_sizes import join_sizes
from cqblend.sizes.size_law import SizeLaw
from cqblend.solid_blends.blend_sizes import read_sizes, replace_sizes

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape


@dataclass(frozen=True)
class _SizedChain:
    """A chain, and along it the t that sizes are functions of."""

    chain: Chain

    @cached_property
    def _arc_stops(self) -> list[float]:
        """Arc lengths (mm) from the start of the chain to the end of each edge, in the sense of the chain."""
        lengths = [table.length for cell in self.chain.cells for table in cell.spine.tables]
        return np.cumsum(lengths).tolist()

    @property
    def _arc_starts(self) -> list[float]:
        """The same to the start of each edge."""
        return [0.0, *self._arc_stops[:-1]]

    @cached_property
    def edge_numbers(self) -> list[int]:
        """The numbers of the edges in the input, in the sense of the chain; 0 of those that it does not have."""
        cells = self.chain.cells
        return [0 if c.lookup_number is None else c.lookup_number(edge) for c in cells for edge in c.spine.edges]

    @property
    def _is_backward(self) -> bool:
        return self.chain.cells[0].is_backward

    @cached_property
    def _first_edge(self) -> int:
        """The index of the edge that starts at t = 0, in the sense of t."""
        if not self.chain.closed:
            return len(self._arc_stops) - 1 if self._is_backward else 0
        return int(np.abs(np.array(self._arc_starts) - self.chain.origin).argmin())

    @cached_property
    def _origin(self) -> float:
        """The arc length (mm) at which t is 0."""
        return (self._arc_stops if self._is_backward else self._arc_starts)[self._first_edge]

    def locate_cells(self) -> list[tuple[float, float]]:
        """Return the t of the chain at which each cell starts and ends; of a closed chain, t may be outside [0, 1]."""
        counts = np.cumsum([len(cell.spine.edges) for cell in self.chain.cells])
        stops = [0.0, *(self._arc_stops[count - 1] for count in counts)]
        length, sign = stops[-1], -1.0 if self._is_backward else 1.0
        return list(itertools.pairwise([sign * (stop - self._origin) / length for stop in stops]))

    def join_edge_sizes(self, request: BlendRequest, given: Mapping[int, tuple[Size, ...]]) -> tuple[Size, ...]:
        """Return the sizes of the whole chain, joined from those that are given for its edges, by their numbers.

        Raises
        ------
        InputError
            An edge has none, or sizes do not agree where edges meet.
        """
        by_edge = _fill_gaps(self.edge_numbers, given, closed=self.chain.closed)
        known = next(sizes for sizes in by_edge if sizes is not None)
        names = ("radius",) if len(known) == 1 else ("width[0]", "width[1]")
        order, stops = self._order_edges()
        taper = None if request.taper is None else request.taper / self._arc_stops[-1]
        return tuple(
            join_sizes(
                name,
                [None if sizes is None else sizes[i] for sizes in map(by_edge.__getitem__, order)],
                stops,
                taper,
                lambda k: self._name_stop(order[k]),
                closed=self.chain.closed,
            )
            for i, name in enumerate(names)
        )

    def _order_edges(self) -> tuple[list[int], list[float]]:
        """Return the indices of the edges in the sense of t, from t = 0, and the t at which each of them ends."""
        count, length, sign = len(self._arc_stops), self._arc_stops[-1], -1 if self._is_backward else 1
        order = [(self._first_edge + sign * k) % count for k in range(count)]
        ends = self._arc_starts if self._is_backward else self._arc_stops
        return order, [*(sign * (ends[k] - self._origin) / length % 1.0 for k in order[:-1]), 1.0]

    def _name_stop(self, k: int) -> str:
        """Return the name of the vertex at which edge k ends, in the sense of t."""
        cell, edge = [(cell, edge) for cell in self.chain.cells for edge in cell.spine.edges][k]
        return cell.name_part(find_end_vertices(edge)[0 if self._is_backward else 1])


def check_edge_sizes(request: BlendRequest, shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge]) -> None:
    """Check that sizes and setbacks of single edges are those of picked edges of a shape.

    Raises
    ------
    InputError
        One belongs to another edge, or two to the same edge.
    """
    given = [("size", one.edge) for one in request.edge_sizes]
    given += [("setback", one.edge) for one in request.setbacks if one.edge is not None]
    if not given:
        return
    find_number = SolidIndex(shape).edges.find_number
    picked, seen = {find_number(edge) for edge in edges}, set[tuple[str, int]]()
    for kind, edge in given:
        number = find_number(edge)
        if not number or number not in picked:
            what = f"edge {number}, which is not picked" if number else "an edge that does not belong to the shape"
            raise InputError(f"a {kind} is given for {what}: a mapping has {kind}s of the edges that are blended")
        if (kind, number) in seen:
            raise InputError(f"two {kind}s are given for edge {number}")
        seen.add((kind, number))


def assign_sizes(request: BlendRequest, chain: Chain, picked: Sequence[int]) -> list[BlendRequest]:
    """Return the request of each cell of a chain: its radius or widths are numbers, or laws of the cell's own t.

    So is its share of the chain, where sizes or other functions of t vary.

    ``picked`` are the numbers of those edges of the chain that were picked.

    Raises
    ------
    InputError
        A size cannot be that of this chain: of a closed one, it must be the same at both ends; of single edges, sizes
        must agree where these meet.
    """
    sized, lookup = _SizedChain(chain), chain.cells[0].lookup_number
    sizes = read_sizes(request).sizes
    if request.edge_sizes and lookup is not None:
        given = {lookup(one.edge): one.sizes for one in request.edge_sizes}
        sizes = sized.join_edge_sizes(request, given)
        for number in set(picked) - set(sized.edge_numbers):
            if given.get(number, sizes) != sizes:
                raise InputError(
                    f"edge {number} is part of a longer one, whose faces were united, but has another size"
                )
    elif not any(isinstance(size, SizeLaw) for size in sizes):
        if not has_functions(request.parameters):
            return [request] * len(chain.cells)
        return [replace(request, share=span) for span in sized.locate_cells()]
    whole = [size.close() if isinstance(size, SizeLaw) and chain.closed else size for size in sizes]
    return [
        replace_sizes(
            replace(request, share=span),
            [size.restrict(*span) if isinstance(size, SizeLaw) else size for size in whole],
        )
        for span in sized.locate_cells()
    ]


def _fill_gaps(
    numbers: Sequence[int], given: Mapping[int, tuple[Size, ...]], *, closed: bool
) -> list[tuple[Size, ...] | None]:
    """Return the sizes of every edge, by number: those that are given, or else those of the edges next to it that are.

    Where these differ, an edge that is not in the input, number 0, has none: it runs around a blend that was made
    before in the same call, and sizes change along it.

    Raises
    ------
    InputError
        None of them has any, or the edges next to one have different ones.
    """
    found = [given.get(number) for number in numbers]
    known = [k for k, sizes in enumerate(found) if sizes is not None]
    if not known:
        raise InputError(f"edge {next(filter(None, numbers), 0)} is to be blended, but no size is given for it")
    for k, sizes in enumerate(found):
        if sizes is None:
            before = [j for j in known if j < k] or (known[-1:] if closed else [])
            after = [j for j in known if j > k] or (known[:1] if closed else [])
            near = [found[j] for j in (*before[-1:], *after[:1])]
            if any(one != near[0] for one in near):
                if numbers[k] == 0:
                    continue
                raise InputError(
                    f"edge {numbers[k]} lies between edges {numbers[before[-1]]} and {numbers[after[0]]}, which have "
                    "different sizes: give it one, too"
                )
            found[k] = near[0]
    return found
