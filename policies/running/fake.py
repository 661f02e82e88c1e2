"""A fake arm, which obeys as a plant does."""

import numpy as np

from kinarm.episodes import RUNNING
from kinarm.goals import GoalSpecification
from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import COMMAND
from kinarm.observation_choice import Observation
from kinarm.plant import Plant
from kinarm.policies.running.backend import SimulatedArm
from kinarm.simulator import Simulator
from kinarm.task import LONGEST_HORIZON, NEVER, RewardWeights
from kinarm.world import World


class FakeArm(SimulatedArm):
    """An arm that lags as a plant does, and stops before it touches something.

    Parameters
    ----------
    world : World
        Arm and scene.
    start : ndarray, shape (n_joints,)
        Where it rests [rad or m].
    plant : Plant, str or Path
        What lies between command and joint; each period is a step of it.
    """

    def __init__(self, world: World, start: Array, *, plant: Plant | str = "ideal") -> None:
        self.joint_names, self.time, self.period = world.arm.joint_names, 0.0, 0.0
        self.start = np.array(start, dtype=float)
        self._problem, self._plant = world.problem, Plant.load(plant)
        self._simulators = dict[float, Simulator]()

    def connect(self, period: float) -> None:
        """Rest at the start."""
        if period not in self._simulators:
            problem = self._problem.replace(
                plant=self._plant,
                feedback="measured",
                shield=False,
                time_step=period,
                horizon=LONGEST_HORIZON,
                tolerance=NEVER,
                reward=RewardWeights(),
                goal=GoalSpecification(),
                observation=Observation(),
            )
            self._simulators[period] = Simulator(problem, threads=1)
        self._simulator, self.period = self._simulators[period], period
        goal = self._simulator.world.reached(self.start[None]) + 1e3  # no goal: far away
        self._episodes = self._simulator.reset(self.start[None], goal)
        self._told = self.start

    def read(self) -> Array:
        """Where sensors have the joints."""
        seen = self._episodes.sensed if len(self._episodes.sensed) else self._episodes.q
        return np.array(seen[0])

    def command(self, positions: Array) -> None:
        """Send the joints to positions, as fast as they can."""
        self._told = positions.copy()

    def advance(self) -> None:
        """Move on by a step of the plant."""
        episodes, n = self._episodes, self._simulator.n_actions
        last = episodes.drive[0, COMMAND] if len(episodes.drive) else episodes.q[0, :n]
        action = (self._told[:n] - last) / self._simulator.step_limit
        self._simulator.step(episodes, action[None])
        if episodes.status[0] != RUNNING:
            (pair,) = self._simulator.world.contact_pairs(episodes.target)
            touch = " touches ".join(pair or ("it", "something"))
            raise ConnectionError(f"the arm stopped, for {touch}")

    def stop(self) -> None:
        """Rest where the joints are."""
        self._told = self._episodes.q[0].copy()
