"""Actors of Stable-Baselines3 and sb3-contrib as policies: of trained models, and of files."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kinarm._files import reading
from kinarm.errors import InvalidInputError, MissingExtraError, PolicyFileError
from kinarm.policies.conversion.layers import Piece, module_pieces, policy_of_pieces
from kinarm.policies.conversion.sb3_inputs import (
    ModelInputs,
    load_vec_normalize,
    model_inputs,
    normalization,
)
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy

COMPARED, ALIKE = 64, 1e-3
"""Observations on which every conversion is compared with its model, and how closely."""

FAMILIES = ("TQCPolicy", "SACPolicy", "TD3Policy", "ActorCriticPolicy")
"""Classes of policies that can be converted."""

NOT_SETTINGS = ("verbose", "seed", "num_timesteps", "start_time", "tensorboard_log", "device")
"""Attributes of a model that say nothing about how it was trained, or are kept elsewhere."""


class SB3Model(NamedTuple):
    """A model, as far as a conversion needs it; its environment is None if it is not known."""

    policy: Any
    algorithm: str
    attributes: Mapping[str, Any]
    env: Any

    @property
    def problem(self) -> ReachProblem | None:
        """The problem that its environment is of, if that is known."""
        try:
            problem = self.env.get_attr("simulator", 0)[0].problem
        except (AttributeError, EOFError, OSError):  # an environment that is none of kinarm's
            return None
        return problem if isinstance(problem, ReachProblem) else None


def policy_from_sb3(
    kind: "type[Policy]", given: Any, problem: ProblemLike | None, vec_normalize: Any
) -> "Policy":
    """Convert a model; see `Policy.from_sb3`.

    Parameters
    ----------
    kind : type
        `Policy`.
    given : BaseAlgorithm, str or Path
        The model, or its file.
    problem, vec_normalize
        The problem that the policy is for, and the ``VecNormalize`` of its observations, or its
        file; None stands for those of the model's environment.

    Raises
    ------
    KinarmError
        If it cannot be converted, or a file cannot be read.
    """
    model = sb3_model(given)
    from stable_baselines3.common.vec_env import unwrap_vec_normalize

    own = ReachProblem.load(problem) if problem is not None else model.problem
    if own is None:
        raise InvalidInputError(
            "the model does not say which problem it is for: give it (problem=, --problem)"
        )
    statistics = unwrap_vec_normalize(model.env)
    if vec_normalize is not None:
        statistics = load_vec_normalize(vec_normalize)
    simulator = Simulator(own, threads=1)
    inputs = model_inputs(model.policy, simulator)
    model.policy.set_training_mode(False)
    pieces = [
        inputs.selection,
        *normalization(statistics, inputs.sizes),
        *_actor_pieces(model.policy),
    ]
    config = _settings(model.attributes)
    if statistics is not None:
        is_file = isinstance(vec_normalize, str | Path)
        config["vec_normalize"] = str(vec_normalize) if is_file else True
    policy = policy_of_pieces(
        kind,
        pieces,
        own,
        algorithm=model.algorithm,
        recipe="sb3",
        seed=model.attributes.get("seed"),
        environment_steps=int(model.attributes["num_timesteps"]),
        config=config,
    )
    _check_same_actions(policy, model.policy, statistics, inputs, simulator)
    return policy


def _actor_pieces(policy: Any) -> Iterator[Piece]:
    """Steps of the network of a policy's deterministic actions, in their order."""
    actor = getattr(policy, "actor", None)
    if actor is None:
        parts = [policy.mlp_extractor.policy_net, policy.action_net]
    elif hasattr(actor, "latent_pi"):
        parts = [actor.latent_pi, actor.mu]
    else:
        parts = [actor.mu]  # which ends in the function that keeps actions in their range
    for part in parts:
        yield from module_pieces(part)
    if policy.squash_output and len(parts) > 1:
        yield "tanh"


def _settings(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """How a model was trained, by its attributes."""
    return {
        key: value
        for key, value in attributes.items()
        if isinstance(value, int | float | str)
        and not key.startswith("_")
        and key not in NOT_SETTINGS
    }


def _check_same_actions(
    policy: "Policy", original: Any, statistics: Any, inputs: ModelInputs, simulator: Simulator
) -> None:
    """Refuse a conversion that acts otherwise than its model, whose class may do more."""
    starts, goals = simulator.sample(np.random.default_rng(0), COMPARED)
    observations = simulator.world.observe(starts, goals)
    shown = inputs.interface.observe(observations)
    if statistics is not None:
        shown = statistics.normalize_obs(shown)
    expected, _ = original.predict(shown, deterministic=True)
    apart = float(np.abs(policy(observations) - expected).max())
    if not apart <= ALIKE:
        raise InvalidInputError(
            f"the model does more than its network shows ({type(original).__name__}): converted, "
            f"its actions differ by {apart:.2g}"
        )


def sb3_model(given: Any) -> SB3Model:
    """Take from a model, or from its file, what a conversion needs; see `Policy.from_sb3`."""
    if isinstance(given, str | Path):
        return _saved_model(Path(given))
    if not hasattr(given, "policy") or not hasattr(given, "num_timesteps"):
        raise InvalidInputError(
            f"expected a model of Stable-Baselines3 or its file, got {type(given).__name__}"
        )
    _family(type(given.policy))
    return SB3Model(given.policy, type(given).__name__.lower(), vars(given), given.get_env())


def _saved_model(path: Path) -> SB3Model:
    """Build the networks of a file, without the buffers that training them would need."""
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
    return SB3Model(policy, _algorithm_of(family, data), data, None)


def _family(kind: type) -> str:
    """The class of policies that a class belongs to, if it is one that can be converted."""
    names = [base.__name__ for base in kind.__mro__]
    if any("Recurrent" in name for name in names):
        raise InvalidInputError(
            f"the model is recurrent ({kind.__name__}): kinarm's policies see one observation"
        )
    for family in FAMILIES:
        if family in names:
            return family
    raise InvalidInputError(
        f"cannot convert the policy {kind.__name__}; what can be converted: models of TQC, SAC, "
        "DDPG, TD3, PPO, A2C"
    )


def _algorithm_of(family: str, data: Mapping[str, Any]) -> str:
    """Which algorithm a file is of; it does not say, but has that algorithm's settings."""
    if family == "ActorCriticPolicy":
        return "ppo" if "clip_range" in data else "a2c"
    if family == "TD3Policy":
        return "ddpg" if data["policy_delay"] == 1 and not data["target_noise_clip"] else "td3"
    return "tqc" if family == "TQCPolicy" else "sac"
