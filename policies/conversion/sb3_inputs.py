"""From an arm's observations to the inputs of a model of Stable-Baselines3.

The model sees the observation, whole or in parts, normalised if it was trained so. The statistics
of this normalisation lie apart from the model.
"""

import pickle
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from kinarm._archive import reading
from kinarm.envs.goal import GoalInterface
from kinarm.envs.interface import Interface
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.observation import Ranges, observation_bounds, part_slices
from kinarm.policies.conversion.layers import Clip, Piece
from kinarm.policies.policy import Layer
from kinarm.simulator import Simulator

Array = NDArray[np.float64]

FILES = ("vecnormalize.pkl", "vec_normalize.pkl")
"""Names that rl-zoo3 and the documentation of Stable-Baselines3 give to the statistics."""

UNLIMITED = 2.0**20
"""Stands for no limit where only some entries have one; scaling by it rounds nothing."""

WHOLE = ""
"""Key of an observation that is no dictionary."""


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


def find_vec_normalize(model: Path) -> Path | None:
    """Find a model's statistics where Stable-Baselines3 and rl-zoo3 write them.

    Beside ``folder/name.zip`` it is ``folder/vecnormalize.pkl``, ``folder/vec_normalize.pkl``,
    for a checkpoint ``folder/prefix_vecnormalize_1000_steps.pkl``, and in rl-zoo3's folder
    ``id_1`` it is ``id_1/id/vecnormalize.pkl``. Returns None if there are none.
    """
    folder, (prefix, _, number) = model.resolve().parent, model.stem[:-6].rpartition("_")
    places = [folder / name for name in FILES]
    places.append(folder / folder.name.rpartition("_")[0] / FILES[0])
    if model.stem.endswith("_steps"):
        places.insert(0, folder / f"{prefix}_vecnormalize_{number}_steps.pkl")
    return next((place for place in places if place.is_file()), None)


def load_vec_normalize(given: Any) -> Any:
    """A ``VecNormalize``, or the file of one, which runs code: open only files that you trust.

    Raises
    ------
    PolicyFileError
        If a file cannot be read, or it is something else.
    """
    if isinstance(given, str | Path):
        with (
            reading(repr(str(given)), "VecNormalize", PolicyFileError, of="Stable-Baselines3"),
            Path(given).open("rb") as f,
        ):
            given = pickle.load(f)
    if not hasattr(given, "norm_obs") or not hasattr(given, "clip_obs"):
        raise PolicyFileError(f"expected VecNormalize or its file, got {type(given).__name__}")
    return given


def normalization(
    statistics: Any, lower: Mapping[str, Array], upper: Mapping[str, Array]
) -> Iterator[Piece]:
    """What ``VecNormalize`` does to observations: (x - mean) / sqrt(var + epsilon), and a clip.

    Parameters
    ----------
    statistics : VecNormalize
        The wrapper, or None.
    lower, upper : mapping of str to ndarray
        What the parts of the observation range over, in the order of the network's inputs; an
        observation that is no dictionary is the part `WHOLE`. A clip that the ranges rule out is
        left out.

    Raises
    ------
    InvalidInputError
        If the statistics are of other observations.
    """
    if statistics is None or not statistics.norm_obs:
        return
    known = (
        statistics.obs_rms if isinstance(statistics.obs_rms, dict) else {WHOLE: statistics.obs_rms}
    )
    if not all(key in lower and known[key].mean.shape == lower[key].shape for key in known):
        raise InvalidInputError("VecNormalize has statistics of other observations than the model")
    scales, shifts, limits = [], [], []
    for key, low in lower.items():
        each = known.get(key)
        scale = 1 / np.sqrt(each.var + statistics.epsilon) if each else np.ones_like(low)
        scales.append(scale)
        shifts.append(-each.mean * scale if each else np.zeros_like(low))
        limits.append(np.full_like(low, statistics.clip_obs if each else UNLIMITED))
    scale, shift, limit = map(np.concatenate, (scales, shifts, limits))
    yield Layer(np.diag(scale), shift)
    ends = (np.concatenate(list(end.values())) * scale + shift for end in (lower, upper))
    if any((np.abs(end) > limit).any() for end in ends):
        yield Clip(-limit, limit)
