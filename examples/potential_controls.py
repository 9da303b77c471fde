"""What each control of a potential blend does (Lee, Bedi and Dubey, "Blend control"), on the two patches of figure 4.

The reach is how far the rails are from where the surfaces meet before they are reshaped, at the middle of the blend.
"""

import cadquery as cq
import numpy as np
import potential_models

import cqblend

tower, ground = primaries = [potential_models.tower(), potential_models.ground()]
MIDDLE = (0, -2, 2)  # of the tower


def made(a=1.0, b=1.0, lam=0.0, reference=MIDDLE, amounts=0.4):
    """Blend the two patches; the keywords are the controls."""
    grown = cqblend.reshape(tower, reference=reference, amounts=amounts)
    raised = cqblend.reshape(ground, reference=(0, 0, -12), amounts=0.06)
    return cqblend.potential_blend(grown, raised, cqblend.Conic(a, b, lam))


def one_sided():
    """Return amounts for the tower's 4 x 5 control points that grow to the right, and with the square of s in front."""
    columns = [0.1, 0.2, lambda s: 0.4 * s**2, 0.6, 0.7]
    return [columns] * 4


CONTROLS = {
    "a = b = 1": {},
    "a = 2": {"a": 2.0},
    "b = 2": {"b": 2.0},
    "lambda = -10": {"lam": -10.0},
    "reference to the left": {"reference": (-1.5, -2, 2)},
    "per control point": {"amounts": one_sided()},
}


def reach(blend):
    """Return how far the rails on surface 1 and 2 are from the joint of the surfaces as they were, in the middle."""
    edge = cqblend.potential_blend(
        cqblend.reshape(tower, reference=MIDDLE, amounts=1e-3),
        cqblend.reshape(ground, reference=(0, 0, -12), amounts=1e-3),
        cqblend.Conic(1e-3, 1e-3, 0),
    )
    joint = edge.surface(0.5, 0.5)
    return [float(np.linalg.norm(blend.surface(0.5, v) - joint)) for v in (0.0, 1.0)]


def sharpness(blend):
    """Return the largest curvature of the section in the middle (1/mm)."""
    v = np.linspace(0, 1, 401)
    rate, second = (blend.surface(np.full_like(v, 0.5), v, 0, k) for k in (1, 2))
    return float((np.linalg.norm(np.cross(rate, second), axis=1) / np.linalg.norm(rate, axis=1) ** 3).max())


by_control = {name: made(**options) for name, options in CONTROLS.items()}
if __name__ == "__main__":
    print(f"{'':24s}reach 1  reach 2  sharpness")
    for name, blend in by_control.items():
        one, two = reach(blend)
        print(f"{name:24s}{one:7.3f}  {two:7.3f}  {sharpness(blend):9.2f}")

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, by_control["a = b = 1"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="blend")  # type: ignore[name-defined]  # noqa: F821
