"""Verification of finished solids by OCCT, and the certificates of blends."""
