"""Blending the edges of solids: where contacts, rails, sections, rewriting and verification come together."""
