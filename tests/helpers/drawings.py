"""Drawings of reports."""

PIXEL = 0.051
"""Coordinates are written to a tenth."""
