"""The rate that a core attains: products and sums in lanes, and nothing else."""

from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.lanes import LANES, as_lanes

CHAINS = 6
"""Independent sums: as many as hide the latency, and as fit into sixteen registers."""


def attainable_operations(turns: int) -> int:
    """Operations that `multiply_and_add` carries out."""
    return 2 * CHAINS * LANES * turns


@kernel
def multiply_and_add(turns: int, space: Array) -> None:
    """Multiply and add without end in `CHAINS` lanes, ``space[2:]``.

    Products and sums are not contracted, just as in the simulator.

    Parameters
    ----------
    turns : int
        How often.
    space : ndarray, shape (2 + CHAINS, LANES)
        Factor, summand, and what they are applied to.
    """
    values = as_lanes(space)
    factor, summand = values[0], values[1]
    a, b, c = values[2], values[3], values[4]
    d, e, f = values[5], values[6], values[7]
    for _ in range(turns):
        a = a * factor + summand
        b = b * factor + summand
        c = c * factor + summand
        d = d * factor + summand
        e = e * factor + summand
        f = f * factor + summand
    values[2], values[3], values[4] = a, b, c
    values[5], values[6], values[7] = d, e, f
