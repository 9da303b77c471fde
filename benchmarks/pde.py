"""How fast PDE blends are solved, and how fast they converge.

Run ``python -m benchmarks.pde`` from the project's folder. First the time to solve an equation of order 4 with 8 waves
and 12 terms (asked: 20 ms), and of whole blends, against the Hermite blend of the same ribbons. Then the largest error
in position of one wave of amplitude 1, by order and by j |root|, over the number of terms, against the closed form in
100 digits. ``--picture FILE`` draws the latter.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import cadquery as cq
import mpmath
import numpy as np

import cqblend
from benchmarks.timing import measure_cpu

TERMS = range(1, 37)
STEEPNESS = (1, 4, 8, 16)  # j |root|
SHARES = np.linspace(0, 1, 33)


def main() -> None:
    parser = argparse.ArgumentParser(description="Solve and measure PDE blends.")
    parser.add_argument("--picture", type=Path, help="PNG of the convergence")
    options = parser.parse_args()
    speed()
    curves = {(order, j): convergence(order, j) for order in (2, 4, 6) for j in STEEPNESS}
    shown = (1, 2, 4, 6, 8, 10, 12, 16, 20, 26, 32)
    print(f"\n{'order':>5s}{'j |root|':>10s}  terms" + "".join(f"{n:8d}" for n in shown))
    for (order, j), errors in curves.items():
        print(f"{order:5d}{j:10d}       " + "".join(f"{errors[n - 1]:8.0e}" for n in shown))
    if options.picture:
        draw(curves, options.picture)


def ring(radius: float, height: float, slope: float, waves: int) -> cqblend.Boundary:
    """Return a closed side made of the first so many waves, at a height, with first derivatives along z."""
    numbers = np.arange(1, waves + 1)

    def point(t: np.ndarray) -> np.ndarray:
        bumps = (np.cos(np.multiply.outer(t, numbers)) / 4.0**numbers).sum(axis=-1)
        return np.stack([(radius + bumps) * np.cos(t), (radius + bumps) * np.sin(t), height + bumps], axis=-1)

    return cqblend.Boundary(point, (0.0, 0.0, slope))


def sheet(height: float) -> cqblend.Boundary:
    """Return an open side, a wave moved by a height in y and z, that rises across."""
    return cqblend.Boundary(
        (lambda t: t, lambda t: 0.3 * np.sin(3 * t) + height, height),
        first=(0, lambda t: 0.2 * np.cos(2 * t), 1),
        domain=(0, 1),
    )


def speed() -> None:
    """Print times: of the solution alone, and of whole blends."""
    from cqblend.blends.pde.pde_settings import PdeSettings, SideSetup

    sides = ring(2, 0, 3, 6), ring(1.4, 2, 2, 6)
    problem = PdeSettings((4, 4, 4), (1.0, 2.0, 1.0), terms=12, modes=8)
    ribbons = sides[0].ribbon(1, 0, sides[1]), sides[1].ribbon(1, 1, sides[0])
    task = problem.pose_boundary_problem(ribbons, SideSetup(closed=True, by_length=False), accuracy=1e-8)
    print(f"order 4, 8 waves, 12 terms: solved in {measure_cpu(partial(task.solve, 12)):.1f} ms")
    blend = cqblend.pde_blend(*sides, terms=12, modes=8)
    straight = cqblend.Combination(cqblend.Curve.bezier([(0, 1), (0, 1)], domain=blend.surface.domain[0]))
    rails = [side.rail(number) for number, side in enumerate(sides, 1)]
    peer = measure_cpu(partial(cqblend.hermite_blend, *rails, tangents=straight, length="field", form="exact"))
    own = measure_cpu(partial(cqblend.pde_blend, *sides, terms=12, modes=8, form="exact"))
    print(f"the whole blend: {own:.0f} ms, {own / peer:.1f} times the Hermite blend of the same data")
    closed = measure_cpu(partial(cqblend.pde_blend, *sides))
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7):
        make = partial(cqblend.pde_blend, sheet(0.0), sheet(1.0), tolerance=tolerance)
        found, own = make().solution, measure_cpu(make)
        print(
            f"open sides, tolerance {tolerance:g}: {own:.0f} ms, {own / closed:.1f} times the closed ones; "
            f"{found.terms} terms x {found.basis.count} functions, change {found.change:.1e} mm"
        )
    body = cq.Workplane().sphere(10).union(cq.Workplane().cylinder(40, 4.5))
    edge = body.edges(cq.NearestToPointSelector((0, 9, 9)))
    for order, continuity in ((4, "G1"), (6, "G2")):
        peer = measure_cpu(partial(cqblend.blend_edges, body, edge, 2, continuity=continuity))
        own = measure_cpu(partial(cqblend.blend_edges, body, edge, 2, section="pde", order=order))
        print(f"in a solid, order {order}: {own:.0f} ms, {own / peer:.2f} times the Hermite blend")


def convergence(order: int, j: int) -> list[float]:
    """Return the largest error in position by the number of terms, for Laplace's operator and its powers."""
    half = order // 2
    first, last = [1.0, 0.5, -0.3][:half], [-0.4, 0.7, 0.2][:half]
    exact = closed_form(half, j, first, last)
    sides = [
        cqblend.Boundary(*[(np.cos, np.sin, lambda t, a=amount: a * np.cos(j * t)) for amount in amounts])
        for amounts in (first, last)
    ]
    errors = []
    for terms in TERMS:
        blend = cqblend.pde_blend(*sides, order=order, parameters=1.0, terms=terms, modes=j, tolerance=1e-3)
        errors.append(float(np.abs(blend.solution(0.0, SHARES)[:, 2] - exact).max()))
    return errors


