"""Outlines: plane curves of segments and arcs, and the pieces that they bound."""
