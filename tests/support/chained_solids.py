"""Bodies whose edges are chains, for tests of what chains are and of their blends."""

import cadquery as cq
import numpy as np

import cqblend

W, V = cq.Workplane, cq.Vector


def rounded_box() -> cq.Shape:
    return W().box(30, 20, 10).edges("|Z").fillet(3).val()


def slot() -> cq.Shape:
    return W().slot2D(30, 10).extrude(5).val()


def d_shape() -> cq.Shape:
    return W().moveTo(0, -6).lineTo(10, -6).threePointArc((16, 0), (10, 6)).lineTo(0, 6).close().extrude(7).val()


def spline_outline() -> cq.Shape:
    """Two parallel lines whose ends a spline joins tangentially, and a corner."""
    end = W().moveTo(0, 0).lineTo(20, 0)
    return (
        end.spline([(26, 6), (18, 12)], tangents=[(1, 0), (-1, 0)], includeCurrent=True)
        .lineTo(0, 12)
        .close()
        .extrude(6)
        .val()
    )


def tapered() -> cq.Shape:
    return W().sketch().rect(30, 20).vertices().fillet(4).finalize().extrude(12, taper=8).val()


def letters() -> cq.Shape:
    return W().text("BSR", 20, 5).combine().val()


def pocket() -> cq.Shape:
    return (
        W()
        .box(40, 30, 12)
        .faces(">Z")
        .workplane()
        .sketch()
        .rect(24, 16)
        .vertices()
        .fillet(4)
        .finalize()
        .cutBlind(-7)
        .val()
    )


def sheared_prism() -> cq.Shape:
    """A rounded box, sheared so that its smooth edges are oblique."""
    shear = cq.Matrix([[1, 0, 0.5, 0], [0, 1, 0.2, 0], [0, 0, 1, 0]])
    return rounded_box().transformGeometry(shear)


def chamfered() -> cq.Shape:
    """A rounded box whose top has a chamfer: two closed chains along it, of obtuse edges."""
    return W(rounded_box()).faces(">Z").edges().chamfer(1).val()


def rounded_by_blend() -> cq.Shape:
    """A box of which an upright was rounded before, by a spline face."""
    box = W().box(30, 20, 10)
    return cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), 3).shape


def fading_block() -> cq.Shape:
    """A block whose top is a plane for y < 0 and for y > 0 z = -x y / 40: they meet along y = 0, smoothly at x = 0."""
    top = [V(0, -10, 0), V(20, -10, 0), V(20, 0, 0), V(0, 0, 0), V(0, 10, 0), V(20, 10, -5)]
    floor = [V(0, -10, -20), V(20, -10, -20), V(20, 10, -20), V(0, 10, -20)]
    lines = cq.Edge.makeLine(top[3], top[2]), cq.Edge.makeLine(top[4], top[5])
    outlines = [
        top[:4],
        floor,
        [top[0], top[3], top[4], floor[3], floor[0]],
        [top[1], top[2], top[5], floor[2], floor[1]],
        [top[0], top[1], floor[1], floor[0]],
        [top[4], top[5], floor[2], floor[3]],
    ]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon(points, close=True)) for points in outlines]
    return cq.Solid.makeSolid(cq.Shell.makeShell([cq.Face.makeRuledSurface(*lines), *faces]))


def gently_fading_block(length: float = 20.0) -> cq.Shape:
    """The same with z = -x^2 y / 400: the angle along y = 0 has its slope 0, too, at x = 0."""
    poles = [[(0, 0, 0), (0, 10, 0)], [(length / 2, 0, 0), (length / 2, 10, 0)], [(length, 0, 0), (length, 10, -10)]]
    knots = ([0, 0, 0, 1, 1, 1], [0, 0, 1, 1])
    warped = cq.Face(cqblend.to_face(cqblend.Surface.from_bspline((2, 1), knots, np.array(poles, dtype=float))))
    top = [V(0, -10, 0), V(length, -10, 0), V(length, 0, 0), V(0, 0, 0), V(0, 10, 0), V(length, 10, -10)]
    floor = [V(0, -10, -20), V(length, -10, -20), V(length, 10, -20), V(0, 10, -20)]
    outlines = [
        top[:4],
        floor,
        [top[0], top[3], top[4], floor[3], floor[0]],
        [top[1], top[2], top[5], floor[2], floor[1]],
        [top[0], top[1], floor[1], floor[0]],
    ]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon(points, close=True)) for points in outlines]
    arc = next(edge for edge in warped.Edges() if edge.Center().y > 9)
    wall = [cq.Edge.makeLine(a, b) for a, b in ((top[4], floor[3]), (floor[3], floor[2]), (floor[2], top[5]))]
    back = cq.Face.makeFromWires(cq.Wire.assembleEdges([arc, *wall]))
    return cq.Solid.makeSolid(cq.Shell.makeShell([warped, *faces, back]))
