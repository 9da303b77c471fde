"""Blends of several edges together: which belong to one network, and the plan of what becomes of a solid."""
