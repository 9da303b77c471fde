"""The example of ``cqblend demo``: the spout of the Utah teapot blended onto its body (Kim & Elber, figure 9)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cqblend import picture, teapot
from cqblend.api.solid_functions import BlendResult, blend_edges
from cqblend.picture import ShadedFaces, View

if TYPE_CHECKING:
    import cadquery

WIDTH = 0.15
"""Width of the blend; the teapot is 2.4 high."""

PICTURE_SIZE = (900, 560)
"""Width and height of the picture, pixels."""

PORCELAIN, COPPER = (0.93, 0.89, 0.82), (0.80, 0.42, 0.18)
"""Colours of the teapot and of the blend: red, green, blue, 0 to 1."""


def sharp() -> cadquery.Shape:
    """Return the teapot with a sharp edge around the spout."""
    return teapot.body().fuse(teapot.spout())


def joint(pot: cadquery.Shape) -> cadquery.Edge:
    """Return the edge where spout and body meet on the outside of the teapot."""
    between = [edge for edge in pot.Edges() if len(edge.ancestors(pot, "Face").Faces()) == 2]
    return min(between, key=lambda edge: abs(edge.Center().x - 1.93) + abs(edge.Center().z - 1.05))


def blended(pot: cadquery.Shape) -> BlendResult:
    """Blend the edge between spout and body."""
    return blend_edges(pot, joint(pot), width=WIDTH, form="exact")


def draw(pot: cadquery.Shape, result: BlendResult, path: Path) -> None:
    """Draw the blended teapot, and the joint enlarged: before, after, and with zebra stripes.

    Raises
    ------
    InstallationError
        This machine cannot draw without a display.
    OSError
        The file cannot be written.
    """
    blends = {face.hashCode() for face in result.faces}
    body = [face for face in result.shape.Faces() if face.hashCode() not in blends]
    whole, coloured = ShadedFaces(body, PORCELAIN), ShadedFaces(result.faces, COPPER)
    enlarged = [[ShadedFaces(pot.Faces(), PORCELAIN)], [whole, coloured], [ShadedFaces(result.shape.Faces(), None)]]
    views = [View([whole, coloured], (0.35, -1.0, 0.45), (0.62, 0.0, 1.2), 3.9, (0.0, 0.36, 1.0, 1.0))]
    for i, parts in enumerate(enlarged):
        views.append(View(parts, (0.55, -1.0, 0.35), (1.95, 0.0, 1.1), 1.45, (i / 3, 0.0, (i + 1) / 3, 0.36)))
    picture.draw_views(views, path, size=PICTURE_SIZE)
