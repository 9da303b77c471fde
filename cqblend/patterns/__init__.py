"""Flat patterns of freeform faces: division into ruled strips, flattening, trimming, and pieces for sheets of stock.

Depends on splines, NumPy and Shapely, on no geometry kernel.
"""
