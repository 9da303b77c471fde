"""Hypothesis without a deadline: the first example of a test pays for imports and caches."""

from hypothesis import settings

settings.register_profile("splines", deadline=None)
settings.load_profile("splines")
