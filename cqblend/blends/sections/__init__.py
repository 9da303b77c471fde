"""Sections: the surface between two ribbons, exact or compact."""
