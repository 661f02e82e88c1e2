"""The arms of a training: what its learner sees of them, and how their episodes begin and end."""

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.failed_scenarios import StartsAndGoals
from kinarm.kernels.reward import COLLISION, SUCCESS
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.normalizer import input_scale
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.kernels.tiles import Numbers
from kinarm.policies.ppo.state import EpisodeStates, PPOState


class Step(NamedTuple):
    """Outcome of a step of all arms: rewards, which episodes ended, shape (n_envs,) each.

    Episodes that ended are replaced. For those that the time limit cut short, there are their rows,
    shape (n,), and their last observations, shape (n, n_observations).
    """

    rewards: Numbers
    ended: NDArray[np.bool_]
    cut_short: NDArray[np.int64]
    finals: Numbers


class TrainingArms:
    """Arms that are stepped together, whose episodes are replaced when they end.

    With a mirror, new scenarios with goals to the left are reflected, so that a learner only ever
    meets goals to the right. To stop at the goal, a success takes two steps in a row within the
    tolerance.

    Parameters
    ----------
    config : PPOConfig
        Settings of the training.

    Attributes
    ----------
    failed : FailedScenarios
        What may be replayed.
    returns, successes : list of ndarray
        Of the episodes that ended since `restore`, but for those that replayed a failed scenario.
    time : float
        Time that steps took since `restore` [s].
    """

    def __init__(self, config: PPOConfig) -> None:
        self.config = config
        self.simulator = config.simulator(threads=1)
        self.mirror = problem_mirror(config.problem) if config.symmetric else None

    def reach_within(self, tolerance: float) -> None:
        """Count this distance [m] as a success in episodes that are restored from now on."""
        if tolerance != self.simulator.task.tolerance:
            self.simulator = self.simulator.with_tolerance(tolerance)

    def sample(
        self, rng: np.random.Generator, count: int, start_spread: float | None = None
    ) -> StartsAndGoals:
        """Draw starts and goals as a learner meets them, without replay.

        Parameters
        ----------
        rng, count, start_spread
            As for `kinarm.Simulator.sample`.
        """
        drawn = self.simulator.sample(rng, count, start_spread=start_spread)
        return drawn if self.mirror is None else self.mirror.scenarios_from_the_right(*drawn)

    def restore(self, state: PPOState, rng: np.random.Generator) -> None:
        """Go on with the episodes of a state; the generator draws those that follow."""
        config, done = self.config, state.iteration / self.config.iterations
        self._rng, self._start_spread = rng, config.start_spread_at(done)
        self._remitted = 1.0 - config.penalty_at(done)
        self._mean, self._scale = state.normalizer.mean, input_scale(state.normalizer.std)
        self.reach_within(config.tolerance_at(done))
        begun = EpisodeStates._make(map(np.copy, state.episodes))
        self.episodes = self.simulator.reset(begun.q, begun.goal)
        self.episodes.steps[:] = begun.steps
        self._total, self._start, self._replayed = begun.total, begun.start, begun.replayed
        self.failed, self.time = state.failed, 0.0
        self.returns: list[NDArray[np.float64]] = []
        self.successes: list[NDArray[np.bool_]] = []

    def states(self) -> EpisodeStates:
        """Copy what the running episodes depend on."""
        episodes, ours = self.episodes, (self._total, self._start, self._replayed)
        parts = (episodes.q, episodes.goal, episodes.steps, *ours)
        return EpisodeStates._make(map(np.copy, parts))

    def observe(self) -> Numbers:
        """Normalised observations of all arms, shape (n_envs, n_observations)."""
        return self._normalized(self.episodes.observation)

    def _normalized(self, observations: NDArray[np.float64]) -> Numbers:
        return ((observations - self._mean) * self._scale).astype(np.float32)

    def replaying(self) -> NDArray[np.bool_]:
        """Which arms are in those steps of a replay that have more noise, shape (n_envs,)."""
        steps = self.config.replay_noise_steps
        return self._replayed if steps is None else self._replayed & (self.episodes.steps < steps)

    def step(self, actions: Numbers) -> Step:
        """Move all arms by actions, shape (n_envs, n_actions), and renew episodes that end."""
        began, episodes, task = time.perf_counter(), self.episodes, self.simulator.task
        passes = np.zeros(len(episodes.steps), dtype=bool)
        if self.config.stop_at_goal:
            outside = episodes.distance > task.tolerance
            passes = outside & (episodes.steps + 1 < task.horizon)
        result = self.simulator.step(episodes, actions)
        passes &= result.success
        episodes.resume(passes.nonzero()[0], task.horizon)
        remitted = self._remitted * result.terms[:, COLLISION]
        remitted += np.where(passes, result.terms[:, SUCCESS], 0.0)
        rewards = result.reward - remitted
        self._total += rewards
        ended = result.truncated | (result.terminated & ~passes)
        cut_short = np.flatnonzero(result.truncated & ~result.terminated)
        finals = self._normalized(episodes.observation[cut_short])
        if ended.any():
            counted = ended & ~self._replayed
            self.returns.append(self._total[counted])
            self.successes.append(result.success[counted])
            self._renew(ended.nonzero()[0], ended & ~result.success)
        self.time += time.perf_counter() - began
        return Step(rewards.astype(np.float32), ended, cut_short, finals)

    def _renew(self, rows: NDArray[np.int64], missed: NDArray[np.bool_]) -> None:
        """Replace episodes; those that missed the goal may be replayed."""
        config, episodes = self.config, self.episodes
        if config.replay_share:
            scenarios = self._start[missed], episodes.goal[missed]
            self.failed = self.failed.followed_by(*scenarios, config.replay_size)

        def draw(places: NDArray[np.int64]) -> StartsAndGoals:
            return self.sample(self._rng, len(places), self._start_spread)

        scenarios, self._replayed[rows] = self.failed.mixed(
            config.replay_share, self._rng, len(rows), draw
        )
        self._start[rows], episodes.goal[rows] = scenarios
        episodes.q[rows] = self._start[rows]
        self.simulator.begin(episodes, rows)
        self._total[rows] = 0.0
