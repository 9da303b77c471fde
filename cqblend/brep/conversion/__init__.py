"""Between OCCT and symbolic splines: faces, edges, curves and patterns, in and out."""
