"""Kernel-neutral B-rep: trimmed patches, the uses of edges by their loops, and the edges that patches share.

Everything in patterns works on these objects, on splines and arrays, so that nothing of it depends on OCCT:
:mod:`cqblend.brep.conversion.patch_reading` makes them from its faces. Depends on splines only.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from cqblend.errors import CqblendError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array

FaceKind = Literal["plane", "cylinder", "cone", "sphere", "torus", "extrusion", "revolution", "freeform"]
"""Type of a face's surface; that of planes, cylinders, cones and extrusions is linear in v."""

CurveFunction = Callable[[Array], Array]
"""Vectorised: parameters (n,) to points (n, dim), or to other parameters (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneFrame:
    """A plane in space with two perpendicular unit vectors.

    Attributes
    ----------
    origin, x, y
        (3,) each.

    Examples
    --------
    >>> ground = PlaneFrame(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    >>> ground.normal
    array([1., 0., 0.])
    >>> ground.to_local_coords(np.array([[1.0, 2.0, 3.0]]))
    array([[2., 3.]])
    """

    origin: Array
    x: Array
    y: Array

    @property
    def normal(self) -> Array:
        """The unit vector x cross y, (3,)."""
        return np.cross(self.x, self.y)

    def to_local_coords(self, points: Array) -> Array:
        """Return the coordinates (..., 2) of the projections of points (..., 3)."""
        return np.asarray((points - self.origin) @ np.stack([self.x, self.y], axis=-1))

    def to_world_coords(self, xy: Array) -> Array:
        """Return the points (..., 3) that have given coordinates (..., 2)."""
        return np.asarray(self.origin + xy @ np.stack([self.x, self.y]))

    def project_curve(self, curve: Curve) -> Curve:
        """Return the projection of a curve of space as a curve (x, y) of the same parameter."""
        degree, knots, poles, weights = curve.to_bspline()
        return Curve.from_bspline(degree, knots, self.to_local_coords(poles), weights)

    def make_rectangle(self, low: Array, high: Array) -> Surface:
        """Return the plane as a surface in its coordinates, from the corner low (2,) to the corner high (2,)."""
        (u0, v0), (u1, v1) = low.tolist(), high.tolist()
        corners = self.to_world_coords(np.array([[[u0, v0], [u0, v1]], [[u1, v0], [u1, v1]]]))
        return Surface.from_bspline((1, 1), ([u0, u0, u1, u1], [v0, v0, v1, v1]), corners)


@dataclass(frozen=True, slots=True, eq=False)
class EdgeUse:
    """One use of an edge by a loop.

    Attributes
    ----------
    edge
        Number of the edge, a key of :attr:`PatchShell.edges`.
    forward
        Whether the loop runs along increasing t of the edge.
    pcurve
        t (n,) to (u, v) (n, 2) on the patch's surface, over the edge's range of t.
    breaks
        (k,) t at which the pcurve's polynomial or rational pieces meet, the ends of the edge's range included.
    degenerate
        Whether the edge is a point in space: a pole, an apex.
    """

    edge: int
    forward: bool
    pcurve: CurveFunction
    breaks: Array
    degenerate: bool = False

    @property
    def reversed_use(self) -> "EdgeUse":
        """The use of a loop that runs the other way."""
        return replace(self, forward=not self.forward)

    @property
    def ends(self) -> Array:
        """The (u, v) at which the loop enters and leaves the edge, (2, 2)."""
        ends = self.pcurve(self.breaks[[0, -1]])
        return ends if self.forward else ends[::-1]


Loop = tuple[EdgeUse, ...]
"""Uses in order; each starts where the one before ends, the first where the last ends."""


@dataclass(frozen=True, slots=True)
class UseKey:
    """Which use of an edge this is.

    Attributes
    ----------
    face
        Number of the patch, :attr:`Patch.index`.
    loop, position
        Index of the loop within the patch, and of the use within the loop.
    """

    face: int
    loop: int
    position: int


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A trimmed face, or several faces of one plane that are joined by edges.

    Attributes
    ----------
    faces
        Numbers of the faces, from 1, in the face map of the shape; several only if they lie in one plane.
    kind
        Type of its surface.
    surface
        In space, over the face's own window of parameters. Cylinders, cones and extrusions have their rulings in v.
    outward
        Whether Su x Sv points to the outer side. Always so on planes.
    loops
        The outer loop first, counterclockwise in the parameter plane (u to the right, v up), then holes, clockwise:
        material is on the left.
    frame
        Of a plane, whose (u, v) are its coordinates: the surface is ``origin + u x + v y``. Else None.
    area
        Of the face, or faces, mm^2.
    plane_deviation
        Largest distance of the face, or faces, from the plane, mm; 0 unless the patch is a plane.
    """

    faces: tuple[int, ...]
    kind: FaceKind
    surface: Surface
    outward: bool
    loops: tuple[Loop, ...]
    frame: PlaneFrame | None = None
    area: float = 0.0
    plane_deviation: float = 0.0

    @property
    def index(self) -> int:
        """Number of the first of its faces, which identifies the patch within its shell."""
        return self.faces[0]

    def list_uses(self) -> list[tuple[UseKey, EdgeUse]]:
        """Return all uses of edges by its loops, in order, with their keys."""
        return [(UseKey(self.index, j, k), use) for j, loop in enumerate(self.loops) for k, use in enumerate(loop)]


@dataclass(frozen=True, slots=True, eq=False)
class PatchEdge:
    """An edge of the shape; its parameter t is shared by all its uses.

    Attributes
    ----------
    index
        Its number, from 1, in the edge map of the shape.
    points
        t (n,) to points (n, 3).
    breaks
        (k,) t at which the curve's pieces meet, the ends of its range included.
    curve
        The symbolic curve in space, with ``curve(parameter(t)) = points(t)``. None if the edge is a point, or has
        curves on faces only.
    parameter
        t (n,) to the parameter of the symbolic curve, increasing; the same number except along conics.
    vertices
        Numbers of the vertices at the first and the last t; the same one if the edge is closed.
    faces
        Number of the face of every use; one face twice if it meets itself at the edge, which then is its seam.
    angle
        By how much the outer normal turns across the middle of the edge (rad), positive if it is convex; nan unless two
        faces, oriented alike, have normals there.
    gap
        Largest sampled distance between the curve in space and the curves S(pcurve(t)) of its uses (mm).
    degenerate
        Whether it is a point in space.
    """

    index: int
    points: CurveFunction
    breaks: Array
    curve: Curve | None
    parameter: CurveFunction
    vertices: tuple[int, int]
    faces: tuple[int, ...]
    angle: float
    gap: float
    degenerate: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class PatchShell:
    """What is to be unrolled of a shape: patches, and the edges that join them.

    Attributes
    ----------
    patches
        In the order of their first faces.
    edges
        By number: those that a loop uses, and no others.
    vertices
        By number: the points (3,) of the vertices of the edges.
    refused
        By number: faces that could not be read, and why.
    """

    patches: tuple[Patch, ...]
    edges: dict[int, PatchEdge]
    vertices: dict[int, Array]
    refused: dict[int, CqblendError] = field(default_factory=dict)

    def locate_edge_uses(self) -> dict[int, tuple[tuple[int, int, int], ...]]:
        """Return the uses of every edge, two at most: (patch, loop, position in the loop), indices from 0."""
        found: dict[int, tuple[tuple[int, int, int], ...]] = dict.fromkeys(self.edges, ())
        for i, patch in enumerate(self.patches):
            for j, loop in enumerate(patch.loops):
                for k, use in enumerate(loop):
                    found[use.edge] += ((i, j, k),)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class TrimmedSurface:
    """A surface and the loops that bound the part of it that is kept.

    Attributes
    ----------
    surface
        In space: ruled from w = 0 to w = 1, or a plane.
    loops
        Closed chains of runs, the outer one first; a run is a polygon (n + 1, 2), or a curve, in the surface's
        parameters and becomes one edge. Holes run against the outer loop. Empty if the surface is kept as a whole.
    outward
        Whether Su x Sv points to the outer side.
    """

    surface: Surface
    loops: tuple[tuple[Array | Curve, ...], ...] = ()
    outward: bool = True
