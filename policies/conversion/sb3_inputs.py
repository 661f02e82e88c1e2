"""From an arm's observations to the inputs of a model of Stable-Baselines3.

The model sees the observation, whole or in parts, normalised if it was trained so. The statistics
of this normalisation lie apart from the model.
"""

import pickle
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Dict

from kinarm._files import reading
from kinarm.envs.environment import Interface
from kinarm.envs.goal import GoalInterface
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.networks import Layer
from kinarm.observation import OBSERVATION, part_slices
from kinarm.policies.conversion.layers import Clip, Piece
from kinarm.simulator import Simulator

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

    The interface shows observations as the model's environment does; the selection leads from the
    flat observation to the inputs, whose parts have these sizes, in their order.
    """

    interface: Interface
    selection: Layer
    sizes: dict[str, int]


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
    return ModelInputs(interface, Layer(rows, np.zeros(len(rows))), sizes)


def _check_actions(space: Any, simulator: Simulator) -> None:
    """Refuse actions that are not fractions of the joints' velocity limits."""
    n = simulator.n_actions
    fits = isinstance(space, Box) and space.shape == (n,)
    if not fits or (space.low != -1).any() or (space.high != 1).any():
        raise InvalidInputError(
            f"the model's actions are {space}; arm {simulator.arm.name!r} takes {n} numbers from "
            "-1 to 1"
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
    places = part_slices(simulator.arm.n_joints)
    goals = [places[part.name] for part in OBSERVATION if part.of_goal]
    of_goal = {WHOLE: goals, "desired_goal": [slice(None)]}
    theirs, ours = _parts(space), _parts(own)
    same = theirs.keys() == ours.keys()
    if not same or not all(_agree(theirs[key], ours[key], of_goal.get(key, ())) for key in ours):
        raise InvalidInputError(
            f"the model's observations, {_described(space)}, are not those of arm "
            f"{simulator.arm.name!r}, {_described(own)}, within its bounds: was it trained in "
            "another environment, or in a wrapper that changes observations?"
        )


def _parts(space: Any) -> dict[str, Any]:
    """Parts of a space by their keys."""
    return dict(space.spaces) if isinstance(space, Dict) else {WHOLE: space}


def _described(space: Any) -> str:
    """Kind and shape of a space, in a line."""
    if isinstance(space, Dict):
        return ", ".join(f"{key} {each.shape}" for key, each in space.items())
    return f"{type(space).__name__} of shape {space.shape}"


def _agree(first: Any, second: Any, but_for: Iterable[slice] = ()) -> bool:
    """Whether two boxes have the same shape and, but for some entries, bounds."""
    if first.shape != second.shape:
        return False
    ends, others = [first.low, first.high], [second.low, second.high]
    alike = np.isclose(ends, others, rtol=0, atol=ROUNDING)
    for part in but_for:  # goals lie elsewhere in other problems
        alike[:, part] = True
    return bool(alike.all())


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


def normalization(statistics: Any, sizes: Mapping[str, int]) -> Iterator[Piece]:
    """The map by ``VecNormalize``: (x - mean) / sqrt(var + epsilon), and a clip.

    It has the statistics of some parts of the inputs, whose sizes are given in their order.

    Raises
    ------
    InvalidInputError
        If the statistics are of other observations.
    """
    if statistics is None or not statistics.norm_obs:
        return
    known = statistics.obs_rms
    known = known if isinstance(known, dict) else {WHOLE: known}
    if not all(each.mean.shape == (sizes.get(key),) for key, each in known.items()):
        raise InvalidInputError("VecNormalize has statistics of other observations than the model")
    n, end = sum(sizes.values()), 0
    scale, shift, limit = np.ones(n), np.zeros(n), np.full(n, UNLIMITED)
    for key, size in sizes.items():
        place, end = slice(end, end + size), end + size
        if key in known:
            scale[place] = 1 / np.sqrt(known[key].var + statistics.epsilon)
            shift[place] = -known[key].mean * scale[place]
            limit[place] = statistics.clip_obs
    yield Layer(np.diag(scale), shift)
    if np.isfinite(statistics.clip_obs):
        yield Clip(-limit, limit)
