"""The fairing of a wing on a fuselage, Lee, Bedi and Dubey's figure 6, as one solid.

The wing is reshaped along its normals, each control point by its own function: elliptic below the wing and around its
nose, not at all on top, where the wing keeps its shape and the joint stays as sharp as it was, and by a Bezier curve of
five points at the trailing edge, which forks the fairing there.
"""

import cadquery as cq
import numpy as np
import potential_models

import cqblend

body, joint = potential_models.aircraft()
blend = potential_models.fairing()
result = cqblend.insert_blend(body, joint, blend)
print(result.certificate)

wing, part = potential_models.wing()


def kept():
    """Return how far the blend is from the wing, where that is not reshaped, at most (mm), and where that is (t).

    There, t is affine to u, so that each section of the blend lies on one of the wing's rulings.
    """
    knots = wing.breaks[0]
    still = [j for j in range(len(knots) - 1) if all(part[i] == potential_models.TOP for i in range(j, j + 4))]
    t = np.linspace(0, 1, 2001)
    u = blend.rails[1].curve(t)[:, 0]
    inside = (u > knots[still[0]]) & (u < knots[still[-1] + 1])
    root, tip = (wing(u[inside], np.full(inside.sum(), v)) for v in (0.0, 1.0))
    ruling = (tip - root) / np.linalg.norm(tip - root, axis=1)[:, None]
    off = blend.surface.grid(t[inside], np.linspace(0, 1, 33)) - root[:, None]
    return float(np.linalg.norm(np.cross(off, ruling[:, None]), axis=2).max()), t[inside][[0, -1]]


if __name__ == "__main__":
    distance, span = kept()
    cq.exporters.export(cq.Workplane(result.shape), "potential_fairing.step")
    print(f"the top keeps its shape within {distance:.1e} mm, over t = {span[0]:.3f} to {span[1]:.3f}")

if "show_object" in globals():
    show_object(result.shape, name="aircraft")  # type: ignore[name-defined]  # noqa: F821
