"""The models of Lee, Bedi and Dubey's paper: two Bezier patches, and a wing on a fuselage.

The paper shows its control nets, but gives no numbers; these are nets of the same kind.
"""

import cadquery as cq
import numpy as np

import cqblend

SPAN = 5.5  # of the wing, from the middle of the fuselage
TOP, BELOW, AFT = 0, 1, 2  # of the wing's control points


def bezier(points):
    """Return the Bezier patch of a control net (p + 1, q + 1, 3)."""
    points = np.asarray(points, dtype=float)
    degrees = points.shape[0] - 1, points.shape[1] - 1
    knots = tuple(np.repeat([0.0, 1.0], degree + 1) for degree in degrees)
    return cqblend.Surface.from_bspline(degrees, knots, points)


def ground():
    """Return the paper's surface 2, figure 4b: a gently curved patch with 4 x 5 control points."""
    x, y = np.meshgrid(np.linspace(-6, 6, 4), np.linspace(-6, 6, 5), indexing="ij")
    return bezier(np.stack([x, y, 0.6 * np.cos(x / 3) + 0.3 * np.sin(y / 2)], axis=-1))


def tower():
    """Return the paper's surface 1, figure 4a: half a tube with 4 x 5 control points that stands on the other one."""
    angle = np.linspace(-0.3, np.pi + 0.3, 5)
    rows = [
        ((2.6 - 0.12 * z) * np.cos(angle), (3.2 - 0.12 * z) * np.sin(angle) - 2, np.full(5, z)) for z in (-3, 0, 3, 6)
    ]
    return bezier(np.moveaxis(rows, 1, 2))


def closed_rows(polygon, degree=3):
    """Return knots and control points of the closed uniform B-spline of a polygon (n, ..), clamped at its seam."""
    polygon = np.asarray(polygon, dtype=float)
    n = len(polygon)
    flat = np.concatenate([polygon, polygon[:degree]]).reshape(n + degree, -1)
    curve = cqblend.Curve.from_bspline(degree, np.arange(-degree, n + degree + 1) / n, flat)
    _, knots, poles, _ = curve.to_bspline()
    return knots, poles.reshape(len(poles), *polygon.shape[1:])


def fuselage():
    """Return a body of revolution, more or less, along x: u around it, v along."""
    angle = np.arange(12) * np.pi / 6
    x = np.array([-6, -4, -1.5, 1.5, 4, 6.0])
    radius = np.array([0.7, 1.15, 1.35, 1.35, 1.15, 0.7]) * 1.05
    circle = np.stack([np.zeros(12), np.cos(angle), np.sin(angle)], axis=-1)
    net = radius[None, :, None] * circle[:, None] + x[None, :, None] * np.array([1.0, 0, 0])
    knots, poles = closed_rows(net)
    return cqblend.Surface.from_bspline((3, 3), (knots, [0, 0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1, 1]), poles)


AIRFOIL = {  # control polygon in x and z, from below the wing over its nose to its top and its trailing edge
    BELOW: [(0.2, -0.23), (-0.3, -0.25), (-0.8, -0.24), (-1.25, -0.18), (-1.5, -0.05), (-1.5, 0.09)],
    TOP: [(-1.25, 0.27), (-0.8, 0.38), (-0.3, 0.42), (0.2, 0.4), (0.7, 0.32), (1.15, 0.2)],
    AFT: [(1.5, 0.06), (1.5, -0.1), (1.15, -0.16)],
}


def wing():
    """Return a wing along y, u around it from below, v outwards, and which part each of its control points is of."""
    parts = [*AIRFOIL.items(), (BELOW, [(0.7, -0.2)])]
    polygon = np.array([point for _, points in parts for point in points])
    net = np.stack([np.insert(polygon, 1, 0.0, axis=1), np.insert(0.8 * polygon, 1, SPAN, axis=1)], axis=1)
    knots, poles = closed_rows(net)
    part = [which for which, points in parts for _ in points]
    part = [BELOW, BELOW, *part[2:], BELOW, BELOW, BELOW]
    return cqblend.Surface.from_bspline((3, 1), (knots, [0, 0, 1, 1]), poles), part


def closed_solid(surface):
    """Return the solid of a surface that closes in u, with flat ends."""
    side = cq.Face(cqblend.to_face(surface))
    rims = [edge for edge in side.Edges() if edge.IsClosed()]
    return cq.Solid.makeSolid(
        cq.Shell.makeShell([side, *(cq.Face.makeFromWires(cq.Wire.assembleEdges([rim])) for rim in rims)])
    )


def aircraft():
    """Return fuselage and wing as one solid, and the edge in which they meet."""
    body = closed_solid(fuselage()).fuse(closed_solid(wing()[0]))
    return body, [edge for edge in body.Edges() if edge.IsClosed() and 0.5 < edge.Center().y < 2]


def fairing(a=0.3, b=0.45, lam=0.0, **options):
    """Return the fairing of figure 6: elliptic below, none on top, forked aft, and its two families."""
    conic = cqblend.Conic(a, b, lam)
    fork = cqblend.BezierRelation([(a, 0), (0.55 * a, 0), (0.5 * a, 0.9 * b), (0, 0.1 * b), (0, b)])
    functions = {BELOW: None, TOP: 0.0, AFT: lambda s: fork.second(conic.first(s))}
    surface, part = wing()
    body = cqblend.reshape(fuselage(), reference=(0, 0, 0))
    shaped = cqblend.reshape(surface, by="normal", amounts=[[functions[which]] * 2 for which in part])
    return cqblend.potential_blend(body, shaped, conic, near=(0, 1.5, 0), **options)
