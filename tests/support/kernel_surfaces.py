"""Primaries beside OCCT's surfaces of the same shape: the witness that blend tests ask, whatever cqblend computes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Dir, gp_Pnt, gp_Vec
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt
from OCP.TColStd import (
    TColStd_Array1OfInteger,
    TColStd_Array1OfReal,
    TColStd_Array2OfReal,
)

from cqblend.splines import Curve, Surface
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame

ORIGIN = np.array([3.0, -2.0, 5.0])
SIZE = 12.0
"""About the largest coordinate of any of the surfaces: what errors are relative to."""


@dataclass(frozen=True)
class Pair:
    """A primary, OCCT's surface, and a window ((u0, u1), (v0, v1)) of native parameters in which both are regular."""

    name: str
    primary: Primary
    kernel: Geom_Surface
    window: tuple[tuple[float, float], tuple[float, float]]

    def uv(self, x: np.ndarray) -> np.ndarray:
        """Map points (n, 2) of the unit square into the window."""
        low, high = np.transpose(self.window)
        return low + (high - low) * x

    def jet(self, uv: np.ndarray) -> np.ndarray:
        """Return OCCT's S, Su, Sv, Suu, Suv, Svv at (n, 2), as (6, n, 3)."""
        return np.array([_d2(self.kernel, u, v) for u, v in np.asarray(uv).tolist()]).swapaxes(0, 1)


def _d2(surface: Geom_Surface, u: float, v: float) -> list[tuple[float, float, float]]:
    p, su, sv, suu, svv, suv = gp_Pnt(), *(gp_Vec() for _ in range(5))
    surface.D2(u, v, p, su, sv, suu, svv, suv)
    return [x.Coord() for x in (p, su, sv, suu, suv, svv)]


def position(*, left_handed: bool) -> gp_Ax3:
    """Return a frame aligned with nothing."""
    placed = gp_Ax3(gp_Pnt(*ORIGIN.tolist()), gp_Dir(0.3, -0.5, 0.8), gp_Dir(0.7, 0.6, 0.1))
    if left_handed:
        placed.YReverse()
    return placed


def frame(placed: gp_Ax3) -> LocalFrame:
    """Return OCCT's frame as arrays."""
    axes = (placed.XDirection(), placed.YDirection(), placed.Direction())
    return LocalFrame(np.array(placed.Location().Coord()), np.array([axis.Coord() for axis in axes]))


def seeded_random(pair: Pair) -> np.random.Generator:
    """Return random numbers that are the same in every run, others for every pair."""
    return np.random.default_rng(sum(pair.name.encode()))


def sample_parameters(pair: Pair, n: int = 12) -> np.ndarray:
    """Native parameters in the window; on spheres with a free pole, away from its antipode."""
    uv = pair.uv(seeded_random(pair).uniform(size=(n, 2)))
    if isinstance(pair.primary, Sphere):
        n3 = (pair.jet(uv)[0] - pair.primary.frame.origin) / pair.primary.radius
        uv = uv[n3 @ pair.primary.pole > -0.9]
    return uv


def _split(knots: np.ndarray) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    """Return distinct knots and their multiplicities."""
    values, counts = np.unique(knots, return_counts=True)
    reals, integers = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
    for i, (value, count) in enumerate(zip(values.tolist(), counts.tolist(), strict=True), 1):
        reals.SetValue(i, value)
        integers.SetValue(i, count)
    return reals, integers


def kernel_curve(
    degree: int, knots: np.ndarray, poles: np.ndarray, weights: np.ndarray | None = None
) -> Geom_BSplineCurve:
    """Return a B-spline curve, pole by pole."""
    points, factors = TColgp_Array1OfPnt(1, len(poles)), TColStd_Array1OfReal(1, len(poles))
    for i, pole in enumerate(poles.tolist(), 1):
        points.SetValue(i, gp_Pnt(*pole))
        factors.SetValue(i, 1.0 if weights is None else float(weights[i - 1]))
    return Geom_BSplineCurve(points, factors, *_split(knots), degree)


