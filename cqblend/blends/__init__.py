"""Blends between primary surfaces: contacts, rails, directions along them, and the surface between.

Knows splines and nothing of OCCT.
"""
