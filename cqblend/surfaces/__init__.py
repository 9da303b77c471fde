"""Surfaces as a blend sees them: points, normals and derivatives in their own parameters, and exact splines of them."""
