"""Policies with random weights, and an arm that slides."""

import numpy as np

from kinarm import Arm, Simulator
from kinarm.policies import Policy
from kinarm.policies.policy import Layer
from kinarm.policies.provenance import Provenance


def policy_for(problem, *, activation="tanh", seed=0, mirror=None):
    """Two layers with random weights."""
    simulator = Simulator(problem, threads=1)
    rng, n_in, n_out = np.random.default_rng(seed), simulator.n_observations, simulator.n_actions
    std = rng.uniform(0.5, 2, n_in)
    std[::7] = 1e-8
    return Policy(
        mean=rng.normal(size=n_in),
        std=std,
        layers=(
            Layer(rng.normal(size=(16, n_in)) / 4, rng.normal(size=16)),
            Layer(rng.normal(size=(n_out, 16)) / 4, rng.normal(size=n_out) / 4),
        ),
        activations=(activation, "linear"),
        provenance=Provenance(
            algorithm="a", recipe="b", problem=problem.pinned, environment_steps=0
        ),
        mirror=mirror,
    )


def sliding(make_joint, write_robot):
    """A lift that carries two joints, on nothing."""
    limit = '<limit lower="-1" upper="2" velocity="{}" effort="0"/>'
    joints = [make_joint("prismatic", xyz="0 0 0.1", limit=limit.format(0.5))]
    joints += [make_joint(xyz="0.4 0 0", limit=limit.format(3), axis="0 1 0") for _ in range(2)]
    return Arm.load(write_robot(joints, tool="0.3 0 -0.1"))
