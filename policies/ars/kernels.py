"""Normal numbers for Augmented Random Search, the same bits on every machine."""

import math

from kinarm.kernels.compiling import Array, inlined, kernel
from kinarm.kernels.elementary import LOG_2, LOG_2_REST, sine_cosine
from kinarm.kernels.lanes import as_lanes, power_of_two, select

TURN = 6.283185307179586


@inlined
def logarithm(x: float) -> float:
    """Natural logarithm of a number between 2^-63 and 1, to within 3e-16 of itself.

    The polynomial is that of FreeBSD's mathematical library.
    """
    halvings = 0.0 * x
    for doublings in (32.0, 16.0, 8.0, 4.0, 2.0, 1.0):
        small = x < power_of_two(-doublings)
        x = select(small, x * power_of_two(doublings), x)
        halvings = select(small, halvings + doublings, halvings)
    small = x < 0.7071067811865476
    x = select(small, 2.0 * x, x)
    halvings = select(small, halvings + 1.0, halvings)
    f = x - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (
        3.999999999940941908e-1 + w * (2.222219843214978396e-1 + w * 1.531383769920937332e-1)
    )
    odd = 2.857142874366239149e-1 + w * (1.818357216161805012e-1 + w * 1.479819860511658591e-1)
    half = 0.5 * f * f
    rest = s * (half + even + z * (6.666666666666735130e-1 + w * odd))
    return f - (half - (rest - halvings * LOG_2_REST)) - halvings * LOG_2


@kernel
def normal_pairs(numbers: Array) -> None:
    """Make normal numbers of uniform ones in [0, 1), in place (Box and Muller).

    The array has the shape (2, n, LANES); each number of the first half and its partner in the
    second make a pair of independent ones.
    """
    pairs = as_lanes(numbers)
    for i in range(pairs.shape[1]):
        radius = math.sqrt(-2.0 * logarithm(1.0 - pairs[0, i]))
        sine, cosine = sine_cosine(TURN * pairs[1, i])
        pairs[0, i] = radius * cosine
        pairs[1, i] = radius * sine
