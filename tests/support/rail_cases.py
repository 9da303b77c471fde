"""What the tests of fitted rails share: a wedge with its contacts, and points and directions of ribbons."""

from __future__ import annotations

import math

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.surfaces.vectors import LocalFrame

FRAME = LocalFrame(np.zeros(3), np.eye(3))
WALL = LocalFrame(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
TURN = 2 * math.pi


def homogeneous(x: np.ndarray) -> np.ndarray:
    return x[..., :3] / x[..., 3:]


def points(rail: Ribbon, t: np.ndarray) -> np.ndarray:
    return homogeneous(rail.primary.compose_position(rail.c)(t))


def fields(rail: Ribbon, t: np.ndarray) -> np.ndarray:
    x, dx = (jet(t) for jet in rail.jets)
    return (dx[:, :3] - homogeneous(x) * dx[:, 3:]) / x[:, 3:]


def wedge(t: np.ndarray) -> Contacts:
    """The floor z = 0 and the wall y = 0, along x: contacts at distance 2 and 3."""
    x = 10 * np.asarray(t)
    return Contacts(
        t,
        np.stack([x, 0 * x, 0 * x], -1),
        (np.stack([x, 2 + 0 * x], -1), np.stack([x, 3 + 0 * x], -1)),
        np.full((2, len(x)), 1.5),
    )
