"""The point of a simplex that is closest to the origin (Ericson, Real-Time Collision Detection)."""

from kinarm.kernels.compiling import Array, Vector, helper, inlined


@inlined
def scalar_product(simplex: Array, i: int, a: Vector) -> float:
    """Scalar product of a corner and a vector."""
    return simplex[i, 0] * a[0] + simplex[i, 1] * a[1] + simplex[i, 2] * a[2]


@inlined
def edge(simplex: Array, i: int, j: int) -> Vector:
    """Vector from one corner to another."""
    return (
        simplex[j, 0] - simplex[i, 0],
        simplex[j, 1] - simplex[i, 1],
        simplex[j, 2] - simplex[i, 2],
    )


@inlined
def of_segment(simplex: Array, i: int, j: int) -> tuple[float, float]:
    """Weights of two corners in the closest point of the segment between them."""
    along = edge(simplex, i, j)
    length = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    share = 0.0
    if length > 0.0:
        share = min(max(-scalar_product(simplex, i, along) / length, 0.0), 1.0)
    return 1.0 - share, share


@helper
def of_triangle(simplex: Array, i: int, j: int, k: int) -> Vector:
    """Weights of three corners in the closest point of their triangle."""
    ab, ac = edge(simplex, i, j), edge(simplex, i, k)
    d1, d2 = -scalar_product(simplex, i, ab), -scalar_product(simplex, i, ac)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3, d4 = -scalar_product(simplex, j, ab), -scalar_product(simplex, j, ac)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        share = d1 / (d1 - d3)
        return 1.0 - share, share, 0.0
    d5, d6 = -scalar_product(simplex, k, ab), -scalar_product(simplex, k, ac)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        share = d2 / (d2 - d6)
        return 1.0 - share, 0.0, share
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        share = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - share, share
    whole = va + vb + vc
    return va / whole, vb / whole, vc / whole


@inlined
def is_beyond(simplex: Array, i: int, j: int, k: int, other: int) -> bool:
    """Whether the origin and the fourth corner are on different sides of a triangle."""
    ab, ac = edge(simplex, i, j), edge(simplex, i, k)
    normal = (
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    )
    here = scalar_product(simplex, i, normal)
    return bool(here * (scalar_product(simplex, other, normal) - here) >= 0.0)


@helper
def shrink(simplex: Array, size: int) -> tuple[int, float, float, float]:
    """Drop the corners that the closest point does not depend on; return how many stay, and it.

    A tetrahedron that holds the origin stays as it is.
    """
    a, b, c, d = 1.0, 0.0, 0.0, 0.0
    if size == 2:
        a, b = of_segment(simplex, 0, 1)
    elif size == 3:
        a, b, c = of_triangle(simplex, 0, 1, 2)
    elif size == 4:
        least = -1.0
        for face in range(4):
            i, j, k = (1 if face < 1 else 0), (2 if face < 2 else 1), (3 if face < 3 else 2)
            if not is_beyond(simplex, i, j, k, face):
                continue
            u, v, w = of_triangle(simplex, i, j, k)
            square = 0.0
            for axis in range(3):
                x = u * simplex[i, axis] + v * simplex[j, axis] + w * simplex[k, axis]
                square += x * x
            if least < 0.0 or square < least:
                least = square
                a = 0.0 if face == 0 else u
                b = 0.0 if face == 1 else (u if face < 1 else v)
                c = 0.0 if face == 2 else (v if face < 2 else w)
                d = 0.0 if face == 3 else w
        if least < 0.0:
            return 4, 0.0, 0.0, 0.0
    kept, x, y, z = 0, 0.0, 0.0, 0.0
    for corner in range(size):
        weight = a if corner == 0 else b if corner == 1 else c if corner == 2 else d
        if weight > 0.0:
            x += weight * simplex[corner, 0]
            y += weight * simplex[corner, 1]
            z += weight * simplex[corner, 2]
            for axis in range(3):
                simplex[kept, axis] = simplex[corner, axis]
            kept += 1
    return kept, x, y, z
