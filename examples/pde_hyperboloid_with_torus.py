"""A one-sheeted elliptic hyperboloid blended with a torus, by equations of order 2 and 6 (You and Zhang, figure 2).

Order 2 happens to leave these surfaces at small angles; order 6 keeps their curvatures.
"""

import cadquery as cq
import pde_models

import cqblend

primaries, sides = pde_models.hyperboloid_with_torus()
by_order = {
    name: cqblend.pde_blend(*sides, order=order, parameters=0.3, form="exact") for name, order in (("2", 2), ("6", 6))
}
print(pde_models.table(by_order))

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, by_order["6"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="blend")  # type: ignore[name-defined]  # noqa: F821
