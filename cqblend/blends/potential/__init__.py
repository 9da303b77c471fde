"""Potential blends of reshaped surfaces, after Lee, Bedi and Dubey."""
