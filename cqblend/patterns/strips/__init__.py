"""Strips: a surface divided into ruled surfaces, as few as a tolerance allows."""
