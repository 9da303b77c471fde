"""What a kind of sections is to blends of solids: the strategy that each of them is, and how cells are filled by it.

A section method tells where the rails run (its contacts), how the blend is to leave the faces there (its targets), what
is between the rails (its filling), when the result is sound (its check), and what the same blend is in another size.
Nothing else asks which kind of section was wanted.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver, Stations
from cqblend.blends.network.chain_cell import CellPole
from cqblend.blends.rails.ribbon import Ribbon, is_faded
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.sections.blend_surface import BlendSurface, find_fold
from cqblend.brep.selection.joint import Joint
from cqblend.errors import GeometryError, UnsupportedError
from cqblend.solid_blends.blend_sizes import BlendSizes
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class SectionMethod(ABC):
    """One kind of section, with the options that were asked for."""

    request: BlendRequest

    @property
    @abstractmethod
    def sizes(self) -> BlendSizes:
        """The lengths (mm) that set how large the blend is."""

    @abstractmethod
    def scale(self, factor: float) -> SectionMethod:
        """Return the same method with all these lengths times a factor."""

    @abstractmethod
    def bind(self, joint: Joint) -> SectionAtJoint:
        """Return what the method does at one joint."""

    @property
    @abstractmethod
    def targets(self) -> RibbonTargets:
        """The tolerances, cross fields and orders that the ribbons are fitted to."""

    @property
    def size(self) -> float:
        """The largest of these lengths (mm), anywhere along the edge."""
        return max(self.sizes.largest)

    @property
    def steers(self) -> bool:
        """Whether cross directions are turned at knot lines, so that the blend has no crease there."""
        return True

    @property
    def size_advice(self) -> str:
        """What to do to find a size that fits."""
        return "cqblend.max_size finds what does"

    def check(self, blend: BlendSurface) -> None:
        """Check that no section of a blend loops, and that the blend does not fold.

        Raises
        ------
        GeometryError
            If a section loops, because its cross derivatives are too long, or the blend folds.
        """
        t, v = _make_grid(blend)
        self._check_turns(t, v, blend)
        fold = find_fold(blend.surface, blend.ribbons)
        if fold is not None:
            raise GeometryError(
                f"the blend folds at t = {fold:.4g}: its sections cross; take another size{self._fold_advice}"
            )

    @property
    def _fold_advice(self) -> str:
        return ", smaller bulge or other tangents"

    @property
    def _loop_advice(self) -> str:
        return "it leaves its rails too fast; take a smaller bulge"

    def _check_turns(self, t: Array, v: Array, blend: BlendSurface) -> None:
        """Raise GeometryError where a section turns back on itself."""
        surface = blend.surface
        tangents = surface(t, v, 0, 1)
        chords = surface(t[:, -1], v[:, -1]) - surface(t[:, 0], v[:, 0])
        progress = (tangents * chords[:, None]).sum(axis=-1)
        if not np.all(progress > 0):
            raise GeometryError(
                f"the section at t = {t.flat[progress.argmin()]:.3g} turns back on itself: {self._loop_advice}"
            )


def _make_grid(blend: BlendSurface) -> tuple[Array, Array]:
    """Return parameters (t, v), (n, 33) each, all over a blend, but for where it has faded.

    Its sections are alike if both ribbons are light.
    """
    stations = np.linspace(*blend.surface.domain[0], 3 if all(ribbon.light for ribbon in blend.ribbons) else 33)
    faded = np.any([is_faded(ribbon, stations) for ribbon in blend.ribbons], axis=0)
    t, v = np.meshgrid(stations[~faded], np.linspace(0, 1, 33), indexing="ij")
    return t, v


class SectionAtJoint(ABC):
    """What a section method does at one joint."""

    @property
    def may_be_arcs(self) -> bool:
        """Whether the sections are arcs where these are exact."""
        return False

    @property
    def demands_arcs(self) -> bool:
        """Whether nothing but arcs will do."""
        return False

    @property
    def turn(self) -> float | None:
        """The angle (rad) by which the ball of the blend turns about a round face that it goes around, if it does."""
        return None

    @property
    def pole(self) -> CellPole | None:
        """The point about which the ball then turns."""
        return None

    @property
    def fading_ends(self) -> tuple[bool, bool]:
        """Whether both rails run into the edge at t = 0 and at t = 1, as the faces become tangent to each other."""
        return False, False

    @abstractmethod
    def make_solver(self) -> ContactSolver:
        """Return the function from t (n,) to where the blend meets both faces; it remembers what it has solved."""

    def solve_near(self, stations: Stations, expected: tuple[Array, Array]) -> Contacts:
        """Return the contacts of stations next to expected ones, also on faces beyond those at the edge.

        Raises
        ------
        UnsupportedError
            If such sections are not built there.
        GeometryError
            If there are no such contacts.
        """
        del stations, expected
        raise UnsupportedError("sections of this kind do not go on over a smooth edge of a face")

    @abstractmethod
    def fill(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        """Return the blend surface between two ribbons."""

    def fill_by_arcs(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        """Return the blend surface of arcs between two ribbons.

        Raises
        ------
        UnsupportedError
            If it is not wanted, or not exact, for a reason that it says.
        """
        del ribbons
        raise UnsupportedError("its sections are not to be arcs")


def fill_cells(
    cells: Sequence[tuple[SectionAtJoint, tuple[Ribbon, Ribbon]]], *, arcs: bool = True
) -> list[BlendSurface]:
    """Return the blend surfaces of all cells of one chain: arcs, if these are exact for each of them, and wanted.

    Raises
    ------
    UnsupportedError
        If arcs are asked for and not exact.
    CqblendError
        As :meth:`SectionAtJoint.fill`.
    """
    if arcs:
        try:
            return fill_cells_by_arcs(cells)
        except UnsupportedError as error:
            if any(section.demands_arcs for section, _ in cells):
                raise error.with_details(before='section="arc" is not exact here: ') from error
    return [section.fill(ribbons) for section, ribbons in cells]


def fill_cells_by_arcs(cells: Sequence[tuple[SectionAtJoint, tuple[Ribbon, Ribbon]]]) -> list[BlendSurface]:
    """Return the blend surfaces of all cells of one chain, which are arcs.

    Raises
    ------
    UnsupportedError
        If that is not exact for each of them.
    """
    return [section.fill_by_arcs(ribbons) for section, ribbons in cells]
