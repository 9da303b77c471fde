"""Corners: patches that fill the hole where blends meet, exactly smooth with every surface around it."""
