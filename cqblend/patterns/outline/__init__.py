"""Outlines: plane paths of straight segments and circular arcs, and the flat pieces that they bound."""
