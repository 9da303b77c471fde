"""The pawn and the teapot of Elber's paper (1995, figures 9 and 10), tiled over pages to be printed and glued.

Pieces are joined by separate strips of paper underneath, as in the paper: tabs would leave a stair at every seam.
"""

import cadquery as cq
import unroll_models

import cqblend

models = {"pawn": unroll_models.pawn(), "teapot": unroll_models.teapot()}
patterns = {name: cqblend.unroll(model, 0.5) for name, model in models.items()}
for name, pattern in patterns.items():
    print(name)
    print(pattern.report)
    pattern.with_tabs(6, style="strips").export(f"{name}.pdf", labels=3, page="a4")

if "show_object" in globals():
    shown = cq.Workplane(patterns["teapot"].strips_3d())
    show_object(shown, name="teapot of strips")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
