"""Sizes that vary along a blend: functions and tables of t, checked, joined and shared out. Knows nothing of blends."""
