"""Stable-Baselines3's normalisation of observations, which it keeps apart from the model."""

import pickle
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm._archive import reading
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.policies.conversion.pieces import Clip, Piece
from kinarm.policies.policy import Layer

Array = NDArray[np.float64]

FILES = ("vecnormalize.pkl", "vec_normalize.pkl")
"""Names that rl-zoo3 and the documentation of Stable-Baselines3 give to the statistics."""

UNLIMITED = 2.0**20
"""Stands for no limit where only some entries have one; scaling by it rounds nothing."""

WHOLE = ""
"""Key of an observation that is no dictionary."""


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
