"""The plants of episodes, each of which follows from its start and goal."""

import numpy as np

from kinarm._parallel import run_rows
from kinarm.episode_scenes import bits_of
from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import (
    FORMER,
    OFFSETS,
    SUBSTEPS,
    VELOCITY,
    draw_plants,
    plant_width,
)
from kinarm.plant import RANGES
from kinarm.problem import ReachProblem


class EpisodePlants:
    """Draws the plants of episodes.

    Attributes
    ----------
    width, rows : int
        Numbers of a plant, and rows of its state; zero if it is ideal.
    """

    def __init__(self, problem: ReachProblem, step_limit: Array) -> None:
        plant, self._n_actions = problem.plant, len(step_limit)
        ranges = np.array([plant.range_of(name) for name in RANGES], dtype=np.float64)
        self._draws = ranges, problem.stepping.time_step / SUBSTEPS
        self.width = 0 if plant.ideal else plant_width(self._n_actions)
        self.rows = 0 if plant.ideal else FORMER + int(plant.range_of("delay")[1])

    def of(self, starts: Array, goals: Array, threads: int) -> Array:
        """Numbers of plants, shape (n, width).

        Takes starts, shape (n, n_joints) [rad or m], goals, shape (n, goal_width), of which all
        numbers count, and the number of threads.
        """
        n, bits = len(starts), bits_of(starts, goals)
        plants = np.empty((n, self.width))
        run_rows(draw_plants, n, n, threads, *self._draws, bits, plants)
        return plants

    def at_rest(self, plants: Array, q: Array) -> Array:
        """States in which arms rest, shape (n, rows, n_actions).

        Takes numbers of plants, shape (n, width), and joint positions, shape (n, n_joints) [rad or
        m].
        """
        if not self.width:
            return np.zeros((0, 0, self._n_actions))
        calibration = plants[:, OFFSETS + self._n_actions : OFFSETS + 2 * self._n_actions]
        commands = q[:, : self._n_actions] - calibration
        drive = np.repeat(commands[:, None], self.rows, axis=1)
        drive[:, VELOCITY] = 0.0
        return drive
