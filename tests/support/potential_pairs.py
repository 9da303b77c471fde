"""Pairs of reshaped surfaces, each with its implicit amounts (s1, s2) at any point of space: closed forms."""

import cadquery as cq
import numpy as np

import cqblend


def face(solid, kind, index=0):
    return [one for one in solid.Faces() if one.geomType() == kind][index]


def plate(half=12.0, lift=0.0):
    net = np.array([[[x, y, lift] for y in (-half, half)] for x in (-half, half)])
    return cqblend.Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), net)


def normal(surface, amounts=1.0):
    return cqblend.reshape(surface, by="normal", amounts=amounts)


def axis_distance(p, origin, direction):
    return np.linalg.norm(np.cross(p - origin, np.asarray(direction) / np.linalg.norm(direction)), axis=-1)


TILT = (0.4, 0.2, 1.0)
PAIRS = {
    # two surfaces, and the implicit amounts (s1, s2) at a point
    "plate and pipe": (
        lambda: (normal(plate()), normal(face(cq.Solid.makeCylinder(3, 10, cq.Vector(0, 0, -5)), "CYLINDER"))),
        lambda p: (p[..., 2], np.hypot(p[..., 0], p[..., 1]) - 3),
    ),
    "plate and tilted pipe": (
        lambda: (
            normal(plate()),
            normal(face(cq.Solid.makeCylinder(2, 14, cq.Vector(-2.8, -1.4, -7), cq.Vector(*TILT)), "CYLINDER")),
        ),
        lambda p: (p[..., 2], axis_distance(p, [-2.8, -1.4, -7], TILT) - 2),
    ),
    "pipe on pipe, over its seam": (
        lambda: (
            normal(face(cq.Solid.makeCylinder(5, 30, cq.Vector(0, 0, -15)), "CYLINDER")),
            normal(face(cq.Solid.makeCylinder(2, 12, cq.Vector(0, 0, 0), cq.Vector(1, 0.1, 0.3)), "CYLINDER")),
        ),
        lambda p: (axis_distance(p, [0, 0, -15], (0, 0, 1)) - 5, axis_distance(p, [0, 0, 0], (1, 0.1, 0.3)) - 2),
    ),
    "inside a ball": (
        lambda: (
            normal(cq.Workplane().sphere(6).faces().val(), -1),
            normal(face(cq.Solid.makeCylinder(2, 7, cq.Vector(0, 0, 1)), "CYLINDER")),
        ),
        lambda p: (6 - np.linalg.norm(p, axis=-1), np.hypot(p[..., 0], p[..., 1]) - 2),
    ),
    "a plate from a reference": (
        lambda: (
            cqblend.reshape(plate(), reference=(0, 0, -4)),
            normal(face(cq.Solid.makeCylinder(3, 10, cq.Vector(0, 0, -5)), "CYLINDER")),
        ),
        lambda p: (p[..., 2] / 4, np.hypot(p[..., 0], p[..., 1]) - 3),
    ),
    "a ball from its middle": (
        lambda: (normal(plate()), cqblend.reshape(cq.Workplane().sphere(4).faces().val(), reference=(0, 0, 0))),
        lambda p: (p[..., 2], np.linalg.norm(p, axis=-1) / 4 - 1),
    ),
}
SIZES = {"a plate from a reference": (0.25, 1.0), "a ball from its middle": (1.0, 0.25)}
