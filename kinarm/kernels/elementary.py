"""Elementary functions of numbers or lanes: the same bits on every machine.

Polynomials and constants are those of Cephes and FreeBSD's mathematical library.
"""

from kinarm.kernels.compiling import inlined
from kinarm.kernels.lanes import power_of_two, select

HALF_PI = 1.57079632673412561417
"""Half of pi in 33 bits: small multiples are exact."""
HALF_PI_REST = 6.07710050650619224932e-11
"""Half of pi less `HALF_PI`."""
QUARTERS = 0.63661977236758134308
"""2 / pi."""

ROUNDING = 1.5 * 2.0**52
"""Added and subtracted, it leaves the nearest whole number."""

QUARTER_PI = 7.85398163397448309616e-1
SMALLEST = 1e-300
"""Below all lengths that are told apart from 0."""

LOG_2 = 6.93145751953125e-1
LOG_2_REST = 1.42860682030941723212e-6
LOG_2_INVERSE = 1.4426950408889634074

TURN = 6.283185307179586
"""A whole turn [rad]."""


@inlined
def nearest_whole(x: float) -> float:
    """Nearest whole number, below 2^51; half-way ones go to the even one."""
    return (x + ROUNDING) - ROUNDING


@inlined
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of at most a million radians, to within 1e-15."""
    quarter = nearest_whole(angle * QUARTERS)
    x = (angle - quarter * HALF_PI) - quarter * HALF_PI_REST
    z = x * x
    odd = -2.50507602534068634195e-8 + z * 1.58969099521155010221e-10
    odd = -1.98412698298579493134e-4 + z * (2.75573137070700676789e-6 + z * odd)
    odd = -1.66666666666666324348e-1 + z * (8.33333333332248946124e-3 + z * odd)
    sine = x + x * z * odd
    even = 2.08757232129817482790e-9 + z * -1.13596475577881948265e-11
    even = 2.48015872894767294178e-5 + z * (-2.75573143513906633035e-7 + z * even)
    even = 4.16666666666666019037e-2 + z * (-1.38888888888741095749e-3 + z * even)
    cosine = 1.0 - (0.5 * z - z * z * even)
    # Which quarter turn, as -1/2, -1/4, 0, 1/4 or 1/2 of a whole one.
    turn = 0.25 * quarter
    turn -= nearest_whole(turn)
    swapped = abs(abs(turn) - 0.25) < 0.125
    sine, cosine = select(swapped, cosine, sine), select(swapped, sine, cosine)
    halved = abs(turn) > 0.375
    return (
        select((turn < -0.125) | halved, -sine, sine),
        select((turn > 0.125) | halved, -cosine, cosine),
    )


@inlined
def exponential(x: float) -> float:
    """E to a power between -700 and 700, to within 2e-16 of itself."""
    doublings = nearest_whole(x * LOG_2_INVERSE)
    x = (x - doublings * LOG_2) - doublings * LOG_2_REST
    z = x * x
    p = x * (
        9.99999999999999999910e-1 + z * (3.02994407707441961300e-2 + z * 1.26177193074810590878e-4)
    )
    q = 2.27265548208155028766e-1 + z * (2.52448340349684104192e-3 + z * 3.00198505138664455042e-6)
    q = 2.0 + z * q
    return (1.0 + 2.0 * (p / (q - p))) * power_of_two(doublings)


@inlined
def hyperbolic_tangent(x: float) -> float:
    """Hyperbolic tangent, to within 4e-16 of itself."""
    size = abs(x)
    z = x * x
    p = -1.61468768441708447952e3 + z * (-9.92877231001918586564e1 + z * -9.64399179425052238628e-1)
    q = 4.84406305325125486048e3 + z * (
        2.23548839060100448583e3 + z * (1.12811678491632931402e2 + z)
    )
    small = x + x * z * (p / q)
    large = 1.0 - 2.0 / (exponential(2.0 * min(size, 20.0)) + 1.0)
    return select(size < 0.625, small, select(x < 0.0, -large, large))


@inlined
def angle_of(sine: float, cosine: float) -> float:
    """Angle in [0, pi] with a sine and a cosine in this ratio, to within 1e-15.

    The sine must not be negative. If both are 0, it is a right angle.
    """
    size = abs(cosine)
    steep = sine >= size
    short, long = select(steep, size, sine), select(steep, sine, size)
    large = short > 0.66 * long
    over, under = select(large, short - long, short), select(large, short + long, long)
    x = over / max(under, SMALLEST)
    z = x * x
    p = -7.500855792314704667340e1 + z * (
        -1.615753718733365076637e1 + z * -8.750608600031904122785e-1
    )
    p = -6.485021904942025371773e1 + z * (-1.228866684490136173410e2 + z * p)
    q = 4.328810604912902668951e2 + z * (
        1.650270098316988542046e2 + z * (2.485846490142306297962e1 + z)
    )
    q = 1.945506571482613964425e2 + z * (4.853903996359136964868e2 + z * q)
    angle = x + x * z * (p / q) + select(large, QUARTER_PI, 0.0)
    angle = select(steep, 2.0 * QUARTER_PI - angle, angle)
    return select(cosine < 0.0, 4.0 * QUARTER_PI - angle, angle)
