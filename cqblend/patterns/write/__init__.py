"""Patterns to files: drawings, and their writers."""