def kernel_surface(
    degrees: tuple[int, int],
    knots: tuple[np.ndarray, np.ndarray],
    poles: np.ndarray,
    weights: np.ndarray | None = None,
) -> Geom_BSplineSurface:
    """Return a B-spline surface, pole by pole."""
    nu, nv = poles.shape[:2]
    points, factors = TColgp_Array2OfPnt(1, nu, 1, nv), TColStd_Array2OfReal(1, nu, 1, nv)
    for i, j in np.ndindex(nu, nv):
        points.SetValue(i + 1, j + 1, gp_Pnt(*poles[i, j].tolist()))
        factors.SetValue(i + 1, j + 1, 1.0 if weights is None else float(weights[i, j]))
    (ku, mu), (kv, mv) = (_split(k) for k in knots)
    return Geom_BSplineSurface(points, factors, ku, kv, mu, mv, *degrees)


def clamped(degree: int, inner: list[float]) -> np.ndarray:
    """Return a full knot vector over [0, 1]; repeat inner knots for less continuity."""
    return np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])


def wavy(
    degrees: tuple[int, int],
    inner: tuple[list[float], list[float]],
    *,
    rational: bool = False,
    closed: bool = False,
    seed: int = 5,
) -> Pair:
    """Make a random wavy spline, optionally a closed tube in u."""
    rng = np.random.default_rng(seed)
    knots = (clamped(degrees[0], inner[0]), clamped(degrees[1], inner[1]))
    counts = [len(k) - d - 1 for k, d in zip(knots, degrees, strict=True)]
    greville = [
        np.array([k[i + 1 : i + d + 1].mean() for i in range(n)])
        for k, d, n in zip(knots, degrees, counts, strict=True)
    ]
    u, v = np.meshgrid(*greville, indexing="ij")
    noise = rng.uniform(-0.3, 0.3, (*u.shape, 3))
    if closed:
        noise[-1] = noise[0]
        poles = np.stack([4 * np.cos(2 * np.pi * u), 4 * np.sin(2 * np.pi * u), 9 * v], -1) + noise
    else:
        poles = np.stack([10 * u, 10 * v, np.sin(5 * u + 3 * v)], -1) + noise
    weights = rng.uniform(0.6, 1.6, u.shape) if rational else None
    if closed and weights is not None:
        weights[-1] = weights[0]
    surface = Surface.from_bspline(degrees, knots, poles, weights)
    name = " ".join(["closed"] * closed + ["rational"] * rational + [f"spline {degrees[0]} x {degrees[1]}"])
    window = ((0.02, 0.98), (0.02, 0.98))
    return Pair(
        name,
        TensorSurface.from_spline(surface, (closed, False)),
        kernel_surface(degrees, knots, poles, weights),
        window,
    )


def _revolution(*, rational: bool) -> Pair:
    placed = position(left_handed=False)
    local = np.array([[4.0, 0, 0], [6, 0, 1], [3, 0, 3], [5, 0.5, 5], [7, 0, 6], [4, 0, 8]])
    weights = np.array([1.0, 1.4, 0.8, 1.2, 0.7, 1.1]) if rational else None
    knots = clamped(3, [0.3, 0.6])
    where = frame(placed)
    basis = kernel_curve(3, knots, local @ where.axes + where.origin, weights)
    kernel = Geom_SurfaceOfRevolution(basis, gp_Ax1(placed.Location(), placed.Direction()))
    profile = Curve.from_bspline(3, knots, local, weights)
    name = "revolved rational spline" if rational else "revolved spline"
    return Pair(name, RevolvedSpline.from_profile(where, profile), kernel, ((-3.0, 8.0), (0.01, 0.99)))


def _swept_ellipses() -> list[Pair]:
    """An ellipse aligned with nothing, extruded obliquely and turned about an axis outside of it."""
    placed = position(left_handed=False)
    where = frame(placed)
    ellipse = Geom_Ellipse(gp_Ax2(placed.Location(), gp_Dir(0.2, 0.9, 0.4), gp_Dir(1, 0, 0)), 4.0, 2.0)
    local = ellipse.Position()
    a, b = 4 * np.array(local.XDirection().Coord()), 2 * np.array(local.YDirection().Coord())
    along = gp_Dir(0.1, 0.8, -0.3)
    slanted = Cylinder(LocalFrame(where.origin, np.array([a, b, along.Coord()])))
    apart = where.origin + np.array([7.0, 1.0, -6.0])
    axis = gp_Ax1(gp_Pnt(*apart.tolist()), gp_Dir(0.2, 1.0, 0.3))
    turned = frame(gp_Ax3(axis.Location(), axis.Direction()))
    rows = np.array([where.origin - apart, a, b]) @ turned.axes.T
    around = (-4.0, 7.0)
    return [
        Pair("extruded ellipse", slanted, Geom_SurfaceOfLinearExtrusion(ellipse, along), (around, (-8, 8))),
        Pair(
            "revolved ellipse",
            RevolvedEllipse.from_ellipse(turned, rows),
            Geom_SurfaceOfRevolution(ellipse, axis),
            (around, around),
        ),
    ]


