"""Pieces made by hand: solids whose patterns everybody knows, for the tests of tabs, labels and drawings."""

from itertools import pairwise

import numpy as np

from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.outline.plane_path import Path


def polyhedron(vertices, faces) -> Pieces:
    """Faces are lists of vertices, counterclockwise seen from outside; edges of one face only stay free."""
    vertices = np.asarray(vertices, dtype=float)
    edges = {(a, b): (i, j) for i, face in enumerate(faces) for j, (a, b) in enumerate(pairwise([*face, face[0]]))}
    index = {edge: k for k, edge in enumerate(e for e in edges if e[0] < e[1] and e[::-1] in edges)}
    pieces, normals, centres = [], [], []
    for i, face in enumerate(faces):
        corners = vertices[[*face, face[0]]]
        x = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
        normal = np.cross(corners[:-1], corners[1:]).sum(axis=0)
        normal /= np.linalg.norm(normal)
        flat = (corners - corners[0]) @ np.array([x, np.cross(normal, x)]).T
        runs = tuple(
            Run(
                Path.from_points(flat[j : j + 2]),
                corners[j : j + 2],
                "trim",
                index.get((a, b), index.get((b, a))),
            )
            for j, (a, b) in enumerate(pairwise([*face, face[0]]))
        )
        pieces.append(Piece(str(i + 1), (runs,)))
        normals.append(normal)
        centres.append(corners[:-1].mean(axis=0))
    seams = []
    for a, b in index:
        (i, j), (k, m) = edges[a, b], edges[b, a]
        angle = np.arccos(np.clip(normals[i] @ normals[k], -1, 1)) * np.sign((centres[i] - centres[k]) @ normals[i])
        seams.append(Seam(str(len(seams) + 1), (Place(i, 0, j), Place(k, 0, m)), angle=float(angle)))
    return Pieces(tuple(pieces), tuple(seams))


def box(a: float = 40.0, b: float = 40.0, c: float = 40.0) -> Pieces:
    """Six rectangles, twelve seams, all convex by a right angle."""
    vertices = [(x, y, z) for z in (0, c) for y in (0, b) for x in (0, a)]
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]]
    return polyhedron(vertices, faces)


def valley(size: float = 40.0) -> Pieces:
    """Two squares that meet in a valley of a right angle."""
    vertices = [(0, 0, 0), (size, 0, 0), (size, size, 0), (0, size, 0), (0, size, size), (size, size, size)]
    return polyhedron(vertices, [[0, 1, 2, 3], [3, 2, 5, 4]])


def lattice(columns: int = 10, rows: int = 10, size: float = 20.0) -> Pieces:
    """Squares of a plane, joined to their neighbours."""
    vertices = [(size * i, size * j, 0) for j in range(rows + 1) for i in range(columns + 1)]
    corner = [j * (columns + 1) + i for j in range(rows) for i in range(columns)]
    return polyhedron(vertices, [[c, c + 1, c + columns + 2, c + columns + 1] for c in corner])


def circle(radius: float, centre=(0.0, 0.0), clockwise: bool = False) -> Path:
    """Two half circles, from the rightmost point on."""
    points = np.array([[radius, 0.0], [-radius, 0.0], [radius, 0.0]]) + centre
    return Path(points, np.full(2, -1.0 if clockwise else 1.0))


def ring(radius: float, height: float, order: int) -> np.ndarray:
    """Places in space of a circle's three vertices, in the order of increasing angle (1) or against it (-1)."""
    return np.array([[radius, 0, height], [-radius, 0, height], [radius, 0, height]])[::order]


def wall(radius: float, height: float, bottom: int | None, top: int | None, side: int) -> Piece:
    """A cylinder's wall about z, unrolled: its bottom on y = 0, its ends joined."""
    turn = 2 * np.pi * radius
    below = Run(Path.from_points([[0, 0], [turn / 2, 0], [turn, 0]]), ring(radius, 0, 1), "rail", bottom)
    right = Run(
        Path.from_points([[turn, 0], [turn, height]]), np.array([[radius, 0, 0], [radius, 0, height]]), "end", side
    )
    above = Run(
        Path.from_points([[turn, height], [turn / 2, height], [0, height]]), ring(radius, height, -1), "rail", top
    )
    left = Run(Path.from_points([[0, height], [0, 0]]), np.array([[radius, 0, height], [radius, 0, 0]]), "end", side)
    return Piece("W", ((below, right, above, left),))


def cylinder(radius: float = 20.0, height: float = 50.0) -> Pieces:
    """Two discs and a wall; the wall has a seam to itself."""
    bottom = Piece("B", ((Run(circle(radius), ring(radius, 0, -1), "trim", 0),),))  # seen from below: mirrored
    top = Piece("T", ((Run(circle(radius), ring(radius, height, 1), "trim", 1),),))
    seams = (
        Seam("1", (Place(0, 0, 0), Place(2, 0, 0)), angle=np.pi / 2),
        Seam("2", (Place(1, 0, 0), Place(2, 0, 2)), angle=np.pi / 2),
        Seam("3", (Place(2, 0, 1), Place(2, 0, 3)), angle=0.0),
    )
    return Pieces((bottom, top, wall(radius, height, 0, 1, 2)), seams)


