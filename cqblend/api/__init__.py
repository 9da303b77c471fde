"""The front doors: what scripts, CadQuery, build123d and the command line call."""
