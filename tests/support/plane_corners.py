"""Corners of planes that blends of straight edges run into: the sides of their holes, made of formulas alone."""

import numpy as np

from cqblend.blends.corners.corner_side import make_face_side, make_strip_side
from cqblend.blends.corners.setbacks import choose_setback
from cqblend.splines import Curve, Surface
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame


def unit(vector):
    """Return a vector of length 1."""
    vector = np.asarray(vector, float)
    return vector / np.linalg.norm(vector)


def regular_pyramid(count, height):
    """Return the directions of the edges at the apex of a pyramid, counter-clockwise from above."""
    angles = 2 * np.pi * np.arange(count) / count
    return [np.array([np.cos(a), np.sin(a), -height]) for a in angles]


class PlaneCorner:
    """The corner of n planes at the origin, with edges from there in given directions, counter-clockwise from outside.

    Face i lies between edges i and i + 1. ``widths`` are those of the blend of each edge on the face before and after.
    """

    def __init__(self, directions, widths):
        self.count = len(directions)
        self.edges = [unit(one) for one in directions]
        self.normals = [unit(np.cross(self.edges[i], self.edges[(i + 1) % self.count])) for i in range(self.count)]
        self.widths = widths

    def point_into(self, edge, face):
        """Return the unit vector of a face that is square to an edge of it and points away from it."""
        sign = 1 if face == edge else -1
        return sign * np.cross(self.normals[face], self.edges[edge])

    @classmethod
    def of_ball(cls, normals, radius):
        """Make the convex corner of three planes, by outward normals, blended by a ball, counter-clockwise."""
        edges, widths = [], []
        for k, normal in enumerate(normals):
            before, other = normals[k - 1], normals[k - 2]
            edge = unit(np.cross(before, normal))
            edges.append(edge if edge @ other < 0 else -edge)
            angle = np.pi - np.arccos(before @ normal)
            widths.append((radius / np.tan(angle / 2),) * 2)
        return cls(edges, widths)

    def choose_setbacks(self):
        """Return setbacks by the rule of blends."""
        crossings = [self.cross_rails(face) for face in range(self.count)]
        return [
            choose_setback(max(self.widths[i]), (crossings[i][0], crossings[i - 1][1])).wanted
            for i in range(self.count)
        ]

    def make_strip(self, edge, length=50.0):
        """Return the strip H(t, v) of an edge, t the distance from the apex, from the face before to the face after."""
        before, after = (edge - 1) % self.count, edge
        offsets = [w * self.point_into(edge, f) for w, f in zip(self.widths[edge], (before, after), strict=True)]
        angle = np.arccos(np.clip(self.point_into(edge, before) @ self.point_into(edge, after), -1, 1))
        bulge = 4 * np.tan(angle / 2) * np.tan((np.pi - angle) / 4)
        rows = [offsets[0], offsets[0] * (1 - bulge / 3), offsets[1] * (1 - bulge / 3), offsets[1]]
        coefs = np.stack([np.array(rows) + t * self.edges[edge] for t in (0.0, length)])
        return Surface(([0.0, length], [0.0, 1.0]), coefs[..., None, None])

    def cross_rails(self, face):
        """Return the distances from the apex, along both edges of a face, at which their rails cross."""
        first, second = face, (face + 1) % self.count
        step = self.widths[second][0] * self.point_into(second, face)
        step = step - self.widths[first][1] * self.point_into(first, face)
        return np.linalg.lstsq(np.stack([self.edges[first], -self.edges[second]], 1), step, rcond=None)[0]

    def list_crossing_sides(self, dim=3):
        """Return the sides of the hole where rails cross, which end the strips, and each strip with its curve."""
        sides, pcurves = [], []
        for i in range(self.count):
            h, j = (i - 1) % self.count, (i + 1) % self.count
            strip = self.make_strip(i)
            stops = np.array([self.cross_rails(h)[1], self.cross_rails(i)[0]])
            lengths = [np.linalg.norm(strip(0.0, v, 0, 1)) for v in (0.0, 1.0)]
            cotangents = [
                self.edges[i] @ self.edges[k] / np.linalg.norm(np.cross(self.edges[i], self.edges[k])) for k in (h, j)
            ]
            slopes = -lengths[0] * cotangents[0], lengths[1] * cotangents[1]
            t = [stops[0], stops[0] + slopes[0] / 3, stops[1] - slopes[1] / 3, stops[1]]
            pcurve = Curve.bezier(np.stack([t, [0.0, 1 / 3, 2 / 3, 1.0]], axis=1))
            sides.append(make_strip_side(strip, pcurve, dim))
            pcurves.append((strip, pcurve))
        return sides, pcurves

    def list_setback_sides(self, setbacks, dim=3, turn=0.0):
        """Return the sides of the hole where strips end square before the apex; face curves ``turn`` off the rails."""
        sides = []
        for i in range(self.count):
            j = (i + 1) % self.count
            pcurve = Curve.bezier([[setbacks[i], 0.0], [setbacks[i], 1.0]])
            sides.append(make_strip_side(self.make_strip(i), pcurve, dim))
            frame = LocalFrame(np.zeros(3), np.array([self.edges[i], self.point_into(i, i), self.normals[i]]))
            start = setbacks[i] * self.edges[i] + self.widths[i][1] * self.point_into(i, i)
            stop = setbacks[j] * self.edges[j] + self.widths[j][0] * self.point_into(j, i)
            crossing = self.cross_rails(i)
            leave = (
                -0.85
                * (setbacks[i] - crossing[0])
                * (np.cos(turn) * self.edges[i] + np.sin(turn) * self.point_into(i, i))
            )
            arrive = 0.85 * (setbacks[j] - crossing[1]) * self.edges[j]
            points = np.stack([start, start + leave / 3, stop - arrive / 3, stop]) @ frame.axes[:2].T
            curve = Curve.bezier(np.column_stack([points, np.ones(4)]))
            sides.append(make_face_side(Plane(frame), curve, dim))
        return sides


