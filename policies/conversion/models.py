"""Models of Stable-Baselines3 and sb3-contrib, and which statistics normalise what they see.

A model's file does not hold its ``VecNormalize``. Files of statistics are pickles, which run code:
one is opened only if it is named, or if Stable-Baselines3 or rl-zoo3 gave it the model's name.
"""

import pickle
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinarm._files import reading
from kinarm.errors import InvalidInputError, MissingExtraError, PolicyFileError, needed
from kinarm.observation_layout import ObservationLayout
from kinarm.problem import ReachProblem

FAMILIES = ("TQCPolicy", "SACPolicy", "TD3Policy", "ActorCriticPolicy")
"""Classes of policies that can be converted."""


class SB3Model(NamedTuple):
    """What a conversion needs of a model; ``env`` and ``file`` are None if unknown."""

    policy: Any
    algorithm: str
    attributes: Mapping[str, Any]
    env: Any
    file: Path | None = None

    @property
    def remembers(self) -> bool:
        """Whether it is recurrent: it remembers earlier observations."""
        return any("Recurrent" in base.__name__ for base in type(self.policy).__mro__)

    @property
    def problem(self) -> ReachProblem | None:
        """The problem of its environment, if known."""
        try:
            problem = self.env.get_attr("simulator", 0)[0].problem
        except (AttributeError, EOFError, OSError):  # not an environment of kinarm
            return None
        return problem if isinstance(problem, ReachProblem) else None


def sb3_model(given: Any) -> SB3Model:
    """Take what a conversion needs from a model or its file."""
    if isinstance(given, SB3Model):
        return given
    if isinstance(given, str | Path):
        return saved_model(Path(given))
    if not hasattr(given, "policy") or not hasattr(given, "num_timesteps"):
        raise InvalidInputError(
            f"expected a model of Stable-Baselines3 or its file, got {type(given).__name__}"
        )
    _family(type(given.policy))
    return SB3Model(given.policy, type(given).__name__.lower(), vars(given), given.get_env())


def saved_model(path: Path) -> SB3Model:
    """Build the networks of a file, without the buffers of a training."""
    saving = needed("stable_baselines3.common.save_util", "stable-baselines3", "sb3")
    name = repr(str(path))
    told: Any = {"name": name, "kind": "model", "error": PolicyFileError, "of": "Stable-Baselines3"}
    try:
        with reading(**told), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about attributes that are not needed here
            data, parameters, _ = saving.load_from_zip_file(path, device="cpu")
    except PolicyFileError as error:
        if str(getattr(error.__cause__, "name", None)).startswith("sb3_contrib"):
            raise MissingExtraError("sb3-contrib", "zoo") from error
        raise
    if not data or not isinstance(data.get("policy_class"), type):
        raise PolicyFileError(f"{name} holds no policy that Stable-Baselines3 can build here")
    kind = data["policy_class"]
    family = _family(kind)
    with reading(**told):
        options = {key: each for key, each in data["policy_kwargs"].items() if key != "device"}
        if family == "ActorCriticPolicy":
            options = {"use_sde": data["use_sde"], **options}
        spaces = (data["observation_space"], data["action_space"])
        policy = kind(*spaces, lambda _: 0.0, **options)
        policy.load_state_dict(parameters["policy"])
    return SB3Model(policy, _algorithm_of(family, data), data, None, path)


def _family(kind: type) -> str:
    """The base class of a policy that can be converted, or is recurrent."""
    names = [base.__name__ for base in kind.__mro__]
    for family in FAMILIES:
        if family in names:
            return family
    raise InvalidInputError(
        f"cannot convert the policy {kind.__name__}; what can be converted: models of TQC, SAC, "
        "DDPG, TD3, PPO, A2C, TRPO"
    )


def _algorithm_of(family: str, data: Mapping[str, Any]) -> str:
    """Which algorithm a file is of, judged by its settings."""
    if family == "ActorCriticPolicy":
        return "ppo" if "clip_range" in data else "trpo" if "cg_max_steps" in data else "a2c"
    if family == "TD3Policy":
        return "ddpg" if data["policy_delay"] == 1 and not data["target_noise_clip"] else "td3"
    return "tqc" if family == "TQCPolicy" else "sac"


NONE = "none"
"""Stands for a model without statistics."""

ROUNDING = 1e-3
"""How far the norm of a quaternion that nobody changed is from 1, at most."""


def load_vec_normalize(given: Any) -> Any:
    """A ``VecNormalize``, or the file of one, which runs code: open only files that you trust.

    Raises PolicyFileError if a file cannot be read, or it is something else.
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


def check_not_normalized(last: Any, layout: ObservationLayout, model: Path | None) -> None:
    """Refuse a model whose last observations in training were evidently normalised.

    Observations hold the orientations of the joints, quaternions of norm 1.
    Normalised, they have other norms.

    Parameters
    ----------
    last : ndarray, mapping or None
        The last observations of its training, shape (n_envs, n_observations),
        or their parts.
    layout : ObservationLayout
        Where they are, if they are shown at all.
    model : Path, optional
        The model's file.
    """
    shown, place = np.arange(layout.size), layout.places.get("orientation")
    if isinstance(last, dict):  # of a goal-conditioned environment, whose goals are apart
        last, shown = last.get("observation"), layout.entries(of_goal=False)
    if last is None or place is None:
        return
    columns = np.searchsorted(shown, np.arange(place.start, place.stop))
    quaternions = np.asarray(last)[:, columns].reshape(-1, 4)
    changed = np.abs(np.linalg.norm(quaternions, axis=1) - 1) > ROUNDING
    if changed.mean() < 0.5:
        return
    places = ("*vec*normalize*.pkl", "*/vecnormalize.pkl")
    near = [each for place in places if model for each in model.parent.glob(place)]
    file = near[0] if len(near) == 1 else "FILE"
    raise InvalidInputError(
        "the observations of its training were normalised: give their statistics "
        f"(--vec-normalize {file}), or use none (--vec-normalize {NONE})"
    )
