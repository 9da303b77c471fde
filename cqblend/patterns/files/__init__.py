"""Writes patterns to files: drawings of sheets, and a writer for each file format."""
