"""Transfer by reflection: what a policy does on the left, its mirror image does on the right."""

from dataclasses import replace
from typing import Any

import numpy as np

from kinarm.evaluation.trials import TrialSet
from kinarm.networks import Mirror
from kinarm.policies.mirror import REFLECTION, find_mirror
from kinarm.policies.policy import Layer, Policy


def with_mirror(policy: Policy, mirror: Mirror) -> Policy:
    """A policy that does on the left what the given one does there, and its mirror image elsewhere.

    Policies with a mirror see goals on the left reflected (`kinarm.Networks`). So its layers are
    those of the mirror image of the given policy, which differ from its own in signs.
    """
    *first, last = policy.layers
    signs = mirror.actions
    layers = [*first, Layer(signs[:, None] * last.weights, signs * last.bias)]
    layers[0] = Layer(layers[0].weights * mirror.observations, layers[0].bias)
    mean = policy.mean * mirror.observations
    return replace(policy, mean=mean, layers=tuple(layers), mirror=mirror)


def reflection_of(policy: Policy, trials: TrialSet) -> dict[str, Any]:
    """Compare trials and their mirror images, which a policy with a mirror faces.

    Returns
    -------
    dict
        ``problem``, ``trials``, ``deviation``, by which a joint differs from its mirror image at
        most in any step that both take [rad], and ``differing``, the trials that end after
        another number of steps or otherwise.
    """
    simulator = trials.simulator
    mirror = find_mirror(simulator.world)
    signs = np.ones(trials.starts.shape[1])
    signs[: len(mirror.actions)] = mirror.actions
    mirrored = with_mirror(policy, mirror)
    done = simulator.rollout(mirrored, trials.starts, trials.goals, record=True)
    image = simulator.rollout(
        mirrored, trials.starts * signs, trials.goals * REFLECTION, record=True
    )
    same = (
        (done.steps == image.steps)
        & (done.success == image.success)
        & (done.collision == image.collision)
    )
    apart = np.abs(done.paths * signs - image.paths)
    return {
        "problem": trials.problem.name,
        "trials": len(trials),
        "deviation": float(np.nanmax(apart)),
        "differing": int((~same).sum()),
    }
