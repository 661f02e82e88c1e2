"""Models of Stable-Baselines3 and sb3-contrib, as far as conversions need them."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from kinarm._files import reading
from kinarm.errors import InvalidInputError, MissingExtraError, PolicyFileError
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
    try:
        from stable_baselines3.common.save_util import load_from_zip_file
    except ImportError as error:
        raise MissingExtraError("stable-baselines3", "sb3") from error
    name = repr(str(path))
    told: Any = {"name": name, "kind": "model", "error": PolicyFileError, "of": "Stable-Baselines3"}
    try:
        with reading(**told), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about attributes that are not needed here
            data, parameters, _ = load_from_zip_file(path, device="cpu")
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
        "DDPG, TD3, PPO, A2C"
    )


def _algorithm_of(family: str, data: Mapping[str, Any]) -> str:
    """Which algorithm a file is of, judged by its settings."""
    if family == "ActorCriticPolicy":
        return "ppo" if "clip_range" in data else "a2c"
    if family == "TD3Policy":
        return "ddpg" if data["policy_delay"] == 1 and not data["target_noise_clip"] else "td3"
    return "tqc" if family == "TQCPolicy" else "sac"
