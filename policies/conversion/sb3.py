"""Actors of Stable-Baselines3 and sb3-contrib as policies: of trained models, and of files."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinarm._archive import reading
from kinarm.errors import InvalidInputError, MissingExtraError, PolicyFileError
from kinarm.policies.conversion.layers import Piece, chained, module_pieces
from kinarm.policies.conversion.sb3_inputs import (
    ModelInputs,
    load_vec_normalize,
    model_inputs,
    normalization,
)
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import Provenance, package_versions
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator

COMPARED, ALIKE = 64, 1e-3
"""Observations on which every conversion is compared with its model, and how closely."""

FAMILIES = {
    "TQCPolicy": ("tqc",),
    "SACPolicy": ("sac",),
    "TD3Policy": ("ddpg", "td3"),
    "ActorCriticPolicy": ("ppo", "a2c"),
}
"""Classes of policies that can be converted, and the algorithms that train them."""

READING = ("model", PolicyFileError)
"""What is read, and what is raised where it cannot be."""

CONTRIB = ("sb3_contrib", "sb3_contrib.tqc", "sb3_contrib.tqc.policies")
"""Modules that models of sb3-contrib need."""

NOT_SETTINGS = ("verbose", "seed", "num_timesteps", "start_time", "tensorboard_log", "device")
"""Attributes of a model that say nothing about how it was trained, or are kept elsewhere."""


class SB3Model(NamedTuple):
    """What a conversion needs of a model.

    Attributes
    ----------
    policy : BasePolicy
        The networks.
    algorithm : str
        Such as ``"ppo"``.
    steps : int
        Environment steps that it was trained for.
    seed : int or None
        Seed of the training, if there was one.
    settings : dict
        Settings of the training that JSON can hold.
    env : VecEnv or None
        What it was trained in, if that is known.
    """

    policy: Any
    algorithm: str
    steps: int
    seed: int | None
    settings: dict[str, Any]
    env: Any

    @property
    def problem(self) -> ReachProblem | None:
        """The problem that its environment is of, if that is known."""
        if self.env is None:
            return None
        try:
            problem = self.env.get_attr("simulator", 0)[0].problem
        except (AttributeError, EOFError, OSError):  # an environment that is none of kinarm's
            return None
        return problem if isinstance(problem, ReachProblem) else None

    @property
    def vec_normalize(self) -> Any:
        """What normalises the observations of its environment, if that is known; or None."""
        env = self.env
        while env is not None and type(env).__name__ != "VecNormalize":
            env = getattr(env, "venv", None)
        return env


def policy_from_sb3(
    given: Any, problem: ProblemLike | None = None, vec_normalize: Any = None
) -> Policy:
    """Convert a model; see `Policy.from_sb3`."""
    model = sb3_model(given)
    own = ReachProblem.load(problem) if problem is not None else model.problem
    if own is None:
        raise InvalidInputError(
            "the model does not say which problem it is for: give it (problem=, --problem)"
        )
    statistics = model.vec_normalize
    if vec_normalize is not None:
        statistics = load_vec_normalize(vec_normalize)
    simulator = Simulator(own, threads=1)
    inputs = model_inputs(model.policy, simulator)
    model.policy.set_training_mode(False)
    pieces = [
        inputs.selection,
        *normalization(statistics, inputs.lower, inputs.upper),
        *_actor_pieces(model.policy),
    ]
    layers, activations = chained(pieces, simulator.n_observations)
    policy = Policy(
        mean=np.zeros(simulator.n_observations),
        std=np.ones(simulator.n_observations),
        layers=layers,
        activations=activations,
        provenance=_provenance(model, own, statistics, vec_normalize),
    )
    _check_same_actions(policy, model.policy, statistics, inputs, simulator)
    return policy


def _actor_pieces(policy: Any) -> Iterator[Piece]:
    """What the network of a policy's deterministic actions does, step by step."""
    actor = getattr(policy, "actor", None)
    if actor is None:
        yield from module_pieces(policy.mlp_extractor.policy_net)
        yield from module_pieces(policy.action_net)
    elif hasattr(actor, "latent_pi"):
        yield from module_pieces(actor.latent_pi)
        yield from module_pieces(actor.mu)
    else:
        yield from module_pieces(actor.mu)
        return  # which ends in the function that keeps actions in their range
    if policy.squash_output:
        yield "tanh"