def closed_form(half: int, j: int, first: list[float], last: list[float]) -> np.ndarray:
    """Return the solution of (d^2/dv^2 - j^2)^half f = 0 with given derivatives at 0 and 1, from v^p e^(+-j v)."""
    mpmath.mp.dps = 100
    terms = [(sign * j, p) for sign in (1, -1) for p in range(half)]

    def value(v: float, k: int, rate: int, power: int) -> mpmath.mpf:
        at = mpmath.mpf(v)
        return mpmath.exp(rate * at) * sum(
            mpmath.binomial(k, i) * mpmath.ff(power, i) * at ** (power - i) * mpmath.mpf(rate) ** (k - i)
            for i in range(min(k, power) + 1)
        )

    matrix = mpmath.matrix([[value(v, k, *term) for term in terms] for v in (0, 1) for k in range(half)])
    found = mpmath.lu_solve(matrix, mpmath.matrix([*first, *last]))
    return np.array([float(sum(c * value(v, 0, *term) for c, term in zip(found, terms, strict=True))) for v in SHARES])


def draw(curves: dict[tuple[int, int], list[float]], path: Path) -> None:
    """Draw the errors over the number of terms, one chart an order."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkChartsCore import vtkAxis, vtkChart, vtkChartXY
    from vtkmodules.vtkCommonDataModel import vtkRectf, vtkTable
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter
    from vtkmodules.vtkViewsContext2D import vtkContextView

    view = vtkContextView()
    window = view.GetRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(900, 330)
    colours = {1: (40, 40, 50), 4: (60, 110, 170), 8: (190, 110, 40), 16: (170, 40, 60)}
    for i, order in enumerate((2, 4, 6)):
        chart = vtkChartXY()
        view.GetScene().AddItem(chart)
        chart.SetAutoSize(False)
        chart.SetSize(vtkRectf(300 * i, 0, 300, 330))
        chart.SetTitle(f"order {order}")
        bottom, left = chart.GetAxis(vtkAxis.BOTTOM), chart.GetAxis(vtkAxis.LEFT)
        bottom.SetTitle("terms")
        left.SetTitle("error, log10" if i == 0 else "")
        for axis, low, high in ((bottom, 0, TERMS[-1]), (left, -16, 0)):
            axis.SetBehavior(vtkAxis.FIXED)
            axis.SetRange(low, high)
        for j in STEEPNESS:
            table = vtkTable()
            for name, values in (("terms", np.array(TERMS, float)), (f"j rho = {j}", np.log10(curves[order, j]))):
                column = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
                column.SetName(name)
                table.AddColumn(column)
            line = chart.AddPlot(vtkChart.LINE)
            line.SetInputData(table, 0, 1)
            line.SetColor(*colours[j], 255)
            line.SetWidth(2.0)
        chart.SetShowLegend(i == 2)
    window.Render()
    image = vtkWindowToImageFilter()
    image.SetInput(window)
    image.SetInputBufferTypeToRGB()
    writer = vtkPNGWriter()
    writer.SetCompressionLevel(9)
    writer.SetFileName(str(path))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main()
