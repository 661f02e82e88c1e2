"""Scenarios of an iteration: who faces the same, and which failed ones come again."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.failed_scenarios import FailedScenarios, StartsAndGoals
from kinarm.networks import Mirror
from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.ars.kernels import mean_and_deviation
from kinarm.policies.mirror import sample_seen
from kinarm.rollouts import Rollouts
from kinarm.simulator import Simulator


class Scenarios(NamedTuple):
    """Different scenarios of an iteration.

    All of them, repeated ``copies`` times, are those of its episodes in the order sign, direction,
    episode: 2 N times ``episodes``.

    Attributes
    ----------
    starts : ndarray, shape (n, n_joints)
        Configurations [rad or m].
    goals : ndarray, shape (n, 3)
        Goal positions [m].
    replayed : ndarray of bool, shape (n,)
        Which were failed before.
    copies : int
        Episodes that face each of them.
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    replayed: NDArray[np.bool_]
    copies: int

    @property
    def of_all_episodes(self) -> StartsAndGoals:
        """Starts and goals of all episodes."""
        if self.copies == 1:
            return self.starts, self.goals
        return np.tile(self.starts, (self.copies, 1)), np.tile(self.goals, (self.copies, 1))

    def outcome_of_new(self, rollouts: Rollouts) -> tuple[float, float, float]:
        """Mean and deviation of the returns of new scenarios, and the share that succeeded.

        NaN if there are none.
        """
        returns, success = rollouts.returns, rollouts.success
        if self.replayed.any():
            new = np.tile(~self.replayed, self.copies)
            returns, success = returns[new], success[new]
            if not len(returns):
                return math.nan, math.nan, math.nan
        return *mean_and_deviation(returns), int(np.count_nonzero(success)) / len(success)


def draw_shared(
    config: ARSConfig,
    simulator: Simulator,
    rng: np.random.Generator,
    failed: FailedScenarios,
    mirror: Mirror | None = None,
) -> Scenarios:
    """Draw the scenarios of an iteration, shared and replayed as configured.

    With a mirror, new ones with goals to the left are reflected.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    simulator : Simulator
        Draws starts and goals.
    rng : numpy.random.Generator
        Random numbers of the iteration.
    failed : FailedScenarios
        What may be replayed.
    mirror : Mirror, optional
        Reflects new scenarios with goals to the left.
    """
    copies = {"none": 1, "pair": 2, "iteration": 2 * config.directions}[config.sharing]

    def draw(places: NDArray[np.int64]) -> StartsAndGoals:
        return sample_seen(mirror, simulator, rng, len(places))

    count = 2 * config.directions * config.episodes // copies
    (starts, goals), replayed = failed.mixed(config.replay_share, rng, count, draw)
    return Scenarios(starts, goals, replayed, copies)


def failed_after(
    config: ARSConfig, failed: FailedScenarios, scenarios: Scenarios, rollouts: Rollouts
) -> FailedScenarios:
    """Add the scenarios that at least half of the policies that faced them failed.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    failed : FailedScenarios
        Those before the iteration.
    scenarios : Scenarios
        What its policies faced.
    rollouts : Rollouts
        How they did.
    """
    if not config.replay_share:
        return failed
    reached = np.count_nonzero(rollouts.success.reshape(scenarios.copies, -1), axis=0)
    missed = 2 * reached <= scenarios.copies
    return failed.followed_by(scenarios.starts[missed], scenarios.goals[missed], config.replay_size)
