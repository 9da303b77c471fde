"""What one strip needs at its joint: contacts, which are remembered, rails with their ribbons, and the section between.

There is one context for each joint of a call. Size checks, the reach of a blend, the plan of its ends and its rails all
take their contacts from there, so that none is solved twice.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.contacts_beyond import trace_contacts_beyond
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.network.chain_cell import CellRails
from cqblend.blends.rails.cross_directions import chord_field, parametric_field
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.line_and_arc_ribbons import (
    ArcLayout,
    fit_circular_ribbons,
    fit_straight_ribbons,
    fit_turning_ribbons,
)
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.rail_obstacles import find_leaving_contact
from cqblend.errors import CqblendError
from cqblend.solid_blends.contact_landing import Stretch, find_stretches
from cqblend.solid_blends.section_methods import get_largest_arc
from cqblend.solid_blends.section_strategy import SectionAtJoint, SectionMethod, fill_cells
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class StripContext:
    """One joint, the section method that it is blended with, and the contacts that have been solved there.

    The strip runs about along the ``window`` of the edge's t. Where it has faces beyond those at the edge, its contacts
    are found from ``known`` ones.
    """

    joint: Joint
    method: SectionMethod
    window: tuple[float, float] = field(default=(0.0, 1.0), kw_only=True)
    known: Contacts | None = field(default=None, kw_only=True)

    @cached_property
    def vanishes(self) -> tuple[bool, bool]:
        """Whether the blend has no width at t = 0 and at t = 1: its size goes to 0 there, or the joint fades out."""
        sizes, fades = self.method.sizes.vanishes, self.section.fading_ends
        return sizes[0] or fades[0], sizes[1] or fades[1]

    @cached_property
    def targets(self) -> RibbonTargets:
        """What the ribbons are to be."""
        targets = self.method.targets
        if self.section.turn is not None:  # around a round face, arcs are those of great circles
            first, second = (
                field if field in (parametric_field, chord_field) else chord_field for field in targets.fields
            )
            targets = replace(targets, fields=(first, second))
        return replace(targets, fades=True) if any(self.vanishes) else targets

    @cached_property
    def section(self) -> SectionAtJoint:
        """What the section method does at the joint."""
        return self.method.bind(self.joint)

    @cached_property
    def solve(self) -> ContactSolver:
        """The function from t (n,) to contacts on both support faces."""
        unwrap = unwrap_closed_solver if self.joint.spine.closed else unwrap_open_solver
        joint, section = self.joint, self.section
        solve = (
            section.make_solver()
            if self.known is None
            else trace_contacts_beyond(self.known, joint.locate_on_surfaces, section.solve_near, joint.primaries)
        )
        return unwrap(solve, joint.primaries)

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The stretches of the edge along which the contacts lie on one pair of faces, at the edge or beyond.

        Raises
        ------
        SizeError
            If contacts lie on no face that goes on smoothly from those at the edge.
        """
        return find_stretches(self.joint, self.method, self.solve)

    def take_stretch(self, stretch: Stretch) -> StripContext:
        """Return the context of the cell along a stretch."""
        return StripContext(stretch.joint, self.method, window=stretch.window, known=stretch.known)

    def scale(self, factor: float) -> StripContext:
        """Return the context of the same joint with a blend of another size: all its lengths times a factor."""
        return StripContext(self.joint, self.method.scale(factor))

    @cached_property
    def checked_contacts(self) -> Contacts:
        """Contacts all around a closed joint, inside an open one."""
        count = SOLID_BLEND_TOLERANCES.check_stations
        numbers = np.arange(count)
        if self.joint.spine.closed:
            return self.solve(numbers / (count - 1))
        first, last = self.window
        inside = first + (last - first) * (numbers + 0.5) / count
        try:  # with the ends, which are asked for later
            return self.solve(np.concatenate([(first,), inside, (last,)])).select_stations(np.arange(1, count + 1))
        except CqblendError:  # at an end, the joint may fade out
            return self.solve(inside)

    @cached_property
    def contact_points(self) -> Array:
        """The points of these contacts on both sides, (2, n, 3)."""
        contacts = self.checked_contacts
        return np.stack([side.jet(uv)[0] for side, uv in zip(self.joint.primaries, contacts.uv, strict=True)])

    @cached_property
    def contacts_inside(self) -> tuple[Array, Array]:
        """Which of these contacts (n,) lie inside the faces at the edge, by side."""
        first, second = (self.joint.classify_contacts(self.checked_contacts, side) for side in (0, 1))
        return first, second

    @property
    def leaving_contact(self) -> tuple[int, int] | None:
        """The side whose contacts leave their face, and the index of such a contact; None if none do."""
        return find_leaving_contact(self.contacts_inside, closed=self.joint.spine.closed)

    @property
    def has_point_rails(self) -> tuple[bool, bool]:
        """Whether all contacts of a side are one point, by side: the ball turns about it."""
        spread = np.ptp(self.contact_points, axis=1).max(axis=1)
        first, second = spread <= RAIL_TOLERANCES.point_rail_share * self.rail_distances.max(axis=1)
        return bool(first), bool(second)

    @cached_property
    def rail_distances(self) -> Array:
        """How far (mm) these contacts on both sides are from the edge, (2, n)."""
        return np.linalg.norm(self.contact_points - self.checked_contacts.edge_points, axis=2)

    def measure_reach(self) -> float:
        """Return the largest distance (mm) of the rails from the edge."""
        return float(self.rail_distances.max())

    def fit_rails(self, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon]:
        """Fit rails of the lightest form: straight or circular where that is exact, else cubic splines.

        Those of an open edge run over the given range of t, those of a closed one once around.
        """
        light = self.fit_light_rails(domain)
        if light is not None:
            return light
        joint, closed = self.joint, self.joint.spine.closed
        if closed:
            start = joint.choose_rail_start(self.solve(np.arange(64) / 64))
            domain = (start, start + 1)
        corners = self.method.sizes.locate_corners(domain)
        return fit_cubic_ribbons(joint.primaries, self.solve, domain, self.targets, closed=closed, corners=corners)

    def fit_light_rails(self, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon] | None:
        """Return straight or circular rails over a range of t, if these are exact."""
        joint, targets = self.joint, self.targets
        if not joint.spine.closed:
            rails = fit_straight_ribbons(joint.primaries, self.solve, domain, targets, joint.extent)
            if rails is not None:
                return rails
        turn = None if self.method.sizes.laws else self.section.turn or joint.spine.measure_arc_angle()
        if turn is None:
            return None
        layout = ArcLayout(domain, turn, get_largest_arc(joint))
        return fit_circular_ribbons(joint.primaries, self.solve, layout, targets, joint.extent)

    def fit_turning_rails(self, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon] | None:
        """Return light rails about a ball that turns in place, over a range of t, if these are exact."""
        joint, turn = self.joint, self.section.turn
        if turn is None:
            return None
        layout = ArcLayout(domain, turn, RAIL_TOLERANCES.largest_turning_arc)
        return fit_turning_ribbons(joint.primaries, self.solve, layout, self.targets, joint.extent)

    def describe_rails(self) -> CellRails:
        """Return what the ribbons of a chain take of this cell."""
        joint, method = self.joint, self.method
        return CellRails(
            joint.primaries,
            self.solve,
            self.targets,
            joint.spine.length,
            self.fit_light_rails,
            self.fit_turning_rails,
            self.section.turn is not None,
            self.section.pole,
            method.sizes.locate_corners,
            joint.rank,
            self.window,
        )

    def make_blend(self, domain: tuple[float, float], *, arcs: bool = True) -> BlendSurface:
        """Return the blend surface, over at least the given range of t of an open edge; of arcs only if ``arcs``."""
        (blend,) = fill_cells([(self.section, self.fit_rails(domain))], arcs=arcs)
        return blend
