"""Draw the pictures of the documentation, from the demo and the examples: ``python docs/draw.py``."""

import runpy
from pathlib import Path

import cadquery as cq
import numpy as np

from cqblend import demo, picture
from cqblend.picture import Dots, Part, Strokes, View

DOCS = Path(__file__).resolve().parent
PICTURES, EXAMPLES = DOCS / "pictures", DOCS.parent / "examples"

# Rows of (example, zebra or not, direction of view, what is in the middle, height of the view in mm).
GALLERY = (
    (
        ("boss_on_sphere", False, (0.9, -1, 0.55), (2, -2, 4), 28),
        ("boss_on_sphere", True, (0.9, -1, 0.55), (3.5, -3.5, 8), 12),
        ("block", False, (-1, -0.75, 0.8), (0, 0, 0), 34),
    ),
    (
        ("boss_on_dome", False, (0.9, -1, 0.8), (0, 0, 0), 45),
        ("boss_on_dome", True, (0.9, -1, 0.8), (1, -1, 3), 16),
        ("bracket", False, (1, -1.4, 0.9), (0, 0, 13), 56),
    ),
)


def parts(example: str, *, zebra: bool) -> list[Part]:
    """Return what an example makes: all striped, or the blends in copper."""
    result = runpy.run_path(str(EXAMPLES / f"{example}.py"))["result"]
    faces = cq.Shape.cast(result.shape.wrapped).Faces()  # of whichever library
    if zebra:
        return [Part(faces, None)]
    blends = [cq.Shape.cast(face.wrapped) for face in result.faces]
    if example in {"block", "bracket"}:  # where an earlier call blended another edge, and nothing else is a spline
        blends = [face for face in faces if face.geomType() == "BSPLINE"]
    others = [face for face in faces if not any(face.isSame(blend) for blend in blends)]
    return [Part(others, demo.PORCELAIN), Part(blends, demo.COPPER)]


def gallery() -> None:
    """Draw the examples side by side."""
    views = []
    for i, row in enumerate(reversed(GALLERY)):
        for j, (example, zebra, eye, focus, height) in enumerate(row):
            window = (j / len(row), i / len(GALLERY), (j + 1) / len(row), (i + 1) / len(GALLERY))
            views.append(View(parts(example, zebra=zebra), eye, focus, height, window))
    picture.draw(views, PICTURES / "gallery.png", size=(900, 560))


def teapot() -> None:
    """Draw what ``cqblend demo`` draws."""
    pot = demo.sharp()
    demo.draw(pot, demo.blended(pot), PICTURES / "teapot.png")


def circle_speeds() -> None:
    """Draw circles with markers at equal steps of the parameter, and below each its speed over the parameter."""
    made = runpy.run_path(str(EXAMPLES / "circle_speeds.py"))
    t = np.linspace(0, 1, 129)
    frame = np.array([(-1, 0, -1.4), (-1, 0, -2.4), (1, 0, -2.4)], dtype=float)
    views = []
    for i, motion in enumerate(made["motions"].values()):
        points, marks = (np.insert(motion(at), 1, 0, axis=1) for at in (t, made["steps"]))
        speed = np.linalg.norm(motion(t, 1), axis=1)
        profile = np.stack([2 * t - 1, 0 * t, speed / 10 - 2.4], axis=1)
        drawn = [
            Strokes([points], demo.COPPER, 2.5),
            Dots(marks),
            Strokes([frame], width=1),
            Strokes([profile], demo.COPPER, 2.5),
        ]
        views.append(View(drawn, (0, -1, 0), (0, 0, -0.65), 3.9, (i / 3, 0, (i + 1) / 3, 1)))
    picture.draw(views, PICTURES / "circle_speeds.png", size=(900, 480))


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    teapot()
    gallery()
    circle_speeds()
