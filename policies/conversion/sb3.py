"""Actors of Stable-Baselines3 and sb3-contrib as policies.

A model sees the observation, whole or in parts. The statistics that normalise it lie apart.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from kinarm.envs.environment import Interface
from kinarm.envs.goal import GoalInterface
from kinarm.errors import InvalidInputError
from kinarm.networks import Layer
from kinarm.observation_layout import ObservationLayout
from kinarm.policies.conversion.layers import (
    WHOLE,
    Piece,
    module_pieces,
    normalization,
    policy_of_pieces,
)
from kinarm.policies.conversion.models import (
    NONE,
    SB3Model,
    check_not_normalized,
    load_vec_normalize,
    sb3_model,
)
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy

COMPARED, ALIKE = 64, 1e-3
"""Observations for comparing a conversion with its model, and how closely."""

NO_PROBLEM = "the model does not say which problem it is for: give it (problem=, --problem)"

NOT_SETTINGS = ("verbose", "seed", "num_timesteps", "start_time", "tensorboard_log", "device")
"""Attributes of a model that do not tell how it was trained."""

ROUNDING = 1e-5
"""How closely the bounds of float32 spaces must agree."""


def policy_from_sb3(
    kind: "type[Policy]", given: Any, problem: ProblemLike | None, vec_normalize: Any
) -> "Policy":
    """Convert a model or its file to a `Policy`, given as ``kind``.

    Parameters
    ----------
    kind, given, problem, vec_normalize
        See `Policy.from_sb3`; the model may be an `SB3Model`, too.
    """
    model = sb3_model(given)
    if model.remembers:
        raise InvalidInputError(
            f"the model is recurrent ({type(model.policy).__name__}): kinarm's policies see one "
            "observation"
        )
    own = ReachProblem.load(problem) if problem is not None else model.problem
    if own is None:
        raise InvalidInputError(NO_PROBLEM)
    simulator = Simulator(own, threads=1)
    interface, selection, sizes = _model_inputs(model.policy, simulator)
    statistics, origin = _statistics_of(model, vec_normalize, simulator.world.layout)
    model.policy.set_training_mode(False)
    config = {
        key: value
        for key, value in model.attributes.items()
        if isinstance(value, int | float | str)
        and not key.startswith("_")
        and key not in NOT_SETTINGS
    }
    if origin is not None:
        config["vec_normalize"] = origin
    policy = policy_of_pieces(
        kind,
        [selection, *normalization(statistics, sizes), *_actor_pieces(model.policy)],
        own,
        algorithm=model.algorithm,
        recipe="sb3",
        seed=model.attributes.get("seed"),
        environment_steps=int(model.attributes["num_timesteps"]),
        config=config,
    )
    starts, goals = simulator.sample(np.random.default_rng(0), COMPARED)
    observations = simulator.world.observe(starts, goals)
    shown = interface.observe(observations)
    if statistics is not None:
        shown = statistics.normalize_obs(shown)
    expected, _ = model.policy.predict(shown, deterministic=True)
    apart = float(np.abs(policy(observations) - expected).max())
    if not apart <= ALIKE:
        raise InvalidInputError(
            f"the model does more than its network shows ({type(model.policy).__name__}): "
            f"converted, its actions differ by {apart:.2g}"
        )
    return policy


def _statistics_of(
    model: SB3Model, asked: Any, layout: ObservationLayout | None
) -> tuple[Any, str | None]:
    """The ``VecNormalize`` of a model's observations, or None, and where it is from to tell."""
    from stable_baselines3.common.vec_env import unwrap_vec_normalize

    if str(asked) == NONE:
        return None, NONE
    if asked is not None:
        is_file = isinstance(asked, str | Path)
        return load_vec_normalize(asked), str(asked) if is_file else "VecNormalize"
    statistics = unwrap_vec_normalize(model.env)
    if statistics is not None:
        return statistics, "VecNormalize of its environment"
    if layout is not None:
        check_not_normalized(model.attributes.get("_last_obs"), layout, model.file)
    return None, None if model.file is None else NONE


def _actor_pieces(policy: Any) -> Iterator[Piece]:
    """Pieces of the network of a policy's deterministic actions."""
    actor = getattr(policy, "actor", None)
    if actor is None:
        parts = [policy.mlp_extractor.policy_net, policy.action_net]
    elif hasattr(actor, "latent_pi"):
        parts = [actor.latent_pi, actor.mu]
    else:
        parts = [actor.mu]  # which ends in the function that limits actions
    for part in parts:
        yield from module_pieces(part)
    if policy.squash_output and len(parts) > 1:
        yield "tanh"


