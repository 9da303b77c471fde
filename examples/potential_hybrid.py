"""A parametric wing on an implicit fuselage: the hybrid case of Lee, Bedi and Dubey.

The fuselage is f(x, y, z) = 0, of rounded squares along x; its level sets f = s are larger ones. The wing is the spline
of their figure 6, moved along its normals. The fairing is exactly tangent to the wing, and to the fuselage as measured.
"""

import cadquery as cq
import numpy as np
import potential_models

import cqblend

LENGTH, WIDTH, HEIGHT = 7.0, 1.45, 1.3


def fuselage(x, y, z):
    """Return f: 0 on the fuselage, below inside, above outside."""
    return np.sqrt(np.sqrt((y / WIDTH) ** 4 + (z / HEIGHT) ** 4) + (x / LENGTH) ** 2) - 1


def fuselage_gradient(x, y, z):
    """Return the gradient of f."""
    square = np.sqrt((y / WIDTH) ** 4 + (z / HEIGHT) ** 4)
    root = np.sqrt(square + (x / LENGTH) ** 2)
    return np.stack([x / LENGTH**2 / root, y**3 / WIDTH**4 / square / root, z**3 / HEIGHT**4 / square / root])


wing = cqblend.reshape(potential_models.wing()[0], by="normal")
implicit = cqblend.ImplicitSurface(fuselage, fuselage_gradient)
blend = cqblend.potential_blend(wing, implicit, cqblend.Conic(0.25, 0.25, 0.0), form="exact")


def fuselage_face(level=0.0):
    """Return a level set as a face, interpolated, for the picture only."""
    angle, along = np.linspace(0, 2 * np.pi, 65), np.linspace(-0.96, 0.96, 41)
    c, s = np.cos(angle), np.sin(angle)
    section = np.stack([WIDTH * c, HEIGHT * s], axis=1) / (c**4 + s**4)[:, None] ** 0.25
    size = 1 + level
    points = [[cq.Vector(size * LENGTH * x, *(size * np.sqrt(1 - x * x) * place)) for x in along] for place in section]
    return cq.Face.makeSplineApprox(points, tol=1e-3)


if __name__ == "__main__":
    print(blend.certificate)
    points = blend.surface.grid(np.linspace(*blend.surface.domain[0], 201), [1.0])[:, 0]
    print(f"largest f on the rail: {np.abs(fuselage(*points.T)).max():.1e}")

if "show_object" in globals():
    faces = [cq.Face(cqblend.to_face(one)) for one in (wing.surface, blend.surface)]
    show_object(cq.Compound.makeCompound([fuselage_face(), *faces]), name="hybrid")  # type: ignore[name-defined]  # noqa: F821
