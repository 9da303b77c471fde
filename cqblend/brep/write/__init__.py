"""From splines and pieces to shapes of OCCT."""
