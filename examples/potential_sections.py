"""Sections of potential blends of a plate and a pipe as lambda falls, and Hermite sections with the same ends.

The circle, lambda = 0, is OCCT's fillet; the less lambda, the nearer to the edge the blend comes. A Hermite section has
the same position and derivative at both ends, and knows of nothing in between.
"""

import cadquery as cq
import numpy as np

import cqblend

pipe = cq.Workplane().circle(3).extrude(8).faces("%CYLINDER").val()
plate = cq.Workplane().rect(16, 16).extrude(-1).faces(">Z").val()


def made(lam):
    """Blend the plate and the pipe."""
    sides = [cqblend.reshape(one, by="normal") for one in (plate, pipe)]
    return cqblend.potential_blend(*sides, cqblend.Conic(2, 2, lam))


LAMBDAS = (2, 0, -4, -40, -400)  # of a b = 4
by_lambda = {lam: made(lam) for lam in LAMBDAS}


def sections(blend):
    """Return a section of the blend, and of the Hermite one: distances (n, 2) from the pipe and from the plate."""
    v = np.linspace(0, 1, 401)
    both = []
    for one in (blend, blend.hermite):
        p = one.surface(np.full_like(v, 0.4), v)
        both.append(np.stack([np.hypot(p[:, 0], p[:, 1]) - 3, p[:, 2]], axis=-1))
    return both


if __name__ == "__main__":
    print("lambda  to the edge  of the other  apart   fairness  of the other")
    for lam, blend in by_lambda.items():
        own, other = sections(blend)
        nearest = [np.linalg.norm(one, axis=1).min() for one in (own, other)]
        apart = max(np.linalg.norm(other - point, axis=1).min() for point in own)
        fair = blend.certificate.fairness, blend.hermite.certificate.fairness
        print(f"{lam:6d}{nearest[0]:13.3f}{nearest[1]:14.3f}{apart:7.3f}{fair[0]:11.2f}{fair[1]:14.2f}")

if "show_object" in globals():
    faces = [plate, pipe, cq.Face(by_lambda[0].face())]
    show_object(cq.Compound.makeCompound(faces), name="plate and pipe")  # type: ignore[name-defined]  # noqa: F821
