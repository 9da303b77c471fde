"""Points of the plane as complex numbers: conversion to coordinates, and the cross product."""

import numpy as np

from cqblend.splines.bernstein import Array


def to_coordinates(points: Array) -> Array:
    """Return complex points (..,) as coordinates (.., 2)."""
    return np.stack([points.real, points.imag], axis=-1)


def cross_product(a: Array, b: Array) -> Array:
    """Return the cross product of complex vectors, positive if b is counterclockwise from a."""
    return np.asarray(a.real * b.imag - a.imag * b.real)
