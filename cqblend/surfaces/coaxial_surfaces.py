"""Primary surfaces that go around an axis: their first parameter is the angle about the third axis of their frame."""

from __future__ import annotations

from cqblend.surfaces.quadrics import Cone, Cylinder, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline

CoaxialSurface = Cylinder | Cone | Sphere | RevolvedEllipse | RevolvedSpline
"""All kinds of them. In a frame that is not orthonormal, a cylinder is elliptic."""
