"""Pictures: what is drawn is the shape, and what cannot be drawn says so."""

import cadquery as cq
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from cqblend.picture import ShadedFaces, View, draw_views

RADIUS = 3.0
BALL = cq.Solid.makeSphere(RADIUS, angleDegrees1=-90)


def view(colour, **options):
    return View([ShadedFaces(BALL.Faces(), colour)], (0, -1, 0), (0, 0, 0), 4 * RADIUS, **options)


def pixels(path):
    from vtkmodules.vtkIOImage import vtkPNGReader

    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3).astype(int)


def test_meshes_have_the_normals_of_the_surface():
    (mesh,) = ShadedFaces(BALL.Faces(), None).meshes
    points, normals = (vtk_to_numpy(data) for data in (mesh.GetPoints().GetData(), mesh.GetPointData().GetNormals()))
    corners = np.unique(vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()))
    np.testing.assert_allclose(normals[corners], points[corners] / RADIUS, atol=1e-6)  # in single precision


def test_views_fill_their_windows(tmp_path):
    """A red ball to the left and a blue one to the right, each a disc of half the height of the picture."""
    path = tmp_path / "balls.png"
    halves = ((0.0, 0.0, 0.5, 1.0), (0.5, 0.0, 1.0, 1.0))
    draw_views([view(c, window=w) for c, w in zip(((1, 0, 0), (0, 0, 1)), halves, strict=True)], path, size=(200, 100))
    image = pixels(path)
    assert image.shape == (100, 200, 3)
    red, blue = ((image[..., c] > image[..., 2 - c] + 30) for c in (0, 2))
    for disc in (red[:, :100], blue[:, 100:]):
        assert disc.sum() == pytest.approx(np.pi * 25**2, rel=0.05)
    assert not red[:, 100:].any()
    assert not blue[:, :100].any()


def test_a_zebra_has_stripes(tmp_path):
    path = tmp_path / "zebra.png"
    draw_views([view(None)], path, size=(200, 200))
    column = pixels(path)[60:140, 100].sum(axis=1)
    assert np.count_nonzero(np.diff(column > 383)) >= 6


def test_a_file_that_cannot_be_written(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        draw_views([view((1, 0, 0))], tmp_path / "nowhere" / "ball.png", size=(20, 20))
