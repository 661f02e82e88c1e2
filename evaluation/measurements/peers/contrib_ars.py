"""sb3-contrib's Augmented Random Search beside kinarm's, to the same success."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sb3_contrib import ARS
from stable_baselines3.common.vec_env import VecNormalize

from kinarm.evaluation.measurements.peers.comparing import Comparison
from kinarm.evaluation.measurements.timing import Timing
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.learners import begin_training, state_policy
from kinarm.policies.policy import Policy
from kinarm.policies.ppo.learner import alone_in_torch
from kinarm.policies.recipes import recipe
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.simulator import PolicyFunction

LEVEL = 0.5
"""Share of trials at which a training is over."""
TRIALS = 200
BUDGET = 60.0
"""Time after which a training is given up [s]."""
BETWEEN_LOOKS = 0.25
"""Training between two looks at the policy [s]."""
TERMS = (
    "recipe `tuned` on `{problem}`, one thread each, the same {trials} trials, during which the "
    "clock stands still; N = {directions}, b = {top}, {episodes} episodes a direction, linear "
    "policy without bias, normalised observations, the recipe's reward. sb3-contrib cannot share "
    "scenarios between directions, normalises by statistics that change within an iteration, and "
    "steps {episodes} arms of the batch environment at a time"
)


class Attempt(NamedTuple):
    """A training that was stopped.

    Attributes
    ----------
    seconds : float
        How long it took, without judging [s].
    steps : int
        Environment steps.
    success : float
        Share of trials at its end.
    """

    seconds: float
    steps: int
    success: float

    @property
    def text(self) -> str:
        """In words."""
        steps = f"{self.steps / 1e3:,.0f} thousand steps"
        return f"{self.success:.0%} of trials after {self.seconds:.1f} s and {steps}"


def compare(policy: Policy, _: int) -> Iterator[Comparison]:
    """One training of each; the rates are environment steps in training.

    Raises
    ------
    MissingExtraError
        If Stable-Baselines3 is missing.
    """
    config: ARSConfig = recipe("ars", "tuned", problem=policy.problem)
    trials = TrialSet.draw(config.problem, TRIALS, 0)
    ours, theirs = train_ours(config, trials), train_theirs(config, trials)
    terms = TERMS.format(
        problem=config.problem.name,
        trials=TRIALS,
        directions=config.directions,
        top=config.top_directions,
        episodes=config.episodes,
    )
    yield Comparison(
        what=f"training by ARS; theirs {theirs.text}, ours {ours.text}",
        unit="steps/s",
        theirs=Timing(*[theirs.steps / theirs.seconds] * 2),
        ours=Timing(*[ours.steps / ours.seconds] * 2),
        terms=terms,
    )


def train_ours(config: ARSConfig, trials: TrialSet) -> Attempt:
    """Train with kinarm's ARS."""
    training = begin_training(config, threads=1)
    state = training.iterate(training.initial_state())  # compiles

    def iterate() -> int:
        nonlocal state
        state = training.iterate(state)
        return int(state.environment_steps)

    return attempt(iterate, lambda: state_policy(config, state), trials)


def train_theirs(config: ARSConfig, trials: TrialSet) -> Attempt:
    """Train with sb3-contrib's ARS, by the same settings as far as it has them."""
    problem = config.problem.replace(reward=config.reward)
    env = VecNormalize(
        sb3_vec_env(problem, config.episodes, threads=1),
        norm_reward=False,
    )
    model = ARS(
        "LinearPolicy",
        env,
        n_delta=config.directions,
        n_top=config.top_directions,
        learning_rate=config.step_size,
        delta_std=config.noise,
        n_eval_episodes=config.episodes,
        seed=config.seed,
    )

    def iterate() -> int:
        model.learn(1, reset_num_timesteps=False)
        return int(model.num_timesteps)

    def act(observations: NDArray[np.float64]) -> NDArray[Any]:
        seen = env.normalize_obs(observations.astype(np.float32))
        actions: NDArray[Any] = model.predict(seen, deterministic=True)[0]
        return actions

    with alone_in_torch():
        return attempt(iterate, lambda: act, trials)


def attempt(
    iterate: Callable[[], int], policy: Callable[[], Policy | PolicyFunction], trials: TrialSet
) -> Attempt:
    """Iterate until enough trials succeed, or the budget is spent.

    Parameters
    ----------
    iterate : callable
        One iteration; returns the environment steps so far.
    policy : callable
        The policy at present.
    trials : TrialSet
        What judges it.
    """
    seconds, looked, success = 0.0, 0.0, 0.0
    while True:
        began = time.perf_counter()
        steps = iterate()
        seconds += time.perf_counter() - began
        over = seconds >= BUDGET
        if over or seconds - looked >= BETWEEN_LOOKS:
            rollouts = trials.simulator.rollout(policy(), trials.starts, trials.goals)
            looked, success = seconds, float(rollouts.success.mean())
            if over or success >= LEVEL:
                return Attempt(seconds, steps, success)
