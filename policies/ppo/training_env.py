"""The environment of a PPO training: normalised, on one side, and to be resumed."""

import time
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from kinarm.envs.interface import Interface, StepOutcome
from kinarm.episodes import Episodes
from kinarm.failed_scenarios import FailedScenarios, Replay, StartsAndGoals
from kinarm.kernels.reward import COLLISION, SUCCESS
from kinarm.networks import Mirror
from kinarm.policies.mirror import sample_seen
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.ppo.state import EpisodeStates
from kinarm.policies.sb3.vec_env import SB3VecEnv, StepReturn
from kinarm.rollouts import StepResult
from kinarm.simulator import Simulator


class NormalizedInterface(Interface):
    """The simulator's observation, normalised, and its own reward.

    Parameters
    ----------
    simulator : Simulator
        What is shown.

    Attributes
    ----------
    penalty : float
        Share of the penalty for contact that counts.
    passes : ndarray of bool, shape (n,)
        Which episodes go on if they succeed in this step.
    """

    tells_terms = True

    def __init__(self, simulator: Simulator) -> None:
        self._horizon, n_observations = simulator.task.horizon, simulator.n_observations
        unbounded = Box(-np.inf, np.inf, (n_observations,), dtype=np.float32)
        self.observation_space = unbounded
        self.penalty = 1.0
        self.passes: NDArray[np.bool_] = np.zeros(1, dtype=np.bool_)
        self.normalize_by(Normalizer.empty(n_observations))

    def normalize_by(self, normalizer: Normalizer) -> None:
        """From now on, normalise observations by these statistics, of what the learner sees."""
        self._mean, self._scale = normalizer.mean, input_scale(normalizer.std)

    def observe(self, observations: NDArray[np.float64]) -> NDArray[np.float32]:
        """Observations as the learner sees them."""
        shown: NDArray[np.float32] = ((observations - self._mean) * self._scale).astype(np.float32)
        return shown

    def step_outcome(self, episodes: Episodes, result: StepResult) -> StepOutcome:
        """Take the simulator's reward and endings, except for the penalty and for what passes."""
        passing = result.success & self.passes
        episodes.resume(passing.nonzero()[0], self._horizon)
        remitted = (1.0 - self.penalty) * result.terms[:, COLLISION]
        remitted += np.where(passing, result.terms[:, SUCCESS], 0.0)
        return StepOutcome(result.reward - remitted, result.terminated & ~passing, result.truncated)


class EndedEpisodes(NamedTuple):
    """Episodes of a `TrainingVecEnv` since the last look: returns, successes, time in steps [s]."""

    returns: list[float]
    successes: list[bool]
    time: float


class TrainingVecEnv(SB3VecEnv):
    """The environment for Stable-Baselines3 as kinarm's own trainings use it.

    One generator, given to `draw_from`, draws starts and goals of all arms. With a mirror, those
    with goals to the left are reflected, so that a learner only ever meets goals to the right.
    What is recorded of episodes that ended leaves out those that replayed a failed scenario. To
    stop at the goal, a success takes two steps in a row within the tolerance.

    Parameters
    ----------
    simulator : Simulator
        What is stepped.
    num_envs : int
        Number of arms.
    rng : numpy.random.Generator
        Draws scenarios.
    mirror : Mirror, optional
        Reflects those with goals to the left.
    replay : Replay, optional
        How failed scenarios are replayed; never, if it is not given.
    stop_at_goal : bool
        Whether a success takes two steps within the tolerance.
    """

    def __init__(
        self,
        simulator: Simulator,
        num_envs: int,
        *,
        rng: np.random.Generator,
        mirror: Mirror | None = None,
        replay: Replay | None = None,
        stop_at_goal: bool = False,
    ) -> None:
        self.mirror = mirror
        self.stop_at_goal = stop_at_goal
        self._shown = NormalizedInterface(simulator)
        self._record = EndedEpisodes([], [], 0.0)
        super().__init__(simulator, num_envs, self._shown, replay=replay)
        self.draw_from(rng)

    def normalize_by(self, normalizer: Normalizer) -> None:
        """From now on, normalise observations by these statistics, of what the learner sees."""
        self._shown.normalize_by(normalizer)

    def punish_by(self, penalty: float) -> None:
        """From now on, let this share of the penalty for contact count."""
        self._shown.penalty = penalty

    def reach_within(self, tolerance: float) -> None:
        """Count this distance as a success in episodes that are begun or restored from now on."""
        if tolerance != self.simulator.task.tolerance:
            self.simulator = self.simulator.with_tolerance(tolerance)

    def draw_from(self, rng: np.random.Generator, start_spread: float | None = None) -> None:
        """From now on, draw scenarios from this generator; with the task's start spread if None."""
        self._rng, self._start_spread = rng, start_spread

    def _draw(self, rows: NDArray[np.int64]) -> StartsAndGoals:
        """The one generator decides about replays, too."""
        return self._new_or_failed(rows, self._rng)

    def _draw_new(self, rows: NDArray[np.int64]) -> StartsAndGoals:
        """Starts and goals from the one generator."""
        return self.sample(rows.size)

    def sample(self, count: int) -> StartsAndGoals:
        """Draw starts and goals as a learner meets them, without replay."""
        spread = self._start_spread
        return sample_seen(self.mirror, self.simulator, self._rng, count, start_spread=spread)

    def step_wait(self) -> StepReturn:
        """Move every arm for one time step, and keep a record of it."""
        began = time.perf_counter()
        if self.stop_at_goal:
            episodes, task = self.episodes, self.simulator.task
            outside, last = episodes.distance > task.tolerance, episodes.steps + 1 == task.horizon
            self._shown.passes = outside & ~last
        outcome = super().step_wait()
        for row in np.flatnonzero(outcome[2]).tolist():
            info = outcome[3][row]
            if not info.get("replayed", False):
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
        episodes = self.episodes
        return EpisodeStates(
            q=episodes.q.copy(),
            goal=episodes.goal.copy(),
            steps=episodes.steps.copy(),
            total=self._returns.copy(),
            start=self._starts.copy(),
            replayed=self._replayed.copy(),
        )

    def restore(self, states: EpisodeStates, failed: FailedScenarios) -> NDArray[np.float32]:
        """Go on with episodes that `states` described; returns their observations."""
        episodes = self.simulator.reset(states.q, states.goal)
        episodes.steps[:], episodes.total[:] = states.steps, states.total
        shown: NDArray[np.float32] = self._begin(episodes)
        self._returns[:], self._failed = states.total, failed
        self._starts[:], self._replayed[:] = states.start, states.replayed
        return shown