def _nurbs_cylinder() -> Pair:
    """A cylinder as nine rational poles around: the weight has kinks, the surface has none."""
    h = math.sqrt(0.5)
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], float)
    poles = np.stack([np.column_stack([4 * ring, np.full(9, z)]) for z in (0.0, 9.0)], axis=1)
    weights = np.tile(np.array([1, h] * 4 + [1])[:, None], (1, 2))
    knots = (clamped(2, [0.25, 0.25, 0.5, 0.5, 0.75, 0.75]), clamped(1, []))
    primary = TensorSurface.from_spline(Surface.from_bspline((2, 1), knots, poles, weights), (True, False))
    window = ((0.02, 0.98), (0.02, 0.98))
    return Pair("NURBS cylinder, spline 2 x 1", primary, kernel_surface((2, 1), knots, poles, weights), window)


@cache
def pairs() -> dict[str, Pair]:
    """Return a primary of every kind, by name."""
    made = []
    for left_handed in (False, True):
        hand = ", left-handed" if left_handed else ""
        placed = position(left_handed=left_handed)
        where = frame(placed)
        around = (-4.0, 7.0)
        pole = where.axes.T @ (np.array([2.0, -1.0, 2.0]) / 3)
        made += [
            Pair(f"plane{hand}", Plane(where), Geom_Plane(placed), ((-9, 9), (-9, 9))),
            Pair(f"cylinder{hand}", Cylinder(where, 4.0), Geom_CylindricalSurface(placed, 4.0), (around, (-8, 8))),
            Pair(f"sphere{hand}", Sphere(where, 6.0, pole), Geom_SphericalSurface(placed, 6.0), (around, (-1.4, 1.4))),
            Pair(
                f"spinning sphere{hand}",
                Sphere(where, 6.0, where.axes[2], True),
                Geom_SphericalSurface(placed, 6.0),
                (around, (-1.4, 1.4)),
            ),
            Pair(
                f"torus{hand}",
                RevolvedEllipse.from_ellipse(where, np.array([[6.0, 0, 0], [2.5, 0, 0], [0, 0, 2.5]])),
                Geom_ToroidalSurface(placed, 6.0, 2.5),
                (around, around),
            ),
        ]
        for nappe, angle in ((1.0, 0.4), (-1.0, 0.4), (1.0, -0.7)):
            apex = -3.0 / np.sin(angle)
            reach = sorted((apex + nappe * np.sign(angle) * 0.5, apex + nappe * np.sign(angle) * 9))
            made.append(
                Pair(
                    f"cone {angle:+g}, nappe {nappe:+g}{hand}",
                    Cone(where, 3.0, angle, nappe),
                    Geom_ConicalSurface(placed, angle, 3.0),
                    (around, (reach[0], reach[1])),
                )
            )
    made += [*_swept_ellipses(), _revolution(rational=False), _revolution(rational=True), _nurbs_cylinder()]
    made += [
        wavy((3, 3), ([0.25, 0.5, 0.75], [0.4, 0.4, 0.7])),
        wavy((2, 4), ([0.3, 0.6], [0.5, 0.5]), rational=True),
        wavy((3, 2), ([0.2, 0.5, 0.8], [0.5]), closed=True),
        wavy((3, 2), ([0.2, 0.5, 0.8], [0.5]), closed=True, rational=True),
        wavy((1, 1), ([], [])),
    ]
    return {pair.name: pair for pair in made}


def bulges(factor: float) -> tuple:
    """The same factor on the lengths of both sides."""
    return (lambda t: np.full_like(t, factor),) * 2
