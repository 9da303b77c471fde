"""Out of OCCT: faces, edges and their curves as symbolic splines and arrays."""