def tower(side: float = 80.0, radius: float = 15.0, height: float = 30.0) -> Pieces:
    """A square plate with a round hole, from whose rim a tube rises: a valley. The plate's border is free."""
    half = side / 2
    corners = np.array([[half, half], [-half, half], [-half, -half], [half, -half], [half, half]])
    border = Run(Path.from_points(corners), np.column_stack([corners, np.zeros(5)]), "trim")
    rim = Run(circle(radius, clockwise=True), ring(radius, 0, -1), "trim", 0)
    seams = (
        Seam("1", (Place(0, 1, 0), Place(1, 0, 0)), angle=-np.pi / 2),
        Seam("2", (Place(1, 0, 1), Place(1, 0, 3)), angle=0.0),
    )
    return Pieces((Piece("P", ((border,), (rim,))), wall(radius, height, 0, None, 1)), seams)


def arc(radius: float, start: float, stop: float, pieces: int = 1) -> Path:
    """An arc about the origin between two angles."""
    angles = np.linspace(start, stop, pieces + 1)
    return Path(
        radius * np.column_stack([np.cos(angles), np.sin(angles)]), np.full(pieces, np.tan((stop - start) / pieces / 4))
    )


def frustum(low: float = 30.0, high: float = 15.0, height: float = 40.0) -> Pieces:
    """An open frustum of a cone about z: one sector of a ring, its rims free, its ends joined."""
    slope = np.hypot(low - high, height)
    outer, inner = slope * low / (low - high), slope * high / (low - high)
    angle = 2 * np.pi * low / outer
    start, end = arc(outer, 0, angle, 2), arc(inner, angle, 0, 2)
    runs = (
        Run(start, ring(low, 0, 1), "rail"),
        Run(Path.from_points([start.points[-1], end.points[0]]), np.array([[low, 0, 0], [high, 0, height]]), "end", 0),
        Run(end, ring(high, height, -1), "rail"),
        Run(Path.from_points([end.points[-1], start.points[0]]), np.array([[high, 0, height], [low, 0, 0]]), "end", 0),
    )
    return Pieces((Piece("R", (runs,)),), (Seam("1", (Place(0, 0, 1), Place(0, 0, 3)), angle=0.0),))


def cone(radius: float = 20.0, height: float = 40.0) -> Pieces:
    """A cone's sector and its base."""
    slope = np.hypot(radius, height)
    rim = arc(slope, 0, 2 * np.pi * radius / slope, 2)
    apex, foot = np.array([0, 0, height]), np.array([radius, 0, 0])
    runs = (
        Run(Path.from_points([[0, 0], rim.points[0]]), np.array([apex, foot]), "end", 1),
        Run(rim, ring(radius, 0, 1), "rail", 0),
        Run(Path.from_points([rim.points[-1], [0, 0]]), np.array([foot, apex]), "end", 1),
    )
    base = Piece("B", ((Run(circle(radius), ring(radius, 0, -1), "trim", 0),),))
    seams = (
        Seam("1", (Place(0, 0, 0), Place(1, 0, 1)), angle=np.pi / 2 + np.arctan2(radius, height)),
        Seam("2", (Place(1, 0, 0), Place(1, 0, 2)), angle=0.0),
    )
    return Pieces((base, Piece("C", (runs,))), seams)


def gores(count: int = 8, radius: float = 40.0, segments: int = 40) -> Pieces:
    """A sphere's gores: thin lenses of many short arcs, pointed at the poles, each joined to the next."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, segments + 1)
    cos, sin = np.cos(latitude), np.sin(latitude)
    cos[[0, -1]] = 0.0
    half = radius * np.pi / count * cos
    right = np.column_stack([half, radius * latitude])
    right_path = Path(right, np.zeros(segments))
    pieces = []
    for k in range(count):
        sides = []
        for angle in (2 * np.pi * (k + 1) / count, 2 * np.pi * k / count):
            sides.append(radius * np.column_stack([cos * np.cos(angle), cos * np.sin(angle), sin]))
        left_path = Path(right[::-1] * [-1.0, 1.0], np.zeros(segments))
        runs = (
            Run(right_path, sides[0], "rail", k),
            Run(left_path, sides[1][::-1], "rail", (k - 1) % count),
        )
        pieces.append(Piece(str(k + 1), (runs,)))
    seams = tuple(
        Seam(str(k + 1), (Place(k, 0, 0), Place((k + 1) % count, 0, 1)), angle=2 * np.pi / count) for k in range(count)
    )
    return Pieces(tuple(pieces), seams)
