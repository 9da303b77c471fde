"""Draw the pictures of the documentation, from the demo and the examples: ``python docs/draw.py``."""

import runpy
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import cadquery as cq
import numpy as np

import cqblend
from cqblend import demo, picture, teapot
from cqblend.picture import PointMarkers, Polylines, ShadedFaces, View

DOCS = Path(__file__).resolve().parent
PICTURES, EXAMPLES = DOCS / "pictures", DOCS.parent / "examples"

# Rows of (example, zebra or not, direction of view, what is in the middle, height of the view in mm).
GALLERY = (
    (
        ("boss_on_sphere", False, (0.9, -1, 0.55), (2, -2, 4), 28),
        ("boss_on_sphere", True, (0.9, -1, 0.55), (3.5, -3.5, 8), 12),
        ("block", False, (-1, -0.75, 0.8), (0, 0, 0), 34),
    ),
    (
        ("boss_on_dome", False, (0.9, -1, 0.8), (0, 0, 0), 45),
        ("boss_on_dome", True, (0.9, -1, 0.8), (1, -1, 3), 16),
        ("bracket", False, (1, -1.4, 0.9), (0, 0, 13), 56),
    ),
)

# Of examples that blend surfaces, each blend side by side: direction of view, what is in the middle, height of the
# view in mm, and size of the picture in pixels.
FIGURES = {
    "perpendicular_or_not": ((-0.55, 0.9, 0.75), (12, 4, 4), 27, (900, 380)),
    "varying_length": ((0.5, -1, 0.5), (1, 0, 6), 40, (700, 420)),
    "warped": ((0.7, -1, 1), (12, 0.5, 4), 24, (900, 400)),
    "two_magnitudes": ((0.5, -1, 0.45), (0, 0, 0), 32, (900, 300)),
}
SECTIONS = 25  # drawn across a blend


def parts(example: str, *, zebra: bool) -> list[ShadedFaces]:
    """Return what an example makes: all striped, or the blends in copper."""
    result = runpy.run_path(str(EXAMPLES / f"{example}.py"))["result"]
    faces = cq.Shape.cast(result.shape.wrapped).Faces()  # of whichever library
    if zebra:
        return [ShadedFaces(faces, None)]
    blends = [cq.Shape.cast(face.wrapped) for face in result.faces]
    if example in {"block", "bracket"}:  # where an earlier call blended another edge, and nothing else is a spline
        blends = [face for face in faces if face.geomType() == "BSPLINE"]
    others = [face for face in faces if not any(face.isSame(blend) for blend in blends)]
    return [ShadedFaces(others, demo.PORCELAIN), ShadedFaces(blends, demo.COPPER)]


def gallery() -> None:
    """Draw the examples side by side."""
    views = []
    for i, row in enumerate(reversed(GALLERY)):
        for j, (example, zebra, eye, focus, height) in enumerate(row):
            window = (j / len(row), i / len(GALLERY), (j + 1) / len(row), (i + 1) / len(GALLERY))
            views.append(View(parts(example, zebra=zebra), eye, focus, height, window))
    picture.draw_views(views, PICTURES / "gallery.png", size=(900, 560))


def whole_teapot() -> None:
    """Draw what ``cqblend demo`` draws."""
    pot = demo.sharp()
    demo.draw(pot, demo.blended(pot), PICTURES / "teapot.png")


def ends() -> None:
    """Draw how blends of open edges end: on a flush wall, on tangent sides, around a rib, and flat."""
    results = runpy.run_path(str(EXAMPLES / "ends.py"))["results"]
    looks = (
        ((1, 0.9, 0.8), (13, 8, 16), 26),
        ((0.4, 1.3, 0.7), (34, 6, 11), 28),
        ((1, 1, 0.7), (12.5, 9, 9), 21),
        ((-0.9, -1, 0.8), (-9, -9, 5), 20),
    )
    views, count = [], len(looks)
    for i, (result, (eye, focus, height)) in enumerate(zip(results.values(), looks, strict=True)):
        others = [face for face in result.shape.Faces() if not any(face.isSame(blend) for blend in result.faces)]
        drawn = [ShadedFaces(others, demo.PORCELAIN), ShadedFaces(result.faces, demo.COPPER)]
        views.append(View(drawn, eye, focus, height, (i / count, 0, (i + 1) / count, 1)))
    picture.draw_views(views, PICTURES / "ends.png", size=(1200, 320))


