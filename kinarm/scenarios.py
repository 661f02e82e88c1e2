"""Scenarios: where an episode starts and what it has to reach."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import SceneError

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

START_ATTEMPTS = 2000
PREFETCHED = 32


def draw_scenarios(
    simulator: "Simulator", rng: np.random.Generator, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw starts and goals; see `Simulator.sample`."""
    arm, task, moved = simulator.arm, simulator.task, slice(simulator.n_actions)
    lower = arm.home + task.start_spread * (arm.lower - arm.home)
    extent = task.start_spread * (arm.upper - arm.lower)
    goals = task.goals(simulator.scene, rng.random((count, 3)))
    starts = np.tile(arm.home, (count, 1))
    pending = np.arange(count)
    for _ in range(START_ATTEMPTS):
        candidates = starts[pending]
        uniforms = rng.random((pending.size, simulator.n_actions))
        candidates[:, moved] = lower[moved] + uniforms * extent[moved]
        tools, touching = simulator.screen(candidates)
        far = np.linalg.norm(tools - goals[pending], axis=1) > task.tolerance
        accepted = far & ~touching
        starts[pending[accepted]] = candidates[accepted]
        pending = pending[~accepted]
        if pending.size == 0:
            return starts, goals
    pair = simulator.contact_model.contact_pair(candidates[~accepted][0])
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    raise SceneError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} with start_spread {task.start_spread}; in the last one {reason}"
    )


class ScenarioStream:
    """Starts and goals of successive episodes, drawn a few at a time.

    Parameters
    ----------
    simulator : Simulator
        Draws them.
    rng : numpy.random.Generator
        Source of randomness.
    """

    def __init__(self, simulator: "Simulator", rng: np.random.Generator) -> None:
        self._simulator = simulator
        self._rng = rng
        self._ready: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []

    def next(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a start, shape (n_axes,), and a goal, shape (3,)."""
        if not self._ready:
            starts, goals = self._simulator.sample(self._rng, PREFETCHED)
            self._ready = list(zip(starts, goals, strict=True))[::-1]
        return self._ready.pop()
