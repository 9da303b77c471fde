"""Exactly smooth freeform blends and patterns for flat stock, for CadQuery and build123d, certified.

>>> import cadquery as cq, cqblend
>>> part = cq.Workplane().box(30, 20, 10).edges("|Z and >X and >Y").blend(2)

Light to import: a public name is loaded when it is first used, and ``Workplane.blend``, ``.bridge`` and ``.unroll`` are
registered when CadQuery is imported, before cqblend or after it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cqblend import cadquery_plugin, errors, installation_check
from cqblend.certificate import Certificate, EdgeRecord, EndRecord, RailRecord, SkippedEdges
from cqblend.errors import CqblendError

if TYPE_CHECKING:
    from cqblend.api.cross_derivatives import Combination, Guide
    from cqblend.api.flat_pattern import Pattern, unroll
    from cqblend.api.pde_surface import PdeBlend, pde_blend
    from cqblend.api.potential_surface import PotentialBlend, potential_blend, reshape
    from cqblend.api.solid_bridge import bridge
    from cqblend.api.solid_functions import (
        BlendResult,
        blend_edges,
        continuity,
        insert_blend,
        max_size,
        to_curve,
        to_edge,
        to_face,
        to_surface,
        verify,
    )
    from cqblend.api.surface_blend import Blend, curve_on, hermite_blend, projected
    from cqblend.blends.pde.boundary_data import Boundary
    from cqblend.blends.potential.implicit_surface import ImplicitSurface
    from cqblend.blends.potential.relations import BezierRelation, Conic, Relation
    from cqblend.blends.potential.surface_family import Family
    from cqblend.blends.rails.rail import Rail
    from cqblend.brep.measurement.edge_continuity import Continuity
    from cqblend.brep.verification.solid_verification import Verification
    from cqblend.sizes.size_functions import linear, table
    from cqblend.splines.curve import Curve
    from cqblend.splines.field_normalisation import Normalised, normalise
    from cqblend.splines.reparametrisation import change_of_parameter, reparameterise, with_end_speeds
    from cqblend.splines.surface import Surface

__version__ = "0.1.0"

__all__ = [
    "BezierRelation",
    "Blend",
    "BlendResult",
    "Boundary",
    "Certificate",
    "Combination",
    "Conic",
    "Continuity",
    "CqblendError",
    "Curve",
    "EdgeRecord",
    "EndRecord",
    "Family",
    "Guide",
    "ImplicitSurface",
    "Normalised",
    "Pattern",
    "PdeBlend",
    "PotentialBlend",
    "Rail",
    "RailRecord",
    "Relation",
    "SkippedEdges",
    "Surface",
    "Verification",
    "__version__",
    "blend_edges",
    "bridge",
    "change_of_parameter",
    "continuity",
    "curve_on",
    "errors",
    "hermite_blend",
    "insert_blend",
    "linear",
    "max_size",
    "normalise",
    "pde_blend",
    "potential_blend",
    "projected",
    "reparameterise",
    "reshape",
    "table",
    "to_curve",
    "to_edge",
    "to_face",
    "to_surface",
    "unroll",
    "verify",
    "with_end_speeds",
]

_HOME = {
    # the module, below cqblend, that defines each public name
    "BezierRelation": "blends.potential.relations",
    "Blend": "api.surface_blend",
    "BlendResult": "api.solid_functions",
    "Boundary": "blends.pde.boundary_data",
    "Combination": "api.cross_derivatives",
    "Conic": "blends.potential.relations",
    "Continuity": "brep.measurement.edge_continuity",
    "Curve": "splines.curve",
    "Family": "blends.potential.surface_family",
    "Guide": "api.cross_derivatives",
    "ImplicitSurface": "blends.potential.implicit_surface",
    "Normalised": "splines.field_normalisation",
    "Pattern": "api.flat_pattern",
    "PdeBlend": "api.pde_surface",
    "PotentialBlend": "api.potential_surface",
    "Rail": "blends.rails.rail",
    "Relation": "blends.potential.relations",
    "Surface": "splines.surface",
    "Verification": "brep.verification.solid_verification",
    "blend_edges": "api.solid_functions",
    "bridge": "api.solid_bridge",
    "change_of_parameter": "splines.reparametrisation",
    "continuity": "api.solid_functions",
    "curve_on": "api.surface_blend",
    "hermite_blend": "api.surface_blend",
    "insert_blend": "api.solid_functions",
    "linear": "sizes.size_functions",
    "max_size": "api.solid_functions",
    "normalise": "splines.field_normalisation",
    "pde_blend": "api.pde_surface",
    "potential_blend": "api.potential_surface",
    "projected": "api.surface_blend",
    "reparameterise": "splines.reparametrisation",
    "reshape": "api.potential_surface",
    "table": "sizes.size_functions",
    "to_curve": "api.solid_functions",
    "to_edge": "api.solid_functions",
    "to_face": "api.solid_functions",
    "to_surface": "api.solid_functions",
    "unroll": "api.flat_pattern",
    "verify": "api.solid_functions",
    "with_end_speeds": "splines.reparametrisation",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))


installation_check.explain_clash()
cadquery_plugin.register_on_import()
