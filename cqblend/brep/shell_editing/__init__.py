"""Blend faces put into a solid by rewriting the boundaries of the faces that they touch."""