def native_statistics(
    model: SB3Model, problem: ProblemLike | None, vec_normalize: Any, *, wrapped: bool
) -> tuple[Any, str | None]:
    """Find the statistics of a model that is used as it is: in a wrapper, or with a memory.

    Parameters
    ----------
    model, problem, vec_normalize
        As for `Policy.from_sb3`.
    wrapped : bool
        Whether it sees a wrapper's observations, which are not checked.

    Returns
    -------
    tuple
        The ``VecNormalize`` of its observations or None, and where that is
        from.
    """
    if problem is None:
        raise InvalidInputError(NO_PROBLEM)
    simulator = Simulator(problem, threads=1)
    if not wrapped:
        _check_actions(model.policy.action_space, simulator)
        _check_observations(model.policy.observation_space, Interface(simulator), simulator)
    return _statistics_of(model, vec_normalize, None if wrapped else simulator.world.layout)


def _model_inputs(policy: Any, simulator: Simulator) -> tuple[Interface, Layer, dict[str, int]]:
    """Find out how a features extractor puts its inputs together.

    Returned are the interface of the model's environment, the map from the flat observation to the
    inputs, and the sizes of their parts in order.
    """
    _check_actions(policy.action_space, simulator)
    actor = getattr(policy, "actor", None)
    extractor = policy.pi_features_extractor if actor is None else actor.features_extractor
    kinds = {"FlattenExtractor": Interface, "CombinedExtractor": GoalInterface}
    parts = getattr(extractor, "extractors", {})
    computed = {type(part).__name__ for part in parts.values()} - {"Flatten"}
    if type(extractor).__name__ not in kinds or computed:
        raise InvalidInputError(
            f"the model computes features of observations ({type(extractor).__name__}): only "
            "policies whose networks see the observation itself can be converted"
        )
    interface = kinds[type(extractor).__name__](simulator)
    _check_observations(policy.observation_space, interface, simulator)
    shown = interface.observe(np.eye(simulator.n_observations))
    columns = {key: shown[key] for key in parts} if parts else {WHOLE: shown}
    rows = np.ascontiguousarray(np.concatenate(list(columns.values()), axis=1).T)
    sizes = {key: part.shape[1] for key, part in columns.items()}
    return interface, Layer(rows, np.zeros(len(rows))), sizes


def _check_actions(space: Any, simulator: Simulator) -> None:
    """Refuse actions other than fractions of the velocity limits."""
    n = simulator.n_actions
    fits = isinstance(space, Box) and space.shape == (n,)
    if not fits or (space.low != -1).any() or (space.high != 1).any():
        raise InvalidInputError(
            f"the model's actions are {space}; arm {simulator.arm.name!r} takes {n} numbers from "
            "-1 to 1"
        )


def _check_observations(space: Any, interface: Interface, simulator: Simulator) -> None:
    """Refuse observations that are not the arm's."""
    own: Any = interface.observation_space
    goals = simulator.world.layout.entries(of_goal=True)
    of_goal = {WHOLE: goals, "desired_goal": np.arange(3)}
    theirs, ours = _parts(space), _parts(own)
    same = theirs.keys() == ours.keys()
    if not same or not all(_agree(theirs[key], ours[key], of_goal.get(key)) for key in ours):
        raise InvalidInputError(
            f"the model's observations, {_described(space)}, are not those of arm "
            f"{simulator.arm.name!r}, {_described(own)}, within its bounds: was it trained in "
            "another environment, or in a wrapper that changes observations?"
        )


def _parts(space: Any) -> dict[str, Any]:
    """Parts of a space by their keys."""
    return dict(space.spaces) if isinstance(space, Dict) else {WHOLE: space}


def _described(space: Any) -> str:
    """Kind and shape of a space, for messages."""
    if isinstance(space, Dict):
        return ", ".join(f"{key} {each.shape}" for key, each in space.items())
    return f"{type(space).__name__} of shape {space.shape}"


def _agree(first: Any, second: Any, but_for: NDArray[np.int64] | None) -> bool:
    """Whether two boxes have the same shape and, but for some entries, bounds."""
    if first.shape != second.shape:
        return False
    ends, others = [first.low, first.high], [second.low, second.high]
    alike = np.isclose(ends, others, rtol=0, atol=ROUNDING)
    if but_for is not None:  # goals lie elsewhere in other problems
        alike[:, but_for] = True
    return bool(alike.all())