def varying_sizes() -> None:
    """Draw blends whose sizes vary, and below, striped, how smooth they are."""
    results = runpy.run_path(str(EXAMPLES / "varying_sizes.py"))["results"]
    looks = (
        ((0.9, 1, 0.8), (1, 2, 2), 42),
        ((1, -0.8, 0.7), (0, 0, 6), 34),
        ((0.8, -1, 0.9), (4, -3, 0), 46),
        ((0.7, -1, 1), (2, -2, 0), 36),
    )
    views = []
    for result, look in zip(results.values(), looks, strict=True):
        others = [face for face in result.shape.Faces() if not any(face.isSame(blend) for blend in result.faces)]
        views.append(([ShadedFaces(others, demo.PORCELAIN), ShadedFaces(result.faces, demo.COPPER)], *look))
    views += [
        ([ShadedFaces(one.shape.Faces(), None)], *look) for one, look in zip(results.values(), looks, strict=True)
    ]
    tiled(views, 4, "varying_sizes", 210)


def bridges() -> None:
    """Draw the bridges of the example."""
    results = runpy.run_path(str(EXAMPLES / "bridges.py"))["results"]
    looks = (
        ((0.5, -1, 0.45), (0, 0, 0), 38),
        ((0.6, -1, 0.7), (0, 0, 8), 50),
        ((-0.8, -1, 0.5), (-6, 2, 15), 40),
        ((0.7, -1, 0.4), (3, 0, 15), 40),
        ((0.5, -1, 0.6), (0, 0, 7), 34),
        ((0.5, -1, 0.6), (18, -12, 0), 46),
    )
    views = []
    for result, look in zip(results.values(), looks, strict=True):
        others = [face for face in result.shape.Faces() if not any(face.isSame(one) for one in result.faces)]
        views.append(([ShadedFaces(others, demo.PORCELAIN), ShadedFaces(result.faces, demo.COPPER)], *look))
    tiled(views, 3, "bridges", 250)


def full_round() -> None:
    """Draw a slab with a narrow front face, without one, and striped, and the rim of a ring without a face between."""
    slab, ring = cq.Workplane().box(30, 24, 10), cq.Workplane().circle(14).circle(8).extrude(6)
    edges, rims = slab.edges("|Y and >X").vals(), ring.edges(cq.selectors.RadiusNthSelector(1)).vals()
    cases = ((slab, edges, 4, False), (slab, edges, 5, False), (slab, edges, 5, True), (ring, rims, 3, False))
    views = []
    for i, (body, picked, radius, striped) in enumerate(cases):
        result = cqblend.blend_edges(body, picked, radius)
        others = [face for face in result.shape.Faces() if not any(face.isSame(blend) for blend in result.faces)]
        drawn = [ShadedFaces(others, demo.PORCELAIN), ShadedFaces(result.faces, demo.COPPER)]
        if striped:
            drawn = [ShadedFaces(result.shape.Faces(), None)]
        focus, height = ((0, 0, 3), 30) if body is ring else ((6, -2, 0), 26)
        views.append(View(drawn, (1, -0.9, 0.6), focus, height, (i / 4, 0, (i + 1) / 4, 1)))
    picture.draw_views(views, PICTURES / "full_round.png", size=(1000, 270))


def draw_with_stripes(made: dict[str, Any], looks: dict[str, Any], name: str, size: tuple[int, int]) -> None:
    """Draw results side by side, with blends in copper, and below each, nearer by, with stripes.

    ``looks`` has for each from where, and the middle and the height (mm) of what is seen, whole and striped.
    """
    views = []
    for i, (result, (eye, *framings)) in enumerate((made[one], look) for one, look in looks.items()):
        others = [face for face in result.shape.Faces() if not any(face.isSame(blend) for blend in result.faces)]
        shaded = [ShadedFaces(others, demo.PORCELAIN), ShadedFaces(result.faces, demo.COPPER)]
        striped = [ShadedFaces(result.shape.Faces(), None)]
        left, right = i / len(looks), (i + 1) / len(looks)
        for j, (drawn, (focus, height)) in enumerate(zip((shaded, striped), framings, strict=True)):
            views.append(View(drawn, eye, focus, height, (left, (1 - j) / 2, right, (2 - j) / 2)))
    picture.draw_views(views, PICTURES / f"{name}.png", size=size)


