"""Proximal Policy Optimization by Stable-Baselines3 (Schulman et al. 2017; Raffin et al. 2021)."""

import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from kinarm.errors import MissingExtraError
from kinarm.policies.curve import CurvePoint
from kinarm.policies.policy import Policy
from kinarm.policies.ppo_config import PPOConfig
from kinarm.policies.ppo_state import PPOState


class PPOResult(NamedTuple):
    """A trained policy and how it came about.

    Attributes
    ----------
    policy : Policy
        The trained policy: the actor's mean action.
    curve : tuple of CurvePoint
        One point per iteration.
    simulator_time : float
        Part of the wall time that was spent in the simulator [s].
    """

    policy: Policy
    curve: tuple[CurvePoint, ...]
    simulator_time: float


def train_ppo(
    config: PPOConfig,
    *,
    state: PPOState | None = None,
    on_iteration: Callable[[PPOState], object] | None = None,
    tensorboard: str | Path | None = None,
) -> PPOResult:
    """Train a neural policy.

    The training runs on one thread: its networks and batches are small, and so the result does
    not depend on the number of processors. Several seeds are best trained by as many processes.

    Parameters
    ----------
    config : PPOConfig
        The settings.
    state : PPOState, optional
        Where to go on; the result equals that of an uninterrupted training bit for bit.
    on_iteration : callable, optional
        Called with the state after every iteration.
    tensorboard : str or Path, optional
        Folder for the logs of Stable-Baselines3.

    Raises
    ------
    MissingExtraError
        If Stable-Baselines3 is not installed, or TensorBoard if it is asked for.
    InvalidInputError
        If the state is not one of such a training.
    """
    require_ppo(tensorboard=tensorboard is not None)
    from kinarm.policies.ppo_learner import PPOLearner, alone_in_torch

    with alone_in_torch():
        state = state or PPOLearner.initial_state(config)
        learner = PPOLearner(config, state.normalizer, tensorboard)
        began = time.perf_counter() - state.wall_time
        while state.iteration < config.iterations:
            state = learner.iterate(state, began)
            if on_iteration is not None:
                on_iteration(state)
        return PPOResult(learner.policy(state), state.curve, state.simulator_time)


def ppo_policy(config: PPOConfig, state: PPOState) -> Policy:
    """Freeze a state of a training into a policy, which takes the actor's mean action.

    Parameters
    ----------
    config : PPOConfig
        The settings.
    state : PPOState
        The state.
    """
    require_ppo()
    from kinarm.policies.ppo_learner import PPOLearner

    return PPOLearner(config, state.normalizer).policy(state)


def require_ppo(*, tensorboard: bool = False) -> None:
    """Refuse to go on without the packages that PPO needs.

    Raises
    ------
    MissingExtraError
        If one is missing; it says how to install it.
    """
    packages = ("torch", "stable_baselines3", *(["tensorboard"] if tensorboard else []))
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(package, "ppo")
