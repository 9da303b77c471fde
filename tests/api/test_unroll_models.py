"""The paper's models: valid and closed, with the faces they promise and nothing too small to cut, always the same."""

import io
import runpy
from collections import Counter
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import comb, pi

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from places import EXAMPLES

SCRIPT = str(EXAMPLES / "unroll_models.py")
MODULE = runpy.run_path(SCRIPT)

# Kinds of faces, and the largest extent in mm.
MODELS = {
    "tube": ({"BSPLINE": 1, "PLANE": 2}, (150, 200)),
    "sphere": ({"SPHERE": 1}, (150, 150)),
    "cone_with_cylinder": ({"CONE": 1, "CYLINDER": 2, "PLANE": 3}, (200, 200)),
    "pawn": ({"REVOLUTION": 4, "CONE": 2, "CYLINDER": 1, "PLANE": 1}, (144, 144)),
    "teapot": ({"BSPLINE": 7, "PLANE": 2}, (250, 260)),
    "helicopter": ({"BSPLINE": 22, "PLANE": 22, "TORUS": 6, "CYLINDER": 5, "CONE": 1}, (270, 275)),
    "fighter": ({"BSPLINE": 23, "PLANE": 13, "REVOLUTION": 3, "CYLINDER": 2, "CONE": 1}, (245, 250)),
}

every_model = pytest.mark.parametrize("name", MODELS)


def written(shape):
    stream = io.BytesIO()
    shape.exportBrep(stream)
    return stream.getvalue()


@cache
def made(name):
    """A model, and its file before anything adds meshes to it."""
    solid = MODULE[name]()
    return solid, written(solid)


def model(name):
    return made(name)[0]


def mesh_volume(shape):
    """Of the tetrahedra between the origin and a fine mesh: has the sign of the orientation."""
    vertices, triangles = shape.copy().tessellate(0.1, 0.12)  # of a copy: a shape keeps its mesh, and measures with it
    a, b, c = np.array([vertex.toTuple() for vertex in vertices])[np.array(triangles)].swapaxes(0, 1)
    return np.einsum("ij,ij", a, np.cross(b, c)) / 6


@pytest.mark.slow
@every_model
def test_one_valid_closed_solid(name):
    solid = model(name)
    assert isinstance(solid, cq.Solid)
    assert BRepCheck_Analyzer(solid.wrapped, True, False, True).IsValid()
    (shell,) = solid.Shells()
    assert shell.wrapped.Closed()
    uses = Counter(edge.hashCode() for face in solid.Faces() for wire in face.Wires() for edge in wire)
    assert all(uses[edge.hashCode()] == 2 for edge in solid.Edges())
    assert solid.Volume() == pytest.approx(mesh_volume(solid), rel=1e-2)


@every_model
def test_faces_and_size(name):
    kinds, (least, most) = MODELS[name]
    assert Counter(face.geomType() for face in model(name).Faces()) == kinds
    box = model(name).BoundingBox(1e-6)
    assert least - 0.5 <= max(box.xlen, box.ylen, box.zlen) <= most + 0.5


@every_model
def test_nothing_too_small(name):
    solid = model(name)
    assert min(face.Area() for face in solid.Faces()) > 1e-6 * solid.Area()
    assert min(edge.Length() for edge in solid.Edges()) > 0.5
    tolerances = [BRep_Tool.Tolerance_s(part.wrapped) for part in (*solid.Edges(), *solid.Vertices())]
    assert max(tolerances) < 2e-5


@every_model
def test_survives_step(name, tmp_path):
    solid = model(name)
    path = str(tmp_path / "model.step")
    cq.exporters.export(cq.Workplane(solid), path)
    back = cq.importers.importStep(path).val()
    assert back.isValid()
    assert Counter(face.geomType() for face in back.Faces()) == Counter(face.geomType() for face in solid.Faces())
    assert back.Volume() == pytest.approx(solid.Volume(), rel=1e-5)
    assert back.Area() == pytest.approx(solid.Area(), rel=1e-5)


@pytest.mark.parametrize("name", ["teapot", "helicopter", "fighter"])
def test_trimmed_faces(name):
    """A freeform face at least has holes."""
    assert any(face.innerWires() for face in model(name).Faces() if face.geomType() == "BSPLINE")


@pytest.mark.parametrize("name", ["tube", "teapot", "fighter"])
def test_symmetric(name):
    """But for the helicopter, whose tail rotor is on one side: mirrored edges lie on the shape."""
    (shell,) = model(name).Shells()
    for x, y, z in (edge.positionAt(0.37).toTuple() for edge in shell.Edges()):
        assert cq.Vertex.makeVertex(x, -y, z).distance(shell) < 1e-5


def test_the_pawn_is_its_meridian():
    """Its volume is pi times the integral of r^2 dz over the Bezier curves, here in fractions."""
    total = Fraction(0)
    for curve in MODULE["PAWN"]:
        r, z = ([Fraction(value) for value in values] for values in zip(*curve, strict=True))
        n = len(r) - 1
        for i, j, k in np.ndindex(n + 1, n + 1, n):
            product = Fraction(comb(n, i) * comb(n, j) * comb(n - 1, k), comb(3 * n - 1, i + j + k)) / (3 * n)
            total += product * r[i] * r[j] * n * (z[k + 1] - z[k])
    assert model("pawn").Volume() == pytest.approx(pi * float(total), rel=1e-6)


def test_shown_side_by_side_and_always_the_same():
    """As in CQ-editor, which gives ``show_object``: to the last bit what another run makes, but for the place."""
    shown = {}
    runpy.run_path(SCRIPT, {"show_object": lambda shape, name: shown.update({name: shape})})
    assert list(shown) == list(MODELS)
    assert all(written(shape.located(cq.Location())) == made(name)[1] for name, shape in shown.items())
    boxes = [shape.BoundingBox() for shape in shown.values()]
    assert all(low.ymax < high.ymin for low, high in pairwise(boxes))


def test_hulls_have_the_rings_they_are_given():
    """Rings of equal poles make a cylinder, elliptic to 0.2 %, which is as near as eight poles come."""
    net = MODULE["rings"]([(x, 1.0, 5.0, 7.0, 7.0, 0.5**0.5) for x in (0.0, 1.0, 2.0, 3.0)])
    points = MODULE["skin"](net).grid(np.linspace(0, 8, 33), [0.0, 1.0])
    radius = np.hypot(points[..., 1] / 5, (points[..., 2] - 1) / 7)
    assert np.abs(radius - 1).max() < 2e-3