def chains() -> None:
    """Draw the rim of a prism with lines, a spline and an arc, that of a sheared one, and a blend that runs out."""
    made = runpy.run_path(str(EXAMPLES / "chains.py"))["results"]
    looks = {
        "outline": ((0.6, -1, 1.1), ((1, 0, 8), 36), ((10, -4, 9), 14)),
        "sheared": ((0.7, -1, 0.9), ((3, 0, 5), 34), ((16, -6, 9), 11)),
        "window": ((0.55, 1, 0.45), ((0, 17, 20), 27), ((3, 19, 26), 13)),
    }
    draw_with_stripes(made, looks, "chains", (900, 560))


def corners() -> None:
    """Draw whole selections of edges that meet in corners, and below, striped, a corner of each."""
    made = runpy.run_path(str(EXAMPLES / "corners.py"))["results"]
    looks = {
        "angle": ((0.8, -1, 0.9), ((12, 11, 8), 38), ((22, 3, 12), 13)),
        "outline": ((1, -0.7, 0.9), ((12, 12, 4), 34), ((20, 12, 8), 14)),
        "block": ((0.8, -1, 0.8), ((0, 0, 0), 32), ((11, -7, 5), 11)),
        "tower": ((0.7, -1, 0.9), ((0, 0, 5), 50), ((3, -7, 6), 17)),
    }
    draw_with_stripes(made, looks, "corners", (1120, 560))


def circle_speeds() -> None:
    """Draw circles with markers at equal steps of the parameter, and below each its speed over the parameter."""
    made = runpy.run_path(str(EXAMPLES / "circle_speeds.py"))
    t = np.linspace(0, 1, 129)
    frame = np.array([(-1, 0, -1.4), (-1, 0, -2.4), (1, 0, -2.4)], dtype=float)
    views = []
    for i, motion in enumerate(made["motions"].values()):
        points, marks = (np.insert(motion(at), 1, 0, axis=1) for at in (t, made["steps"]))
        speed = np.linalg.norm(motion(t, 1), axis=1)
        profile = np.stack([2 * t - 1, 0 * t, speed / 10 - 2.4], axis=1)
        drawn = [
            Polylines([points], demo.COPPER, 2.5),
            PointMarkers(marks),
            Polylines([frame], width=1),
            Polylines([profile], demo.COPPER, 2.5),
        ]
        views.append(View(drawn, (0, -1, 0), (0, 0, -0.65), 3.9, (i / 3, 0, (i + 1) / 3, 1)))
    picture.draw_views(views, PICTURES / "circle_speeds.png", size=(900, 480))


def lines(blend: Any, eye: tuple[float, float, float], height: float) -> list[Polylines]:
    """Return the rails of a blend of surfaces, and sections across, a little in front of what is seen from there."""
    lift = 0.004 * height * np.array(eye)
    t, v = np.linspace(*blend.surface.domain[0], 16 * (SECTIONS - 1) + 1), np.linspace(0, 1, 65)
    points = blend.surface.grid(t, v) + lift
    return [Polylines([points[:, 0], points[:, -1]], width=2.5), Polylines(list(points[::16]), width=1)]


def figure(example: str) -> None:
    """Draw the blends of surfaces that an example makes, side by side."""
    made, (eye, focus, height, size) = runpy.run_path(str(EXAMPLES / f"{example}.py")), FIGURES[example]
    primaries = ShadedFaces([cq.Face(cqblend.to_face(one)) for one in made["primaries"]], demo.PORCELAIN)
    views, count = [], len(made["blends"])
    for i, blend in enumerate(made["blends"].values()):
        drawn = [primaries, ShadedFaces([cq.Face(blend.face())], demo.COPPER), *lines(blend, eye, height)]
        views.append(View(drawn, eye, focus, height, (i / count, 0, (i + 1) / count, 1)))
    picture.draw_views(views, PICTURES / f"{example}.png", size=size)


