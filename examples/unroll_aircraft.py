"""The helicopter and the fighter of Elber's paper (1995, figures 8 and 11): booleans make dozens of trimmed faces.

Writes what is to be cut, and the strips as they are once assembled, for other CAD programs.
"""

import cadquery as cq
import unroll_models

import cqblend

aircraft = {"helicopter": unroll_models.helicopter(), "fighter": unroll_models.fighter()}
strips = {}
for name, model in aircraft.items():
    pattern = cqblend.unroll(model, 0.3)
    print(name, "with", len(model.Faces()), "faces")
    print(pattern.report)
    pattern.export(f"{name}.dxf")
    strips[name] = cq.Workplane(pattern.strips_3d())
    cq.exporters.export(strips[name], f"{name}.step")

if "show_object" in globals():
    show_object(strips["fighter"], name="fighter of strips")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
