"""Exactly smooth freeform blends for CadQuery and build123d, certified and out to STEP.

>>> import cadquery as cq, cqblend
>>> part = cq.Workplane().box(30, 20, 10).edges("|Z and >X and >Y").blend(2)

Light to import: a public name is loaded when it is first used, and ``Workplane.blend`` is registered when CadQuery is
imported, before cqblend or after it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import wrapt

from cqblend import cadquery_plugin, errors, installation
from cqblend.certificate import Certificate, RailRecord
from cqblend.errors import CqblendError

if TYPE_CHECKING:
    from cqblend.front import BlendResult, blend_edges, continuity, to_face, to_surface, verify
    from cqblend.occ.measure import Continuity
    from cqblend.occ.verification import Verification
    from cqblend.splines.curve import Curve
    from cqblend.splines.surface import Surface

__version__ = "0.1.0"

__all__ = [
    "BlendResult",
    "Certificate",
    "Continuity",
    "CqblendError",
    "Curve",
    "RailRecord",
    "Surface",
    "Verification",
    "__version__",
    "blend_edges",
    "continuity",
    "errors",
    "to_face",
    "to_surface",
    "verify",
]

_HOME = {
    "BlendResult": "front",
    "Continuity": "occ.measure",
    "Curve": "splines.curve",
    "Surface": "splines.surface",
    "Verification": "occ.verification",
    "blend_edges": "front",
    "continuity": "front",
    "to_face": "front",
    "to_surface": "front",
    "verify": "front",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))


installation.explain_clash()
wrapt.when_imported("cadquery")(cadquery_plugin.register)
