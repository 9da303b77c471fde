"""The blend surface of one joint, as a request wants it: contacts, rails with their ribbons, and the section between.

The joint tells support faces and edge, the request the section, sizes and form. Depends on no topology.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

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
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.pde.pde_settings import PdeSettings, SideSetup
from cqblend.blends.potential.offset_edge_sweep import EdgeSweep, sweep_from_edge
from cqblend.blends.potential.swept_section import SweptSection, loosen_until_feasible, make_ribbon_targets
from cqblend.blends.rails import cross_directions
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.brep.selection.joint import Joint
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array

CROSS_FIELDS = {
    "parametric": cross_directions.parametric_field,
    "perpendicular": cross_directions.perpendicular_field,
    "chord": cross_directions.chord_field,
}


def _make_edge_sweep(joint: Joint, request: BlendRequest) -> EdgeSweep | None:
    """Return the curves in which the moved support surfaces meet, for a potential section; None for other sections."""
    if request.relation is None:
        return None
    return sweep_from_edge(
        joint.sides, joint.locate_stations, joint.spine.length, request.relation, closed=joint.spine.closed
    )


def make_contact_solver(joint: Joint, request: BlendRequest) -> ContactSolver:
    """Return the function from t (n,) to contacts on both support faces."""
    sweep = _make_edge_sweep(joint, request)

    def solve_at_stations(stations: Stations, expected: tuple[Array, Array] | None) -> Contacts:
        if request.radius is not None:
            return solve_ball_contacts(joint.sides, stations, request.radius, expected)
        first, second = request.lengths
        return solve_setback_contacts(joint.sides, stations, (first, second), expected)

    solve = (
        trace_contacts(joint.sides, joint.locate_stations, joint.spine.length, solve_at_stations)
        if sweep is None
        else cache_contacts(lambda t, _: sweep.solve_contacts(t))
    )
    if joint.spine.closed:
        return unwrap_closed_solver(solve, joint.primaries)
    return unwrap_open_solver(solve, joint.primaries)


def fit_rails(joint: Joint, request: BlendRequest, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon]:
    """Fit rails of the lightest form: straight or circular where that is exact, else cubic splines.

    Those of an open edge run over the given range of t, those of a closed one once around.
    """
    solve, closed = make_contact_solver(joint, request), joint.spine.closed
    targets = _get_ribbon_targets(request)
    if not closed:
        rails = fit_straight_ribbons(joint.primaries, solve, domain, targets, joint.extent)
        if rails is not None:
            return rails
    turn = joint.spine.measure_arc_angle()
    if turn is not None:
        layout = ArcLayout(domain, turn, _get_largest_arc(joint))
        rails = fit_circular_ribbons(joint.primaries, solve, layout, targets, joint.extent)
        if rails is not None:
            return rails
    if closed:
        start = joint.choose_rail_start(solve(np.arange(64) / 64))
        domain = (start, start + 1)
    return fit_cubic_ribbons(joint.primaries, solve, domain, targets, closed=closed)


def _get_ribbon_targets(request: BlendRequest) -> RibbonTargets:
    """Return the tolerances, cross fields and orders that the ribbons are fitted to."""
    if request.relation is not None:
        return make_ribbon_targets(_get_section_tolerance(request), get_largest_size(request))
    first, second = (partial(np.full_like, fill_value=factor) for factor in request.bulge)
    return RibbonTargets(
        position=max(SOLID_BLEND_TOLERANCES.rail * get_largest_size(request), SOLID_BLEND_TOLERANCES.min_rail),
        fields=(CROSS_FIELDS[request.tangents[0]], CROSS_FIELDS[request.tangents[1]]),
        bulges=(first, second),
        orders=_get_ribbon_orders(request),
        steer=request.steer,
    )


def _get_ribbon_orders(request: BlendRequest) -> tuple[int, int]:
    """Return how many cross derivatives each ribbon has: for equations, as many as the highest order takes."""
    if request.order is not None:
        return (max(request.order) // 2 - 1,) * 2
    return int(request.continuity[0][1]), int(request.continuity[1][1])


def make_blend_surface(ribbons: tuple[Ribbon, Ribbon], joint: Joint, request: BlendRequest) -> BlendSurface:
    """Return the blend surface between two ribbons, with the section and in the form that the request wants."""
    form_options = request.form, request.tolerance, request.angular_tolerance
    sweep = _make_edge_sweep(joint, request)
    if sweep is not None:
        domain, turn = ribbons[0].c.domain, joint.spine.measure_arc_angle()
        sweep = replace(sweep, domain=domain)
        if ribbons[0].light and turn is not None:
            layout = ArcLayout(domain, turn, _get_largest_arc(joint))
            sweep = replace(sweep, edge_parameter_at=lambda t: layout.map_parameters(t)[0])
        return loosen_until_feasible(
            partial(_blend_swept, sweep, joint.spine.closed, ribbons, request), _get_section_tolerance(request)
        )
    if request.order is None:
        return blend_ribbons(ribbons, *form_options)
    settings = PdeSettings(request.order, request.parameters, request.terms)
    return settings.blend_ribbons(ribbons, *form_options, SideSetup(joint.spine.closed))[0]


def _blend_swept(
    sweep: EdgeSweep, closed: bool, ribbons: tuple[Ribbon, Ribbon], request: BlendRequest, tolerance: float
) -> BlendSurface:
    """Return the potential blend between two ribbons that is within a tolerance (mm) of its exact sections."""
    section = SweptSection.from_sweep(sweep, closed, tolerance)
    return section.blend_ribbons(ribbons, request.form, request.tolerance, request.angular_tolerance)


def _get_largest_arc(joint: Joint) -> float:
    """Return the largest angle (rad) of one rational arc of a circular rail."""
    return RAIL_TOLERANCES.largest_closed_arc if joint.spine.closed else RAIL_TOLERANCES.largest_open_arc


def _get_section_tolerance(request: BlendRequest) -> float:
    """Return the largest distance (mm) of a potential blend from its exact sections."""
    return max(request.tolerance, SOLID_BLEND_TOLERANCES.rail * get_largest_size(request))


def get_largest_size(request: BlendRequest) -> float:
    """Return the size of a blend (mm): the largest of the lengths that set it."""
    return max(request.lengths)
