"""The arms of a training, and their episodes."""

import numpy as np
from numpy.typing import NDArray

from kinarm.failed_scenarios import StartsAndGoals
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.normalizer import input_scale
from kinarm.policies.ppo import EpisodeStates, PPOConfig, PPOState
from kinarm.policies.ppo.kernels.layers import Numbers
from kinarm.randomness import Stream, stream_generator

Reals = NDArray[np.floating]

LOT = 2048
"""Scenarios that are drawn together: a few at a time would take up to thrice as long."""


class TrainingArms:
    """Arms stepped together, whose episodes are replaced when they end.

    With a mirror, new goals on the left are reflected, so that a learner only
    meets those on the right; later goals of an episode it meets reflected, as
    its policy does.

    Attributes
    ----------
    failed : FailedScenarios
        What may be replayed.
    replayed : ndarray of bool, shape (n_envs,)
        Which arms replay it, with the noise of replays.
    scenarios : int
        Scenarios taken so far, but for replays.
    returns, successes : list of ndarray
        Of episodes that ended since `restore`, but for replays.
    cut_short, finals : list of ndarray
        Of each step since `restore`, rows of episodes that the time limit cut
        short, shape (n,), and their last observations, shape (n,
        n_observations).
    """

    def __init__(self, config: PPOConfig) -> None:
        self.config, self.scenarios = config, 0
        self._lot: tuple[int, StartsAndGoals] | None = None
        self.simulator = config.simulator(threads=1)
        self.mirror = problem_mirror(config.problem) if config.symmetric else None

    def sample(self, rng: np.random.Generator, count: int) -> StartsAndGoals:
        """Draw starts and goals without replay; see `kinarm.Simulator.sample`."""
        drawn = self.simulator.sample(rng, count)
        return drawn if self.mirror is None else self.mirror.scenarios_from_the_right(*drawn)

    def next_scenarios(self, count: int) -> StartsAndGoals:
        """Take the next ones of the training, at least one; see `LOT`."""
        first, self.scenarios = self.scenarios, self.scenarios + count
        parts = []
        for number in range(first // LOT, -(-self.scenarios // LOT)):
            within = slice(max(first - number * LOT, 0), self.scenarios - number * LOT)
            parts.append([each[within] for each in self._drawn(number)])
        starts, goals = (np.concatenate(part) for part in zip(*parts, strict=True))
        return starts, goals

    def _drawn(self, number: int) -> StartsAndGoals:
        """Draw a lot with random numbers of its own, unless it is the last one."""
        if self._lot is None or self._lot[0] != number:
            rng = stream_generator(Stream.PPO_SCENARIOS, self.config.seed, number)
            self._lot = number, self.sample(rng, LOT)
        return self._lot[1]

    def restore(self, state: PPOState, rng: np.random.Generator) -> None:
        """Go on with a state's episodes; the generator decides what is replayed."""
        self._rng, self.scenarios = rng, state.scenarios
        self._mean, self._scale = state.normalizer.mean, input_scale(state.normalizer.std)
        begun = EpisodeStates._make(map(np.copy, state.episodes))
        scenarios, start, taken = (begun.q, begun.goal), begun.start, begun.steps
        kept = begun.done.T if len(begun.done) else None
        self.episodes = self.simulator.reset(
            *scenarios, origins=start, taken=taken, drive=begun.drive, done=kept
        )
        if len(begun.observation):
            self.episodes.observation[:] = begun.observation
        self._total, self._start, self.replayed = begun.total, begun.start, begun.replayed
        self.failed = state.failed
        self.returns: list[NDArray[np.float64]] = []
        self.successes: list[NDArray[np.bool_]] = []
        self.cut_short: list[NDArray[np.int64]] = []
        self.finals: list[Numbers] = []

    def states(self) -> EpisodeStates:
        """Copy the state of running episodes."""
        episodes, ours = self.episodes, (self._total, self._start, self.replayed)
        done = np.stack([episodes.pursuit.goals_reached, episodes.pursuit.held], axis=1)
        begun = (episodes.q, episodes.first_goals, episodes.steps)
        seen = episodes.observation if self.simulator.world.layout.remembers else np.zeros((0, 0))
        parts = (*begun, *ours, episodes.drive, done, seen)
        return EpisodeStates._make(map(np.copy, parts))

    def observe(self) -> Numbers:
        """Normalised observations of all arms, shape (n_envs, n_observations)."""
        return self._normalized(self.episodes.observation)

    def _normalized(self, observations: NDArray[np.float64]) -> Numbers:
        seen = self._reflected("observations", observations, observations)
        return ((seen - self._mean) * self._scale).astype(np.float32)

    def _reflected(self, what: str, values: Reals, observations: Reals) -> Reals:
        """Observations or actions, reflected where a goal that came later lies on the left."""
        if self.mirror is None or not self.simulator.task.goal.changes:
            return values
        left = observations[:, [self.mirror.side]] > 0
        return np.where(left, values * getattr(self.mirror, what), values)

    def rates(self, observations: Reals) -> tuple[Reals, Reals]:
        """What a residual policy adds to, shape (n, n_actions), and its factor, shape (n, 1).

        Of other policies, zero and one.
        """
        if not self.config.residual:
            return np.zeros((1, 1), dtype=np.float32), np.ones((1, 1), dtype=np.float32)
        seen = self._reflected("observations", observations, observations)
        rates = seen[:, self.simulator.world.layout.places["resolved_rate"]]
        return rates, np.abs(rates).max(axis=1, keepdims=True)

    def step(self, actions: Reals) -> tuple[Numbers, NDArray[np.bool_]]:
        """Move arms by actions, shape (n_envs, n_actions); renew ended episodes.

        Returns rewards, and which episodes ended, shape (n_envs,) each.
        """
        episodes = self.episodes
        replaced = episodes.interventions.copy()
        actions = self._reflected("actions", actions, episodes.observation)
        if self.config.residual:
            self.simulator.world.layout.turn_away(episodes.observation, actions)
        result = self.simulator.step(episodes, actions)
        rewards = result.reward.copy()
        if len(replaced):
            rewards -= self.config.intervention_penalty * (episodes.interventions - replaced)
        self._total += rewards
        ended = result.truncated | result.terminated
        self.cut_short.append(np.flatnonzero(result.truncated & ~result.terminated))
        self.finals.append(self._normalized(episodes.observation[self.cut_short[-1]]))
        if ended.any():
            counted = ended & ~self.replayed
            self.returns.append(self._total[counted])
            self.successes.append(result.success[counted])
            self._renew(ended.nonzero()[0], ended & ~result.success)
        return rewards.astype(np.float32), ended

    def _renew(self, rows: NDArray[np.int64], missed: NDArray[np.bool_]) -> None:
        """Replace episodes; missed ones may be replayed."""
        config, episodes = self.config, self.episodes
        if config.replay_share:
            scenarios = self._start[missed], episodes.first_goals[missed]
            self.failed = self.failed.followed_by(*scenarios, config.replay_size)
        scenarios, self.replayed[rows] = self.failed.mixed(
            config.replay_share, self._rng, len(rows), self.next_scenarios
        )
        self._start[rows], episodes.goal[rows] = scenarios
        episodes.q[rows] = self._start[rows]
        self.simulator.begin(episodes, rows)
        self._total[rows] = 0.0
