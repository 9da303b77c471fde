"""The kinds of sections that a blend can have, each as one strategy (:mod:`cqblend.solid_blends.section_strategy`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.contacts.contact_solver import (
    Contacts,
    ContactSolver,
    Stations,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.blends.contacts.contact_tracing import cache_contacts, trace_contacts
from cqblend.blends.contacts.contacts_beyond import solve_balls_near, solve_setbacks_near
from cqblend.blends.contacts.turning_contacts import RoundFace, StandingBall, find_round_face
from cqblend.blends.contacts.vanishing_contacts import VanishingEnd, continue_to_ends
from cqblend.blends.network.chain_cell import CellPole
from cqblend.blends.pde.pde_settings import PdeSettings, SideSetup
from cqblend.blends.pde.varying_equation import replace_argument
from cqblend.blends.potential.offset_edge_sweep import EdgeSweep, sweep_from_edge
from cqblend.blends.potential.relations import Conic
from cqblend.blends.potential.swept_section import SweptSection, loosen_until_feasible, make_ribbon_targets
from cqblend.blends.rails import cross_directions
from cqblend.blends.rails.cross_directions import CrossField
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.arc_blend import blend_by_arcs
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.brep.selection.joint import Joint
from cqblend.errors import GeometryError, UnsupportedError
from cqblend.sizes.size_law import SizeLaw
from cqblend.solid_blends.blend_sizes import BlendSizes, read_sizes, scale_sizes
from cqblend.solid_blends.section_strategy import SectionAtJoint, SectionMethod
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Quadric
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import normalise_vectors

CROSS_FIELDS: dict[str, CrossField] = {
    "parametric": cross_directions.parametric_field,
    "perpendicular": cross_directions.perpendicular_field,
    "chord": cross_directions.chord_field,
}


@dataclass(frozen=True)
class HermiteMethod(SectionMethod):
    """Polynomial sections that leave the rails of a rolling ball, or rails at given widths, in wanted directions."""

    @property
    def sizes(self) -> BlendSizes:
        """The radius, or the widths on both sides (mm)."""
        return read_sizes(self.request)

    def scale(self, factor: float) -> HermiteMethod:
        """Return the same method with radius or widths times a factor."""
        return type(self)(scale_sizes(self.request, factor))

    def bind(self, joint: Joint) -> SectionAtJoint:
        """Return what the method does at one joint."""
        return _HermiteAtJoint(self, joint)

    @property
    def orders(self) -> tuple[int, int]:
        """How many cross derivatives each ribbon has."""
        first, second = self.request.continuity
        return int(first[1]), int(second[1])

    @property
    def targets(self) -> RibbonTargets:
        """The tolerances, cross fields and orders that the ribbons are fitted to."""
        first, second = (partial(np.full_like, fill_value=factor) for factor in self.request.bulge)
        tangents, radius = self.request.tangents, self.request.radius
        known: dict[str, CrossField] = CROSS_FIELDS
        if isinstance(radius, SizeLaw):
            known = {**CROSS_FIELDS, "perpendicular": cross_directions.BallField(radius)}
        return RibbonTargets(
            position=max(SOLID_BLEND_TOLERANCES.rail * self.size, SOLID_BLEND_TOLERANCES.min_rail),
            fields=(known[tangents[0]], known[tangents[1]]),
            bulges=(first, second),
            orders=self.orders,
            steer=self.request.steer,
            arcs=isinstance(radius, SizeLaw),
        )


@dataclass(frozen=True)
class _HermiteAtJoint(SectionAtJoint):
    method: HermiteMethod
    joint: Joint

    def make_solver(self) -> ContactSolver:
        joint, sizes = self.joint, self.method.sizes
        if self.round_face is not None:
            return self._make_round_solver(self.round_face)
        solve = trace_contacts(
            joint.sides, joint.locate_stations, joint.spine.length, self._solve_at_stations, varies=bool(sizes.laws)
        )
        ends = []
        for end, (vanishes, fades) in enumerate(zip(sizes.vanishes, self.fading_ends, strict=True)):
            limits = [sizes.find_vanishing_limit(end)] if vanishes else []
            limits += [joint.find_fading_limit(end)] if fades else []
            if limits:
                ends.append(VanishingEnd(float(end), min(limits) if end else max(limits)))
        if not ends:
            return solve
        return continue_to_ends(solve, self._locate_on_surfaces, joint.sides, self._measure_both_sizes, tuple(ends))

    def _make_round_solver(self, face: RoundFace) -> ContactSolver:
        """Return the solver of contacts around a round face."""
        ball, sizes = self._standing_ball, self.method.sizes
        return cache_contacts(lambda t, _: face.solve_contacts(t, np.broadcast_to(sizes.measure(t)[0], t.shape), ball))

    def solve_near(self, stations: Stations, expected: tuple[Array, Array]) -> Contacts:
        sides, sizes = self.joint.sides, self.method.sizes.measure(stations.t)
        if self.method.request.radius is not None:
            return solve_balls_near(sides, stations, sizes[0], expected, is_convex=self.joint.is_convex)
        return solve_setbacks_near(sides, stations, (sizes[0], sizes[1]), expected)

    @cached_property
    def round_face(self) -> RoundFace | None:
        """The round face that the ball of the blend goes around, with little room, if there is one."""
        joint, sizes = self.joint, self.method.sizes
        if self.method.request.radius is None or joint.spine.closed or joint.faces_at_edge is not None:
            return None
        if any(self.fading_ends) or any(sizes.vanishes):
            return None
        return find_round_face(joint.sides, self._locate_on_surfaces, self.method.size, self.method.targets.position)

    @cached_property
    def _standing_ball(self) -> StandingBall | None:
        """The ball of the blend, if it turns in place all along the joint."""
        if self.round_face is None or self.method.sizes.laws:
            return None
        return self.round_face.find_standing_ball(self.method.size, self.method.targets.position)

    @property
    def pole(self) -> CellPole | None:
        if self.round_face is None or self._standing_ball is None:
            return None
        return CellPole(1 - self.round_face.round_side, self._standing_ball.deviation)

    @property
    def turn(self) -> float | None:
        return None if self.round_face is None else abs(self.round_face.turn)

    @property
    def fading_ends(self) -> tuple[bool, bool]:
        return (False, False) if self.method.request.radius is None else self.joint.fading_ends

    def _solve_at_stations(self, stations: Stations, expected: tuple[Array, Array] | None) -> Contacts:
        """Return the contacts of stations, which are near the ``expected`` ones, if these are given."""
        sides, sizes = self.joint.sides, self.method.sizes.measure(stations.t)
        if self.method.request.radius is not None:
            return solve_ball_contacts(sides, stations, sizes[0], expected)
        return solve_setback_contacts(sides, stations, (sizes[0], sizes[1]), expected)

    def _locate_on_surfaces(self, t: Array) -> Stations:
        """Return stations at t that lie on both support surfaces; on the edge as it is, if the joint fades out."""
        joint = self.joint
        return joint.locate_stations(t) if any(self.fading_ends) else joint.locate_on_surfaces(t)

    def _measure_both_sizes(self, t: Array) -> Array:
        """Return how large the blend is on both sides at t (n,), (2, n), but for a smooth factor."""
        sizes = np.broadcast_to(self.method.sizes.measure(t), (2, len(t)))
        for end, fades in enumerate(self.fading_ends):
            sizes = sizes * np.abs(t - end) if fades else sizes
        return sizes

    def fill(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        request = self.method.request
        return blend_ribbons(ribbons, request.form, request.tolerance, request.angular_tolerance)


@dataclass(frozen=True)
class BallMethod(HermiteMethod):
    """The arcs of a rolling ball where these are exact, if nothing else is asked for; else polynomial sections."""

    def bind(self, joint: Joint) -> SectionAtJoint:
        """Return what the method does at one joint."""
        return _BallAtJoint(self, joint)


@dataclass(frozen=True)
class _BallAtJoint(_HermiteAtJoint):
    method: BallMethod

    @property
    def may_be_arcs(self) -> bool:
        return not self.method.sizes.laws

    @property
    def demands_arcs(self) -> bool:
        return self.method.request.section == "arc"

    def fill_by_arcs(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        joint = self.joint
        if self.method.sizes.laws:
            raise UnsupportedError("the radius varies along the edge")
        try:
            return blend_by_arcs(ribbons, self.method.size)
        except UnsupportedError as error:
            freeform = " and ".join(
                f"face {number} is freeform"
                for number, side in zip(joint.face_numbers, joint.sides, strict=True)
                if not isinstance(side.primary, Quadric | RevolvedEllipse)
            )
            raise error.with_details(after=f" ({freeform})" if freeform else "") from error


@dataclass(frozen=True)
class PdeMethod(HermiteMethod):
    """Sections that solve partial differential equations between such rails."""

    @property
    def equation_orders(self) -> tuple[int, int, int]:
        """The orders of the equations for x, y and z."""
        if self.request.order is None:
            raise TypeError("equations have orders")
        return self.request.order

    @property
    def orders(self) -> tuple[int, int]:
        """How many cross derivatives each ribbon has: as many as the highest order takes."""
        return (max(self.equation_orders) // 2 - 1,) * 2

    @property
    def _loop_advice(self) -> str:
        return "take smaller parameters, which let more of the rails' shape reach the middle, or a smaller bulge"

    def bind(self, joint: Joint) -> SectionAtJoint:
        """Return what the method does at one joint."""
        return _PdeAtJoint(self, joint)


@dataclass(frozen=True)
class _PdeAtJoint(_HermiteAtJoint):
    method: PdeMethod

    def fill(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        method, request = self.method, self.method.request
        options = request.form, request.tolerance, request.angular_tolerance
        parameters = replace_argument(request.parameters, partial(self._locate_on_chain, ribbons[0].c.domain))
        settings = PdeSettings(method.equation_orders, parameters, request.terms)
        return settings.blend_ribbons(ribbons, *options, SideSetup(self.joint.spine.closed, joined=ribbons[0].joined))[
            0
        ]

    def _locate_on_chain(self, domain: tuple[float, float], w: Array) -> Array:
        """Return the t (n,) of all that is blended in one at w (n,) of this joint, whose rails run over ``domain``."""
        if self.joint.spine.closed:
            w = domain[0] + (domain[1] - domain[0]) * w / (2 * np.pi)
        first, last = self.method.request.share
        t = first + (last - first) * w
        return np.where((t < 0) | (t > 1), t - np.floor(t), t)


@dataclass(frozen=True)
class PotentialMethod(SectionMethod):
    """Sections through the curves in which the two faces, moved together by related amounts, meet."""

    @property
    def relation(self) -> Conic:
        """How far both sides are moved."""
        if self.request.relation is None:
            raise TypeError("a potential section has a relation")
        return self.request.relation

    @property
    def sizes(self) -> BlendSizes:
        """How far both sides are moved (mm)."""
        return BlendSizes((self.relation.a, self.relation.b))

    def scale(self, factor: float) -> PotentialMethod:
        """Return the same method with both amounts times a factor."""
        conic = self.relation
        scaled = Conic(conic.a * factor, conic.b * factor, conic.lam * factor**2)
        return PotentialMethod(replace(self.request, relation=scaled))

    def bind(self, joint: Joint) -> SectionAtJoint:
        """Return what the method does at one joint."""
        return _PotentialAtJoint(self, joint)

    @property
    def tolerance(self) -> float:
        """The largest distance (mm) of the blend from its exact sections."""
        return max(self.request.tolerance, SOLID_BLEND_TOLERANCES.rail * self.size)

    @property
    def targets(self) -> RibbonTargets:
        """The tolerances, cross fields and orders that the ribbons are fitted to."""
        return make_ribbon_targets(self.tolerance, self.size)

    @property
    def steers(self) -> bool:
        """Never: the directions are those of the exact sections."""
        return False

    @property
    def size_advice(self) -> str:
        """What to do to find a size that fits."""
        return "try less"

    @property
    def _fold_advice(self) -> str:
        return ""

    def _check_turns(self, t: Array, v: Array, blend: BlendSurface) -> None:
        """Raise GeometryError where a section turns by half a turn or more.

        At acute edges these sections leave their rails backwards, so that their progress along the chord tells nothing.
        """
        tangents = blend.surface(t, v, 0, 1)
        directions = normalise_vectors(tangents.reshape(-1, 3)).reshape(tangents.shape)
        cosines = (directions[:, 1:] * directions[:, :-1]).sum(axis=-1)
        turns = np.arccos(np.clip(cosines, -1, 1)).sum(axis=1)
        if turns.max() >= np.pi:
            raise GeometryError(
                f"the section at t = {t[turns.argmax(), 0]:.3g} turns by {turns.max():.3g} rad: choose smaller a and b"
            )


@dataclass(frozen=True)
class _PotentialAtJoint(SectionAtJoint):
    method: PotentialMethod
    joint: Joint

    @cached_property
    def _sweep(self) -> EdgeSweep:
        """The curves in which the moved support surfaces meet."""
        joint, spine = self.joint, self.joint.spine
        return sweep_from_edge(
            joint.sides, joint.locate_stations, spine.length, self.method.relation, closed=spine.closed
        )

    def make_solver(self) -> ContactSolver:
        return cache_contacts(lambda t, _: self._sweep.solve_contacts(t))

    def fill(self, ribbons: tuple[Ribbon, Ribbon]) -> BlendSurface:
        domain, turn = ribbons[0].c.domain, self.joint.spine.measure_arc_angle()
        sweep = replace(self._sweep, domain=domain)
        if ribbons[0].light and turn is not None:
            layout = ArcLayout(domain, turn, get_largest_arc(self.joint))
            sweep = replace(sweep, edge_parameter_at=lambda t: layout.map_parameters(t)[0])
        return loosen_until_feasible(partial(self._fill_within, sweep, ribbons), self.method.tolerance)

    def _fill_within(self, sweep: EdgeSweep, ribbons: tuple[Ribbon, Ribbon], tolerance: float) -> BlendSurface:
        """Return the blend surface that is within a tolerance (mm) of its exact sections."""
        request = self.method.request
        section = SweptSection.from_sweep(sweep, self.joint.spine.closed, tolerance, joined=ribbons[0].joined)
        return section.blend_ribbons(ribbons, request.form, request.tolerance, request.angular_tolerance)


def choose_section_method(request: BlendRequest) -> SectionMethod:
    """Return the section method that a request asks for."""
    methods: dict[str, type[SectionMethod]] = {
        "auto": BallMethod,
        "arc": BallMethod,
        "hermite": HermiteMethod,
        "pde": PdeMethod,
        "potential": PotentialMethod,
    }
    return methods[request.section](request)


def get_largest_arc(joint: Joint) -> float:
    """Return the largest angle (rad) of one rational arc of a circular rail."""
    return RAIL_TOLERANCES.largest_closed_arc if joint.spine.closed else RAIL_TOLERANCES.largest_open_arc
