"""Draw the pictures of unrolling.md, from the models of the examples: ``python docs/draw_unrolled.py [MODEL ...]``.

In each, strips in space are beside the pieces that they are when laid flat, in the same colours.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import cadquery as cq
import numpy as np
from numpy.typing import NDArray

import cqblend
from cqblend import Pattern, demo, picture
from cqblend.brep.conversion.pattern_shapes import sew_strip_faces
from cqblend.patterns.files import drawing
from cqblend.patterns.files.drawing import Layer
from cqblend.patterns.stock import sheets
from cqblend.picture import Colour, Polylines, ShadedFaces, View

DOCS = Path(__file__).resolve().parent
PICTURES = DOCS / "pictures"
sys.path.insert(0, str(DOCS.parent / "examples"))

import unroll_models  # noqa: E402  (found only now)

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Window = tuple[float, float, float, float]
Size = tuple[int, int]
Drawn = ShadedFaces | Polylines

# Tolerance, relative to the diagonal of the model's box; direction of view; size of the picture in pixels, and the part
# of its width that the strips in space take. Coarse where rings are to be seen one by one, as in the paper.
MODELS: dict[str, tuple[float, Triple, Size, float]] = {
    "tube": (3e-3, (0.4, -1, 0.45), (900, 420), 0.36),
    "sphere": (3e-3, (0.5, -1, 0.35), (900, 310), 0.32),
    "cone_with_cylinder": (1e-3, (-0.8, -1, 0.5), (900, 420), 0.5),
    "pawn": (1e-3, (0.4, -1, 0.35), (720, 440), 0.4),
    "teapot": (1e-3, (0.35, -1, 0.45), (900, 330), 0.48),
    "helicopter": (1e-3, (-0.7, -1, 0.5), (900, 420), 0.5),
    "fighter": (1e-3, (-1, -0.9, 0.8), (900, 420), 0.5),
}

TINTS = demo.PORCELAIN, demo.COPPER, (0.55, 0.63, 0.60), (0.78, 0.66, 0.45)  # of pieces: neighbours differ
TAB = (0.62, 0.72, 0.84)
DARKER = 0.12  # pieces that lie flat are seen in full light
FRONT = (0.0, -1.0, 0.0)  # pieces lie in the plane y = 0, their sheet's y upwards
MARKS = {Layer.SCORE_MOUNTAIN: (0.1, 0.2, 0.8), Layer.SCORE_VALLEY: (0.1, 0.5, 0.1), Layer.ENGRAVE: picture.INK}


def tints(pattern: Pattern) -> list[Colour]:
    """Return a colour for each piece, the first of those that none of its neighbours has."""
    neighbours: dict[int, set[int]] = {i: set() for i in range(len(pattern.strips))}
    for seam in pattern.seams:
        one, other = (side.piece for side in seam.sides)
        neighbours[one].add(other)
        neighbours[other].add(one)
    taken: dict[int, int] = {}
    for i, around in neighbours.items():
        used = {taken.get(j) for j in around}
        taken[i] = next((number for number in range(len(TINTS)) if number not in used), 0)
    return [TINTS[number] for number in taken.values()]


def in_space(pattern: Pattern) -> list[Drawn]:
    """Return the strips as they are in space, and their borders."""
    tolerance = pattern.report.tolerance
    strips = [
        cq.Shape.cast(sew_strip_faces([source.to_trimmed_surface()], tolerance)) for source in pattern._unrolled.sources
    ]
    parts = [ShadedFaces(strip.Faces(), colour) for strip, colour in zip(strips, tints(pattern), strict=True)]
    return [*parts, rims([edge for strip in strips for edge in strip.Edges()])]


def rims(edges: Sequence[cq.Edge]) -> Polylines:
    """Return edges as lines."""
    return Polylines(
        [np.array([at.toTuple() for at in edge.positions(np.linspace(0, 1, 65))]) for edge in edges], width=1
    )


def flat(pattern: Pattern, labels: float | None = None) -> list[Drawn]:
    """Return the pieces on their sheet: faces, tabs behind them, what is cut, and with labels what else is marked."""
    (sheet,) = drawing.draw_sheets(sheets.arrange_pieces(pattern.pieces), label_height=labels)
    drawn: list[Drawn] = [
        ShadedFaces([upright(face, 0.0)], darker(colour))
        for face, colour in zip(pattern.faces(), tints(pattern), strict=True)
    ]
    if pattern.tabs:
        drawn.append(ShadedFaces([upright(face, 1.0) for face in pattern.faces(tabs=True)], darker(TAB)))
    drawn.append(lines(sheet, Layer.CUT, picture.INK, 1.0))
    if labels:
        drawn += [lines(sheet, layer, colour, 1.5) for layer, colour in MARKS.items() if sheet.paths_on(layer)]
    return drawn


def darker(colour: Colour) -> Colour:
    """Return a colour for what lies flat."""
    red, green, blue = (max(value - DARKER, 0.0) for value in colour)
    return red, green, blue


def upright(face: cq.Face, behind: float) -> cq.Face:
    """Return a face of the plane z = 0 in that of y = 0, or somewhat behind."""
    return face.rotate(cq.Vector(), cq.Vector(1, 0, 0), 90).translate(cq.Vector(0, behind, 0))


def lines(sheet: drawing.Drawing, layer: Layer, colour: Colour, width: float) -> Polylines:
    """Return what a drawing has on a layer."""
    plane = [path.sampled(0.02) for path in sheet.paths_on(layer)]
    return Polylines([np.insert(points, 1, 0.0, axis=1) for points in plane], colour, width)


def framed(
    drawn: Sequence[Drawn], eye: Triple, window: Window, size: Size, zoom: tuple[float, float] | None = None
) -> View:
    """Return a view that is filled by what is drawn, or by the lower left corner of it, of given parts of its size."""
    back = np.array(eye) / np.linalg.norm(eye)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back], axis=-1)
    points = np.concatenate([line for one in drawn if isinstance(one, Polylines) for line in one.lines]) @ axes
    low, high = points.min(axis=0), points.max(axis=0)
    if zoom is not None:
        high = low + (high - low) * [*zoom, 1.0]
    wide, tall = ((window[i + 2] - window[i]) * size[i] for i in (0, 1))
    height = 1.06 * max(high[1] - low[1], (high[0] - low[0]) * tall / wide)
    lift = 0.004 * height * back  # lines are a little in front of the faces that they bound
    lifted = [
        Polylines([line + lift for line in one.lines], one.colour, one.width) if isinstance(one, Polylines) else one
        for one in drawn
    ]
    x, y, z = axes @ ((low + high) / 2)
    return View(lifted, (back[0], back[1], back[2]), (x, y, z), height, window)


def formers(pattern: Pattern) -> list[Drawn]:
    """Return the sections that the strips are glued on."""
    faces = [former for former in pattern.cross_sections() if isinstance(former, cq.Face)]
    return [ShadedFaces(faces, demo.PORCELAIN), rims([edge for face in faces for edge in face.Edges()])]


def model(name: str) -> None:
    """Draw a model's strips beside its pieces, as figures 3, 6, 7, 8, 10 and 11 of the paper."""
    tolerance, eye, size, share = MODELS[name]
    solid = getattr(unroll_models, name)()
    pattern = cqblend.unroll(solid, tolerance * solid.BoundingBox().DiagonalLength)
    views = [framed(in_space(pattern), eye, (0, 0, share, 1), size)]
    if name == "sphere":
        views.append(framed(formers(pattern), (0.5, -1, 0.8), (share, 0, 2 * share, 1), size))
        views.append(framed(flat(pattern), FRONT, (2 * share, 0, 1, 1), size))
    elif name == "tube":
        layout = flat(pattern.with_tabs(8.0), labels=8.0)
        views.append(framed(layout, FRONT, (share, 0, 0.7, 1), size))
        views.append(framed(layout, FRONT, (0.7, 0, 1, 1), size, zoom=(0.4, 0.4)))
    else:
        views.append(framed(flat(pattern), FRONT, (share, 0, 1, 1), size))
    picture.draw_views(views, PICTURES / f"unroll_{name}.png", size=size)


if __name__ == "__main__":
    for name in sys.argv[1:] or MODELS:
        model(name)