def measure_outer_angles(sides, patches):
    """Return the largest angle between quads and what is beyond their sides, by normals of both."""
    worst = 0.0
    x = np.linspace(0, 1, 101)
    for i, side in enumerate(sides):
        following = patches[(i + 1) % len(sides)]
        normals = np.concatenate([find_normals(patches[i], x, 0 * x), find_normals(following, 0 * x, 1 - x)])
        t = np.concatenate([x / 2, 0.5 + x / 2])
        worst = max(worst, measure_angles(normals, find_side_normals(side, t)))
    return worst


def measure_spoke_angles(patches):
    """Return the largest angle between neighbouring quads along their spokes."""
    x = np.linspace(0, 1, 101)
    pairs = zip(patches, [*patches[1:], patches[0]], strict=True)
    return max(measure_angles(find_normals(a, 0 * x + 1, x), find_normals(b, x, 0 * x + 1)) for a, b in pairs)


def find_normals(surface, u, v):
    """Return unit normals of a surface."""
    normals = np.cross(surface(u, v, 1, 0), surface(u, v, 0, 1))
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def find_side_normals(side, t):
    """Return unit normals of what is beyond a side: of its tangent and its first field, in space."""
    curve, field = side.curve.jet(t, 1), side.fields[0](t)
    tangent = curve[1]
    if side.dim == 4:
        weight = curve[0][:, 3:]
        tangent = (curve[1][:, :3] - curve[0][:, :3] / weight * curve[1][:, 3:]) / weight
        field = (field[:, :3] - curve[0][:, :3] / weight * field[:, 3:]) / weight
        other = side.fields[1](t)
        other = (other[:, :3] - curve[0][:, :3] / weight * other[:, 3:]) / weight
    else:
        other = side.fields[1](t)
    normals = np.cross(field, other)
    del tangent
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def measure_angles(first, second):
    """Return the largest angle between lines along unit vectors."""
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return float(np.arctan2(sine, np.abs((first * second).sum(-1))).max())
