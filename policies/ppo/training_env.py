"""The environment of a PPO training: normalised, mirrored, and to be resumed."""

import time
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from kinarm.envs.interface import Verdict
from kinarm.episodes import Episodes
from kinarm.kernels.reward import COLLISION
from kinarm.networks import Mirror
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.ppo.state import EpisodeStates
from kinarm.policies.sb3.vec_env import SB3VecEnv, StepReturn
from kinarm.rollouts import StepResult
from kinarm.simulator import Simulator


class NormalizedInterface:
    """The simulator's observation, mirrored and normalised, and its own reward.

    Parameters
    ----------
    n_observations : int
        Length of an observation.
    mirror : Mirror, optional
        Arms whose goal lies to the left are seen in it.

    Attributes
    ----------
    penalty : float
        Share of the penalty for contact that counts.
    """

    tells_terms = True

    def __init__(self, n_observations: int, mirror: Mirror | None) -> None:
        unbounded = Box(-np.inf, np.inf, (n_observations,), dtype=np.float32)
        self.observation_space: Space[Any] = unbounded
        self.mirror, self.penalty = mirror, 1.0
        self.normalize_by(Normalizer.empty(n_observations))

    def normalize_by(self, normalizer: Normalizer) -> None:
        """From now on, normalise observations by these statistics, of what the learner sees."""
        self._mean, self._scale = normalizer.mean, input_scale(normalizer.std)

    def observe(self, observations: NDArray[np.float64]) -> NDArray[np.float32]:
        """Observations as the learner sees them."""
        if self.mirror is not None:
            observations = self.mirror.from_the_right(observations)
        shown: NDArray[np.float32] = ((observations - self._mean) * self._scale).astype(np.float32)
        return shown

    def judge(self, episodes: Episodes, result: StepResult) -> Verdict:  # noqa: ARG002
        """Take the simulator's reward, with a share of its penalty for contact, and endings."""
        remitted = (1.0 - self.penalty) * result.terms[:, COLLISION]
        return Verdict(result.reward - remitted, result.terminated, result.truncated)


class EndedEpisodes(NamedTuple):
    """Episodes of a `TrainingVecEnv` since the last look: returns, successes, time in steps [s]."""

    returns: list[float]
    successes: list[bool]
    time: float


class TrainingVecEnv(SB3VecEnv):
    """The environment for Stable-Baselines3 as kinarm's own trainings use it.

    One generator, given to `draw_from`, draws starts and goals of all arms. With a mirror, an arm
    whose goal lies to the left is seen in the mirror, and its actions are reflected likewise, so
    that a learner only ever meets goals to the right.
    """

    def __init__(
        self,
        simulator: Simulator,
        num_envs: int,
        *,
        rng: np.random.Generator,
        mirror: Mirror | None = None,
    ) -> None:
        self.mirror = mirror
        self._shown = NormalizedInterface(simulator.n_observations, mirror)
        self._record = EndedEpisodes([], [], 0.0)
        super().__init__(simulator, num_envs, self._shown)
        self.draw_from(rng)

    def normalize_by(self, normalizer: Normalizer) -> None:
        """From now on, normalise observations by these statistics, of what the learner sees."""
        self._shown.normalize_by(normalizer)

    def punish_by(self, penalty: float) -> None:
        """From now on, let this share of the penalty for contact count."""
        self._shown.penalty = penalty

    def draw_from(self, rng: np.random.Generator, start_spread: float | None = None) -> None:
        """From now on, draw scenarios from this generator; with the task's start spread if None."""
        self._rng, self._start_spread = rng, start_spread

    def _draw(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Starts and goals from the one generator."""
        return self.simulator.sample(self._rng, rows.size, start_spread=self._start_spread)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take note of the actions, given what the learner saw, as the simulator needs them."""
        if self.mirror is not None:
            left = self.mirror.on_the_left(self._begun_episodes().observation)
            actions = np.where(left[:, None], actions * self.mirror.actions, actions)
        super().step_async(actions)

    def step_wait(self) -> StepReturn:
        """Move every arm for one time step, and keep a record of it."""
        began = time.perf_counter()
        outcome = super().step_wait()
        for row in np.flatnonzero(outcome[2]).tolist():
            info = outcome[3][row]
            self._record.returns.append(info["episode"]["r"])
            self._record.successes.append(info["is_success"])
        spent = self._record.time + time.perf_counter() - began
        self._record = self._record._replace(time=spent)
        return outcome

    def take_ended(self) -> EndedEpisodes:
        """What happened since the last call."""
        record, self._record = self._record, EndedEpisodes([], [], 0.0)
        return record

    def states(self) -> EpisodeStates:
        """Copy what the running episodes depend on."""
        episodes = self._begun_episodes()
        return EpisodeStates(
            episodes.q.copy(), episodes.goal.copy(), episodes.steps.copy(), self._returns.copy()
        )

    def restore(self, states: EpisodeStates) -> NDArray[np.float32]:
        """Go on with episodes that `states` described; returns their observations."""
        episodes = self.simulator.reset(states.q, states.goal)
        episodes.steps[:], episodes.total[:] = states.steps, states.total
        shown: NDArray[np.float32] = self._begin(episodes)
        self._returns[:] = states.total
        return shown
