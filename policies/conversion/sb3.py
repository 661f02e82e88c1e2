"""Actors of Stable-Baselines3 and sb3-contrib as policies."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.policies.conversion.pieces import Piece, chained
from kinarm.policies.conversion.sb3_inputs import ModelInputs, model_inputs
from kinarm.policies.conversion.sb3_models import SB3Model, sb3_model
from kinarm.policies.conversion.torch_modules import module_pieces
from kinarm.policies.conversion.vec_normalize import load_vec_normalize, normalization
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import Provenance, package_versions
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator

COMPARED, ALIKE = 64, 1e-3
"""Observations on which every conversion is compared with its model, and how closely."""


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
