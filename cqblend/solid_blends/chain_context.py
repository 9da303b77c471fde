"""What the blend of one chain needs: the contexts of its cells, and the ribbons of all of them, made together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from cqblend.blend_options import BLEND_DEFAULTS, EndWanted
from cqblend.blends.network.chain_ribbons import ChainRibbons, RibbonPair, fit_chain_ribbons
from cqblend.blends.network.junction_stations import Crossings
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.crossed_edges import read_crossings
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.errors import InputError, UnsupportedError
from cqblend.solid_blends.chain_division import divide_chain
from cqblend.solid_blends.section_strategy import SectionAtJoint, SectionMethod, fill_cells, fill_cells_by_arcs
from cqblend.solid_blends.strip_context import StripContext


@dataclass(frozen=True, eq=False)
class ChainContext:
    """A chain, and the context of each of its cells, in the same order."""

    chain: Chain
    cells: tuple[StripContext, ...]

    @property
    def index(self) -> SolidIndex:
        """Facts of the solid that the chain is part of."""
        return self.cells[0].joint.index

    @property
    def method(self) -> SectionMethod:
        """The section method that the chain is blended with."""
        return self.cells[0].method

    @property
    def name(self) -> str:
        """What messages call it: its first edge."""
        return self.cells[0].joint.name

    @property
    def end_cells(self) -> tuple[StripContext, StripContext]:
        """The cells at the start and at the stop of an open chain."""
        return self.cells[0], self.cells[-1]

    @property
    def end_joints(self) -> tuple[Joint, Joint]:
        """The joints of these cells."""
        return self.cells[0].joint, self.cells[-1].joint

    @property
    def largest_size(self) -> float:
        """The largest size (mm) of a cell, anywhere along it."""
        return max(cell.method.size for cell in self.cells)

    @property
    def varies(self) -> bool:
        """Whether sizes vary along the chain."""
        return any(cell.method.sizes.laws or cell.method.size != self.method.size for cell in self.cells)

    def find_point_ends(self, wanted: tuple[EndWanted, EndWanted]) -> tuple[bool, bool]:
        """Return whether an open chain ends in a point at its start and at its stop, by what ends are asked for there.

        It does where the size goes to 0. Where the joint fades out, a flat cap may stand before the vertex.

        Raises
        ------
        InputError
            The size goes to 0 at both ends, so that no other end can be had.
        """
        is_nothing = [cell.method.sizes.vanishes[end] for end, cell in enumerate(self.end_cells)]
        if all(is_nothing) and wanted != (BLEND_DEFAULTS.ends,) * 2:
            raise InputError("ends has no effect where the size is 0 at both ends, which are points: leave ends out")
        first, last = (
            is_nothing[end] or (cell.vanishes[end] and wanted[end] != "flat") for end, cell in enumerate(self.end_cells)
        )
        return first, last

    @property
    def lengths(self) -> Sequence[float]:
        """The lengths (mm) of the edges of the cells."""
        return [cell.joint.spine.length for cell in self.cells]

    @property
    def must_be_divided(self) -> bool:
        """Whether a rail leaves its face inside a cell, or passes several smooth edges at one vertex.

        Next to the ends of a cell it may leave it over the edges that end there.
        """
        passes = any(len(edges) > 1 for junction in self.chain.junctions for edges in junction.crossed)
        return passes or any(cell.leaving_contact is not None for cell in self.cells)

    def divide(self) -> ChainContext:
        """Return the context of the same chain with a cell for every stretch along which rails stay on their faces.

        That is this chain if no rail leaves its face but where cells meet.

        Raises
        ------
        SizeError, GeometryError
            If a rail leaves its face, and does not go on smoothly.
        """
        if not self.must_be_divided and all(side.all() for cell in self.cells for side in cell.contacts_inside):
            return self
        divided = divide_chain(self.chain, self.cells)
        return self if divided is None else ChainContext(divided.chain, divided.cells)

    def scale(self, factor: float) -> ChainContext:
        """Return the context of the same chain with a blend of another size: all its lengths times a factor."""
        return ChainContext(self.chain, tuple(cell.scale(factor) for cell in self.cells))

    def make_blends(
        self, domain: tuple[float, float], *, arcs: bool = True, settled: tuple[bool, bool] = (False, False)
    ) -> list[BlendSurface]:
        """Return the blend surfaces of all cells; without ``arcs``, not of those, even where they are exact.

        Those of an open chain reach at least from ``domain[0]``, a t of the first cell, to ``domain[1]``, one of the
        last cell. Ends that are ``settled`` are there, in sections that are exactly those of the contacts.
        """
        if not self.chain.junctions and not any(settled):
            (cell,) = self.cells
            return [cell.make_blend(domain, arcs=arcs)]
        rails, open_domain = [cell.describe_rails() for cell in self.cells], None if self.chain.closed else domain
        wants_arcs = arcs and all(cell.section.may_be_arcs for cell in self.cells)
        fitted = fit_chain_ribbons(rails, self._crossings, open_domain, arcs=wants_arcs, settled=settled)
        if fitted.for_arcs:
            try:
                return fill_cells_by_arcs(self._pair_sections(fitted))
            except UnsupportedError:  # these rails are no good for other sections
                fitted = fit_chain_ribbons(rails, self._crossings, open_domain, settled=settled)
        return fill_cells(self._pair_sections(fitted), arcs=arcs)

    def _pair_sections(self, fitted: ChainRibbons) -> list[tuple[SectionAtJoint, RibbonPair]]:
        """Return what the section method does at each cell, and the ribbons there."""
        return [(cell.section, ribbons) for cell, ribbons in zip(self.cells, fitted.cells, strict=True)]

    @cached_property
    def _crossings(self) -> list[Crossings]:
        """What the rails cross at each junction."""
        joints = [cell.joint for cell in self.cells]
        return [
            read_crossings(joints[k], joints[(k + 1) % len(joints)], junction)
            for k, junction in enumerate(self.chain.junctions)
        ]
