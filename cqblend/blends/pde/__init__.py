"""Blends by partial differential equations, after You and Zhang."""
