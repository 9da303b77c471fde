"""The Utah teapot (Newell, 1975) as solids, which ``cqblend demo`` blends after figure 9 of Kim & Elber.

Body, bottom and a planar cap on the rim make one solid, spout and lip with planar caps another; both are closed
B-spline faces of class C1, degree 3 x 3, not approximations. Handle and lid are left out.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cqblend.api.solid_functions import to_face
from cqblend.splines import Surface

if TYPE_CHECKING:
    import cadquery

# Patches by ring, each ring in the order in which it is joined around; the body starts at -x, away from the spout.
BODY = ((6, 7, 4, 5), (10, 11, 8, 9))
BOTTOM = ((30, 31, 28, 29),)
SPOUT = ((16, 17),)
LIP = ((18, 19),)


def poles() -> NDArray[np.float64]:
    """Return the Bezier poles of the 32 patches, (32, 4, 4, 3); the second index runs around, the third up or out."""
    data = json.loads(files("cqblend").joinpath("data/teapot.json").read_text())
    return np.array(data["points"])[np.array(data["patches"])].reshape(32, 4, 4, 3).swapaxes(1, 2)


def surface(rings: tuple[tuple[int, ...], ...]) -> Surface:
    """Join rings of patches into one spline, closed in u, C1 between patches as the teapot is."""
    patch = poles()
    coefs = np.stack([np.stack([patch[k] for k in ring]) for ring in rings])  # (nv, nu, 4, 4, 3)
    breaks = (np.arange(len(rings[0]) + 1.0), np.arange(len(rings) + 1.0))
    return Surface(
        breaks,
        coefs.transpose(2, 3, 4, 1, 0),
        continuity=(np.ones(len(rings[0]) - 1, int), np.ones(len(rings) - 1, int)),
    )


def _sew_solid(*surfaces: Surface) -> cadquery.Solid:
    """Sew closed faces and planar caps on their free rims into a solid."""
    import cadquery as cq

    faces = [cq.Face(to_face(one)) for one in surfaces]
    shell = cq.Shell.makeShell(faces)
    rims = [edge for edge in shell.Edges() if edge.Length() > 1e-6 and len(edge.ancestors(shell, "Face").Faces()) == 1]
    rims = [edge for edge in rims if edge.IsClosed()]
    caps = [cq.Face.makeFromWires(cq.Wire.assembleEdges([rim])) for rim in rims]
    return cq.Solid.makeSolid(cq.Shell.makeShell([*faces, *caps]))


def body() -> cadquery.Solid:
    """Return the body with its bottom and a planar cap on the rim."""
    return _sew_solid(surface(BODY), surface(BOTTOM))


def spout() -> cadquery.Solid:
    """Return the spout with its lip, and planar caps inside the body and on the tip."""
    return _sew_solid(surface(SPOUT), surface(LIP))
