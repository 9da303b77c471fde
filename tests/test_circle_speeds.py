"""Figure 1 of Kim and Elber: the example that makes it, and the strokes and dots that draw it."""

import runpy

import numpy as np
from places import EXAMPLES
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOImage import vtkPNGReader

from cqblend.picture import PointMarkers, Polylines, View, draw_views

EXAMPLE = EXAMPLES / "circle_speeds.py"


def test_the_circle_at_three_speeds(capsys):
    shown = []
    made = runpy.run_path(str(EXAMPLE), {"show_object": lambda shape, name: shown.append(name)})
    plain, slow, both = made["motions"].values()
    r = np.linspace(0, 1, 501)
    for motion, t in ((plain, r), (slow, 2 * r**2 - r**3), (both, r**2 * (3 - 2 * r))):
        np.testing.assert_allclose(motion(r), plain(t), rtol=0, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(motion(r), axis=1), 1, rtol=1e-15 * 4)
    speeds = [np.linalg.norm(motion([0.0, 1.0], 1), axis=1) for motion in (plain, slow, both)]
    full = 4 * np.sqrt(2)
    np.testing.assert_allclose(speeds, [[full, full], [0, full], [0, 0]], rtol=0, atol=1e-13)
    assert capsys.readouterr().out.count("off the circle") == 3
    assert shown == ["equal steps of time"]


def test_strokes_and_dots_are_where_they_should_be(tmp_path):
    """A red square of strokes through all but the border, and a blue dot of 21 pixels in its middle."""
    path = tmp_path / "square.png"
    square = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (-1, 0, -1)], dtype=float)
    drawn = [Polylines([square[:3], square[2:]], (1, 0, 0), 3), PointMarkers(np.zeros((1, 3)), (0, 0, 1), 21)]
    draw_views([View(drawn, (0, -1, 0), (0, 0, 0), 4)], path, size=(100, 100))
    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(100, 100, 3).astype(int)
    red, blue = ((image[..., c] > image[..., 2 - c] + 100) for c in (0, 2))
    rows, columns = np.nonzero(red)
    for ends in (rows, columns):
        assert abs(ends.min() - 24) <= 1
        assert abs(ends.max() - 75) <= 1
    assert not red[30:70, 30:70].any()
    assert 4 * 50 * 2 <= red.sum() <= 4 * 50 * 4
    assert abs(blue.sum() - np.pi * 10.5**2) < 60
    assert blue[50, 50]
