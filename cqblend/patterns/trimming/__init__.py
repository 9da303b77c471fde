"""Trimmed faces and their borders, in their parameter planes and carried to the plane."""
