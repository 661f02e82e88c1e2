"""What a model of Stable-Baselines3 sees of an arm, and what it may do."""

from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from kinarm.envs.goal import GoalInterface
from kinarm.envs.interface import Interface
from kinarm.errors import InvalidInputError
from kinarm.observation import Ranges, observation_bounds, part_slices
from kinarm.policies.conversion.vec_normalize import WHOLE
from kinarm.policies.policy import Layer
from kinarm.simulator import Simulator

Array = NDArray[np.float64]

ROUNDING = 1e-5
"""How exactly the bounds of a space of float32 have to agree."""


class ModelInputs(NamedTuple):
    """How the inputs of a model's network follow from observations.

    Attributes
    ----------
    interface : Interface
        Shows observations as the model's environment does.
    selection : Layer
        From the flat observation to the network's inputs.
    lower, upper : dict of str to ndarray
        What the parts of the inputs range over, in their order, for goals within the arm's reach.
    """

    interface: Interface
    selection: Layer
    lower: dict[str, Array]
    upper: dict[str, Array]


def model_inputs(policy: Any, simulator: Simulator) -> ModelInputs:
    """Find out how a policy's features extractor puts its inputs together.

    Raises
    ------
    InvalidInputError
        If it computes features, or the policy has other observations or actions than the arm.
    """
    _check_actions(policy.action_space, simulator)
    actor = getattr(policy, "actor", None)
    extractor = policy.pi_features_extractor if actor is None else actor.features_extractor
    kinds = {"FlattenExtractor": Interface, "CombinedExtractor": GoalInterface}
    parts = {type(part).__name__ for part in getattr(extractor, "extractors", {}).values()}
    if type(extractor).__name__ not in kinds or parts - {"Flatten"}:
        raise InvalidInputError(
            f"the model computes features of observations ({type(extractor).__name__}): only "
            "policies whose networks see the observation itself can be converted"
        )
    interface = kinds[type(extractor).__name__](simulator)
    _check_observations(policy.observation_space, interface, simulator)
    keys = [*extractor.extractors] if isinstance(interface, GoalInterface) else [WHOLE]
    units = np.eye(simulator.n_observations)
    shown = interface.observe(units)
    columns = {key: (shown if key == WHOLE else shown[key]) for key in keys}
    rows = np.ascontiguousarray(np.concatenate(list(columns.values()), axis=1).T)
    low, high = _attainable(simulator)
    positive, negative = np.maximum(rows, 0.0), np.minimum(rows, 0.0)
    ends = (positive @ low + negative @ high, positive @ high + negative @ low)
    cuts = np.cumsum([part.shape[1] for part in columns.values()])[:-1]
    lower, upper = (dict(zip(keys, np.split(end, cuts), strict=True)) for end in ends)
    return ModelInputs(interface, Layer(rows, np.zeros(len(rows))), lower, upper)


def _check_actions(space: Any, simulator: Simulator) -> None:
    """Refuse actions that are not fractions of the joints' velocity limits."""
    if not isinstance(space, Box):
        raise InvalidInputError(f"the model's actions are no vectors: {_described(space)}")
    if space.shape != (simulator.n_actions,) or (space.low != -1).any() or (space.high != 1).any():
        raise InvalidInputError(
            f"the model's actions are {_described(space)} from {space.low.min():g} to "
            f"{space.high.max():g}; arm {simulator.arm.name!r} takes {simulator.n_actions} numbers "
            "from -1 to 1"
        )


def _check_observations(space: Any, interface: Interface, simulator: Simulator) -> None:
    """Refuse observations that are not those of an arm."""
    own: Any = interface.observation_space
    if isinstance(space, Box) and isinstance(own, Box):
        frames, rest = divmod(int(np.prod(space.shape)), own.shape[0])
        if frames > 1 and not rest:
            raise InvalidInputError(
                f"the model sees {frames} observations at once (a frame stack): kinarm's policies "
                "see one"
            )
        if space.shape == own.shape and _agree(space, _space_of_goals(space, simulator)):
            return
    elif isinstance(space, Dict) and isinstance(own, Dict) and set(space) == set(own):
        fixed = (_agree(space[key], own[key]) for key in own if key != "desired_goal")
        if all(fixed) and space["desired_goal"].shape == own["desired_goal"].shape:
            return
    raise InvalidInputError(
        f"the model's observations, {_described(space)}, are not those of arm "
        f"{simulator.arm.name!r}, {_described(own)}, within its bounds: was it trained in another "
        "environment, or in a wrapper that changes observations?"
    )


def _described(space: Any) -> str:
    """Kind and shape of a space, in a line."""
    if isinstance(space, Dict):
        return ", ".join(f"{key} {each.shape}" for key, each in space.items())
    return f"{type(space).__name__} of shape {space.shape}"


def _space_of_goals(space: Any, simulator: Simulator) -> Any:
    """Bounds of an arm's observations if goals lie where a space of observations says."""
    goals = part_slices(simulator.arm.n_joints)["goal"]
    ranges = Ranges(space.low[goals], space.high[goals], simulator.arm.reach)
    return Box(*observation_bounds(ranges, simulator.arm.n_joints), dtype=np.float64)


def _agree(first: Any, second: Any) -> bool:
    """Whether two boxes have the same shape and bounds, to within rounding."""
    if first.shape != second.shape:
        return False
    ends = ((first.low, second.low), (first.high, second.high))
    return all(np.allclose(a, b, rtol=0, atol=ROUNDING) for a, b in ends)


def _attainable(simulator: Simulator) -> tuple[Array, Array]:
    """Bounds of observations for all goals within the arm's reach, to within the tolerance."""
    reach = simulator.arm.reach
    corner = np.full(3, reach + simulator.task.tolerance)
    return observation_bounds(Ranges(-corner, corner, reach), simulator.arm.n_joints)
