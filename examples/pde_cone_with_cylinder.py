"""The frustum of an irregular cone blended with an elliptic cylinder by six orders of equations (You, Zhang, fig. 1).

Order 2 keeps the position, 4 the tangent planes too, 6 the curvatures; in a mix, only z has the higher order.
"""

import cadquery as cq
import pde_models

import cqblend

primaries, sides = pde_models.cone_with_cylinder()
by_order = {
    name: cqblend.pde_blend(*sides, order=order, parameters=1.0, form="exact")
    for name, order in pde_models.ORDERS.items()
}
print(pde_models.table(by_order))

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, by_order["6"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="blend")  # type: ignore[name-defined]  # noqa: F821
