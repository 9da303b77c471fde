"""What ``cqblend demo`` shows: the spout of the Utah teapot blended onto its body (Kim & Elber, figure 9).

Exists as the first thing that a newcomer runs, and as an example of the library's own use.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cqblend import teapot
from cqblend.front import BlendResult, blend_edges
from cqblend.occ.step import write_step

if TYPE_CHECKING:
    import cadquery

WIDTH = 0.15  # the teapot is 3 high


def run(folder: Path, *, width: float = WIDTH) -> tuple[BlendResult, Path, Path]:
    """Blend the teapot's spout, write ``teapot.step`` and ``teapot.png``; return the result and both paths.

    Raises
    ------
    StepError
        The file cannot be written.
    """
    pot = teapot.body().fuse(teapot.spout())
    result = blend_edges(pot, joint(pot), width=width, form="exact")
    step, picture = folder / "teapot.step", folder / "teapot.png"
    folder.mkdir(parents=True, exist_ok=True)
    write_step(result.shape.wrapped, step)
    draw(result, picture)
    return result, step, picture


def joint(pot: cadquery.Shape) -> cadquery.Edge:
    """Return the edge along which spout and body meet."""
    sharp = [edge for edge in pot.Edges() if len(edge.ancestors(pot, "Face").Faces()) == 2]
    return min(sharp, key=lambda edge: abs(edge.Center().x - 1.93) + abs(edge.Center().z - 1.05))


def draw(result: BlendResult, path: Path) -> None:
    """Draw the blended teapot, the blend in another colour, without a display."""
    from cadquery.vis import show, style

    blends = [face.hashCode() for face in result.faces]
    others = [face for face in result.shape.Faces() if face.hashCode() not in blends]
    show(
        *(style(face, tol=2e-3, angTol=0.05, color="antique_white", markersize=0, linewidth=1) for face in others),
        *(style(face, tol=2e-3, angTol=0.05, color="chocolate", markersize=0, linewidth=1) for face in result.faces),
        width=900,
        height=640,
        screenshot=str(path),
        interact=False,
        zoom=1.1,
        roll=-20,
        elevation=-62,
    )
