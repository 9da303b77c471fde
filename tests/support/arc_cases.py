"""Ribbons of a rolling ball on small bodies, for what is made of them: arcs, and proofs."""

from __future__ import annotations

import cadquery as cq

from cqblend.blend_options import BlendOptions
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.strip_context import StripContext

RADIUS = 1.25


def make_edges() -> dict[str, tuple[cq.Shape, cq.Edge]]:
    """Bodies with an edge: straight or round, convex or concave."""
    box, rod = cq.Solid.makeBox(30, 20, 10), cq.Solid.makeCylinder(5, 10)
    boss = cq.Workplane().box(40, 40, 8).faces(">Z").workplane().circle(8).extrude(12).val()
    cone = cq.Solid.makeCone(8, 4, 12)
    wedge = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (20, 18)]).close().extrude(20).val()
    picks = {
        "box": (box, (30, 20, 5)),
        "wedge": (wedge, (0, -10, 0)),
        "rod": (rod, (5, 0, 10)),
        "boss": (boss, (8, 0, 4)),
        "cone": (cone, (0, 8, 0)),
    }
    return {
        name: (body, min(body.Edges(), key=cq.Vertex.makeVertex(*point).distance))
        for name, (body, point) in picks.items()
    }


def fit_ribbons(name: str, **options: object) -> tuple[Ribbon, Ribbon]:
    """Fit ribbons along an edge, past its ends if it has any."""
    body, edge = make_edges()[name]
    method = choose_section_method(BlendOptions(RADIUS, section="hermite", **options).to_request())
    selection = select_chains(body.wrapped, [edge.wrapped], None, lambda _: 0.0, follow=False)
    ((found,),) = selection.networks
    (joint,) = found.chain.cells
    domain = (0.0, 1.0) if joint.spine.closed else (-0.05, 1.05)
    return StripContext(joint, method).fit_rails(domain)
