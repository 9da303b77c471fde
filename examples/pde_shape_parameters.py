"""What shape parameters do: the cone and the cylinder blended by equations of order 4 with six sets of them.

One number s stands for (1, 2 s^2, s^4), the square of Laplace's operator with s on derivatives along. With s = 0 all
sections would be the cubics of a Hermite blend; the larger it is, the sooner the shape of the rails fades across.
"""

import cadquery as cq
import numpy as np
import pde_models

import cqblend

PARAMETERS = {
    "s = 0.5": 0.5,
    "s = 1": 1.0,
    "s = 2": 2.0,
    "s = 4": 4.0,
    "(1, 40, 1)": (1.0, 40.0, 1.0),
    "(1, 2, 60)": (1.0, 2.0, 60.0),
}

primaries, sides = pde_models.cone_with_cylinder()
by_parameters = {name: cqblend.pde_blend(*sides, parameters=value) for name, value in PARAMETERS.items()}

straight_across = cqblend.Combination(cqblend.Curve.bezier([(0, 1), (0, 1)], domain=sides[0].domain))
rails = [side.rail(number) for number, side in enumerate(sides, 1)]
hermite = cqblend.hermite_blend(*rails, tangents=straight_across, length="field")

print(f"Hermite: fairness {hermite.certificate.fairness:.3f}")
for name, blend in by_parameters.items():
    ring = blend.surface.grid(blend.surface.breaks[0], [0.5])[:, 0]
    print(
        f"{name}: fairness {blend.certificate.fairness:.3f}, {blend.solution.terms} terms, residual "
        f"{blend.certificate.residual:.0e}, ring in the middle {np.ptp(ring[:, 0]):.2f} x {np.ptp(ring[:, 1]):.2f} mm"
    )

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, by_parameters["s = 2"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="blend")  # type: ignore[name-defined]  # noqa: F821
