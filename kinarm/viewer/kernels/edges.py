"""Edges of triangles as functions of a place in the picture."""

from kinarm.kernels.compiling import Vector, inlined


@inlined
def edge(ax: float, ay: float, aw: float, bx: float, by: float, bw: float) -> Vector:
    """Coefficients of x, y and 1 of what is zero on the line through two corners."""
    return ay * bw - by * aw, aw * bx - bw * ax, ax * by - bx * ay
