"""Simulators of other problems."""

from kinarm.simulator import Simulator


def changed(simulator, **overrides):
    """A simulator of the same problem, some parts of it replaced."""
    return Simulator(simulator.problem.replace(**overrides), threads=1)
