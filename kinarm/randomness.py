"""Random generators by purpose, which never share numbers; and even points.

A generator's key is the hash of its purpose's name, four numbers, and then numbers of its own.
Trials of an evaluation (``kinarm.evaluation.trials.trial_generator``) are older: their keys have
two.
"""

import hashlib
from decimal import Context, Decimal
from enum import StrEnum
from functools import cache

import numpy as np
from numpy.typing import NDArray


class Stream(StrEnum):
    """A purpose of random numbers."""

    ARS = "ars"
    PPO_LEARNER = "ppo learner"
    PPO_SCENARIOS = "ppo scenarios"


def stream_generator(stream: Stream, seed: int, *numbers: int) -> np.random.Generator:
    """Random generator of one purpose.

    Parameters
    ----------
    stream, seed
        The purpose, and the seed of the whole, from 0.
    *numbers : int
        Which generator of this purpose, such as the iteration; from 0.
    """
    name = np.frombuffer(hashlib.sha256(stream.encode()).digest()[:16], dtype="<u4")
    key = (*map(int, name), *numbers)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


@cache
def low_discrepancy_points(count: int, dimensions: int) -> NDArray[np.float64]:
    """Points that fill the unit cube evenly, shape (count, dimensions).

    They are multiples of powers of a root of x^(d + 1) = x + 1, modulo 1; for d = 1, of the golden
    ratio (Roberts 2018). All callers share them, and do not change them.
    """
    # Libraries that compute powers in floats differ in the last bits.
    context, root = Context(prec=28), Decimal(2)
    for _ in range(64):
        root = context.power(context.add(root, 1), context.divide(1, dimensions + 1))
    root = Decimal(float(root))
    powers = [float(context.power(root, -k)) for k in range(1, dimensions + 1)]
    points: NDArray[np.float64] = 0.5 + np.arange(1, count + 1)[:, None] * np.array(powers)
    return points % 1.0
