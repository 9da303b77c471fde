"""Measurement of finished shapes by OCCT alone: continuity along edges, creases, curvature."""