def tiled(views: Sequence[tuple[Sequence[Any], Any, Any, float]], columns: int, name: str, height: int) -> None:
    """Draw views (parts, direction, middle, height) in rows of so many, from the upper left."""
    rows = -(-len(views) // columns)
    placed = []
    for i, (drawn, eye, focus, tall) in enumerate(views):
        x, y = i % columns / columns, 1 - (i // columns + 1) / rows
        placed.append(View(drawn, eye, focus, tall, (x, y, x + 1 / columns, y + 1 / rows)))
    picture.draw_views(placed, PICTURES / f"{name}.png", size=(900, height * rows))


def panels(example: str, key: str, look: tuple[Any, Any, float], *, columns: int, height: int, zebra: bool) -> None:
    """Draw the blends that an example makes, side by side, with their primaries."""
    sys.path.insert(0, str(EXAMPLES))
    made = runpy.run_path(str(EXAMPLES / f"{example}.py"))
    primaries = [cq.Face(cqblend.to_face(one)) for one in made["primaries"]]
    eye, focus, tall = look
    views = []
    for blend in made[key].values():
        face = cq.Face(blend.face())
        shaded = [ShadedFaces(primaries, demo.PORCELAIN), ShadedFaces([face], demo.COPPER), *lines(blend, eye, tall)]
        views.append(([ShadedFaces([*primaries, face], None)] if zebra else shaded, eye, focus, tall))
    tiled(views, columns, example, height)


def spout() -> None:
    """Draw the teapot before, after and enlarged."""
    made = runpy.run_path(str(EXAMPLES / "teapot.py"))
    before, result = made["pot"], made["result"]
    blends = {face.hashCode() for face in result.faces}
    others = ShadedFaces([face for face in result.shape.Faces() if face.hashCode() not in blends], demo.PORCELAIN)
    after = [others, ShadedFaces(result.faces, demo.COPPER)]
    side, low = (0.35, -1.0, 0.45), (0.55, -1.0, 0.35)
    views = [
        View([ShadedFaces(before.Faces(), demo.PORCELAIN)], side, (0.6, 0, 1.2), 4.9, (0, 0, 0.38, 1)),
        View(after, side, (0.6, 0, 1.2), 4.9, (0.38, 0, 0.76, 1)),
        View(after, low, (1.95, 0, 1.1), 1.75, (0.76, 0, 1, 1)),
    ]
    picture.draw_views(views, PICTURES / "spout.png", size=(900, 300))


def zebras(sides: Sequence[Sequence[cq.Face]], name: str, eye: Any, focus: Any, height: float) -> None:
    """Draw the zebras of two groups of faces, side by side, meshed so finely that stripes bend where the faces do."""
    views = [
        View([ShadedFaces(faces, None)], eye, focus, height, (0.505 * i, 0, 0.495 + 0.505 * i, 1))
        for i, faces in enumerate(sides)
    ]
    with mock.patch.multiple(picture, DEVIATION=1e-5, ANGLE=0.03):
        picture.draw_views(views, PICTURES / f"{name}.png", size=(900, 400))


def steering() -> None:
    """Draw where the rail on the teapot crosses the jump of the body's curvature: without steering and with it."""
    pot = demo.sharp()
    body = cq.Face(cqblend.to_face(teapot.surface(teapot.BODY).clip(u=(1.5, 2.5))))
    sides = []
    for options in ({"steer": 0, "crease": 0.02}, {}):
        result = cqblend.blend_edges(pot, demo.joint(pot), width=demo.WIDTH, form="exact", **options)
        blend = cqblend.to_surface(result.faces[0])
        t = np.linspace(*blend.domain[0], 2001)
        _, y, z = blend.grid(t, [0])[:, 0].T
        t = t[(y < 0) & (abs(z - 0.9) < 0.085)]
        sides.append([body, cq.Face(cqblend.to_face(blend.clip(u=(t.min(), t.max()))))])
    zebras(sides, "steering", (0.3, -1, -0.4), (1.955, -0.545, 0.915), 0.13)


def g1_g2() -> None:
    """Draw a boss on a ball whose blend has the normals of its neighbours, and one that has their curvatures too."""
    boss = cq.Solid.makeCylinder(4.5, 20, cq.Vector(0, 0, 0), cq.Vector(1, -0.15, 0.1))
    body = cq.Workplane().sphere(10).union(cq.Workplane(boss))
    ring = body.edges(cq.NearestToPointSelector((9, -4, 0)))
    sides = [cqblend.blend_edges(body, ring, 5, continuity=order).shape.Faces() for order in ("G1", "G2")]
    zebras(sides, "g1_g2", (0.6, -1, 0.3), (8.5, -5.5, 0.3), 7.5)


def fairing() -> None:
    """Draw the fairing of a wing on a fuselage: from below, from above, and its aft."""
    sys.path.insert(0, str(EXAMPLES))
    made = runpy.run_path(str(EXAMPLES / "potential_fairing.py"))
    faces, blend = made["result"].shape.Faces(), made["blend"]
    blends = [cq.Shape.cast(face.wrapped) for face in made["result"].faces]
    others = ShadedFaces([face for face in faces if not any(face.isSame(one) for one in blends)], demo.PORCELAIN)
    views = []
    for eye, focus, tall in (
        ((-0.9, 0.9, -0.75), (0, 1.6, 0), 6.5),
        ((0.3, 0.8, 1), (0, 1.6, 0), 6.5),
        ((1, 0.6, -0.3), (1.3, 1.4, 0), 2.6),
    ):
        views.append(([others, ShadedFaces(blends, demo.COPPER), *lines(blend, eye, tall)], eye, focus, tall))
    tiled(views, 3, "potential_fairing", 330)


def hybrid() -> None:
    """Draw the fairing of a parametric wing on an implicit fuselage: from below, and its nose."""
    sys.path.insert(0, str(EXAMPLES))
    made = runpy.run_path(str(EXAMPLES / "potential_hybrid.py"))
    blend, body = made["blend"], made["fuselage_face"]()
    wing = blend.rails[0].surface
    v = blend.rails[0].curve(np.linspace(*blend.rails[0].curve.domain, 501))[:, 1].max()
    shown = [body, cq.Face(cqblend.to_face(wing.clip(v=(float(v), wing.domain[1][1]))))]
    drawn = [ShadedFaces(shown, demo.PORCELAIN), ShadedFaces([cq.Face(blend.face())], demo.COPPER)]
    views = []
    for eye, focus, tall in (((-0.9, 0.9, -0.75), (0, 1.6, 0), 6.5), ((-1, 0.7, 0.3), (-1.2, 1.4, 0), 2.6)):
        views.append(([*drawn, *lines(blend, eye, tall)], eye, focus, tall))
    tiled(views, 2, "potential_hybrid", 330)


def potential_sections() -> None:
    """Draw sections of potential blends as lambda falls, and, thin, the Hermite sections with the same ends."""
    made = runpy.run_path(str(EXAMPLES / "potential_sections.py"))
    frame = np.array([(3.0, 0, 0), (0, 0, 0), (0, 0, 3.0)])
    drawn: list[Any] = [Polylines([frame], width=1)]
    for blend in made["by_lambda"].values():
        own, other = (np.insert(one, 1, 0, axis=1) for one in made["sections"](blend))
        drawn += [Polylines([other], width=1), Polylines([own], demo.COPPER, 3)]
    picture.draw_views(
        [View(drawn, (0, -1, 0), (1.1, 0, 1.1), 2.7, (0, 0, 1, 1))],
        PICTURES / "potential_sections.png",
        size=(420, 420),
    )


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    whole_teapot()
    gallery()
    circle_speeds()
    ends()
    full_round()
    varying_sizes()
    bridges()
    chains()
    corners()
    for name in FIGURES:
        figure(name)
    spout()
    steering()
    g1_g2()
    leaning, upright = ((0.5, -1, 0.25), (2, 0, -5), 27), ((0.5, -1, 0.35), (0, 0, -7), 27)
    panels("pde_cone_with_cylinder", "by_order", leaning, columns=3, height=330, zebra=True)
    panels("pde_hyperboloid_with_torus", "by_order", upright, columns=2, height=380, zebra=True)
    panels("pde_shape_parameters", "by_parameters", leaning, columns=3, height=330, zebra=False)
    tower = (0.5, 1, 0.6), (0, -1.5, 0.6), 10.5
    panels("potential_patches", "by_relation", tower, columns=3, height=300, zebra=False)
    panels("potential_controls", "by_control", tower, columns=3, height=300, zebra=False)
    fairing()
    hybrid()
    potential_sections()
