"""Public functions: what scripts, CadQuery, build123d and the command line call."""
