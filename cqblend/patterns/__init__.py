"""Developables: ruled strips, developability, flattening, and what is cut from flat stock.

Knows splines and the plane (NumPy, Shapely), no geometry kernel.
"""
