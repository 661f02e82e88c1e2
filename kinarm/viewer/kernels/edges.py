"""Edges of triangles as functions of a place in the picture."""

import math

from kinarm.kernels.compiling import Vector, inlined


@inlined
def edge(ax: float, ay: float, aw: float, bx: float, by: float, bw: float) -> Vector:
    """Coefficients of x, y and 1 of what is zero on the line through two corners."""
    return ay * bw - by * aw, aw * bx - bw * ax, ax * by - bx * ay


@inlined
def within(a: float, b: float, c: float, row: int, first: int, last: int) -> tuple[int, int]:
    """Columns from first to last in whose pixels of a row a x + b y + c may be 0 or more."""
    most = b * (row + (1 if b > 0.0 else 0)) + c
    if a > 0.0:
        return max(first, math.floor(min(-most / a, last + 1.0)) - 1), last
    if a < 0.0:
        return first, min(last, math.floor(max(-most / a, first - 1.0)))
    return (first, last) if most >= 0.0 else (first, first - 1)