def _provenance(model: SB3Model, problem: ReachProblem, statistics: Any, source: Any) -> Provenance:
    """Where a converted policy, and what normalised its observations, come from."""
    settings = dict(model.settings)
    if statistics is not None:
        settings["vec_normalize"] = str(source) if isinstance(source, str | Path) else True
    return Provenance(
        algorithm=model.algorithm,
        recipe="sb3",
        problem=problem.pinned,
        seed=model.seed,
        environment_steps=model.steps,
        config=settings,
        versions=package_versions(),
    )


def _check_same_actions(
    policy: Policy, original: Any, statistics: Any, inputs: ModelInputs, simulator: Simulator
) -> None:
    """Refuse a conversion that acts otherwise than its model.

    Classes of a user's own can compute what their networks do not show.
    """
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
    """Take from a model, or from the file that its ``save`` wrote, what a conversion needs.

    Loading such a file runs code in it: open only files that you trust.

    Raises
    ------
    InvalidInputError
        If it is no model, or none of a family that can be converted.
    PolicyFileError
        If the file cannot be read, or is something else.
    MissingExtraError
        If Stable-Baselines3 is not installed.
    """
    if isinstance(given, str | Path):
        return _saved_model(Path(given))
    if not hasattr(given, "policy") or not hasattr(given, "num_timesteps"):
        raise InvalidInputError(
            f"expected a model of Stable-Baselines3 or its file, got {type(given).__name__}"
        )
    _check_family(type(given.policy))
    name = type(given).__name__.lower()
    return _described(vars(given), given.policy, name, given.get_env())


def _saved_model(path: Path) -> SB3Model:
    """Build the networks of a file, without the buffers that training them would need."""
    try:
        from stable_baselines3.common.save_util import load_from_zip_file
    except ImportError as error:
        raise MissingExtraError("stable-baselines3", "ppo") from error
    name = repr(str(path))
    try:
        with reading(name, *READING, of="Stable-Baselines3"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about attributes that are not needed here
            data, parameters, _ = load_from_zip_file(path, device="cpu")
    except PolicyFileError as error:
        if getattr(error.__cause__, "name", None) in CONTRIB:
            raise MissingExtraError("sb3-contrib", "zoo") from error
        raise
    if not data or not isinstance(data.get("policy_class"), type):
        raise PolicyFileError(f"{name} holds no policy that Stable-Baselines3 can build here")
    kind = data["policy_class"]
    _check_family(kind)
    with reading(name, *READING, of="Stable-Baselines3"):
        options = {key: each for key, each in data["policy_kwargs"].items() if key != "device"}
        if _family(kind) == "ActorCriticPolicy":
            options = {"use_sde": data["use_sde"], **options}
        spaces = (data["observation_space"], data["action_space"])
        policy = kind(*spaces, lambda _: 0.0, **options)
        policy.load_state_dict(parameters["policy"])
    return _described(data, policy, _algorithm_of(_family(kind), data), None)


def _described(attributes: Mapping[str, Any], policy: Any, algorithm: str, env: Any) -> SB3Model:
    """A model by its attributes."""
    settings = {
        key: value
        for key, value in attributes.items()
        if isinstance(value, int | float | str)
        and not key.startswith("_")
        and key not in NOT_SETTINGS
    }
    seed = attributes.get("seed")
    return SB3Model(policy, algorithm, int(attributes["num_timesteps"]), seed, settings, env)


def _family(kind: type) -> str | None:
    """The class of policies that a class belongs to, if it is one that can be converted."""
    names = [base.__name__ for base in kind.__mro__]
    return next((family for family in FAMILIES if family in names), None)


def _check_family(kind: type) -> None:
    """Refuse policies that are no single feed-forward network."""
    if any("Recurrent" in base.__name__ for base in kind.__mro__):
        raise InvalidInputError(
            f"the model is recurrent ({kind.__name__}): kinarm's policies see one observation"
        )
    if _family(kind) is None:
        algorithms = ", ".join(name for names in FAMILIES.values() for name in names)
        raise InvalidInputError(
            f"cannot convert the policy {kind.__name__}; what can be converted: models of "
            f"{algorithms.upper()}"
        )


def _algorithm_of(family: str | None, data: Mapping[str, Any]) -> str:
    """Which algorithm a file is of; it does not say, but has that algorithm's settings."""
    if family == "ActorCriticPolicy":
        return "ppo" if "clip_range" in data else "a2c"
    if family == "TD3Policy":
        return "ddpg" if data["policy_delay"] == 1 and not data["target_noise_clip"] else "td3"
    return "tqc" if family == "TQCPolicy" else "sac"
