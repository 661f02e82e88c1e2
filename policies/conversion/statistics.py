"""Which statistics normalise what a model of Stable-Baselines3 sees.

A model's file does not hold its ``VecNormalize``. Files of statistics are pickles, which run code:
one is opened only if it is named, or if Stable-Baselines3 or rl-zoo3 gave it the model's name.
"""

import pickle
from pathlib import Path
from typing import Any

import numpy as np

from kinarm._files import reading
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.observation import part_slices

NONE = "none"
"""Stands for a model without statistics."""

LYING_BESIDE = ("vecnormalize.pkl", "vec_normalize.pkl")
"""Usual names of statistics that do not say which model they are of."""

ROUNDING = 1e-3
"""How far the norm of a quaternion that nobody changed is from 1, at most."""


def find_vec_normalize(model: Path) -> Path | None:
    """Find the statistics that bear a model's name.

    ``prefix_vecnormalize_1000_steps.pkl`` is of the checkpoint ``prefix_1000_steps.zip`` beside it,
    ``id_1/id/vecnormalize.pkl`` of rl-zoo3's models in ``id_1``. Returns None if there are none.
    """
    folder, (prefix, _, number) = model.resolve().parent, model.stem[:-6].rpartition("_")
    places = [folder / folder.name.rpartition("_")[0] / LYING_BESIDE[0]]
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


def check_not_normalized(last: Any, n_joints: int, model: Path) -> None:
    """Refuse a model whose last observations in training were evidently normalised.

    Observations hold the orientations of the joints, quaternions of norm 1.
    Normalised, they have other norms.

    Parameters
    ----------
    last : ndarray, mapping or None
        The last observations of its training, shape (n_envs, n_observations),
        or their parts.
    n_joints : int
        Number of joints of the arm.
    model : Path
        The model's file.
    """
    start = part_slices(n_joints)["orientation"].start
    if isinstance(last, dict):  # of a goal-conditioned environment, whose goals are apart
        last, start = last.get("observation"), 0
    if last is None:
        return
    quaternions = np.asarray(last)[:, start : start + 4 * n_joints].reshape(-1, 4)
    changed = np.abs(np.linalg.norm(quaternions, axis=1) - 1) > ROUNDING
    if changed.mean() < 0.5:
        return
    beside = (model.parent / name for name in LYING_BESIDE)
    file = next((str(path) for path in beside if path.is_file()), "FILE")
    raise InvalidInputError(
        "the observations of its training were normalised, and no statistics bear its name: give "
        f"them (--vec-normalize {file}), or use none (--vec-normalize {NONE})"
    )
