"""Results have the same bits whatever the processor, and whatever is compiled for it, can do."""

import os
import platform
import subprocess
import sys

import pytest
from numpy._core import _multiarray_umath as numpy_core

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64", reason="the instruction sets are x86-64's"
)

COMPUTE_AND_PRINT = """
import hashlib
from dataclasses import replace
import numpy as np
from kinarm import Simulator
from kinarm.policies import Oracle, load_policy, train_policy
from kinarm.policies.recipes import recipe

def show(*arrays):
    print(hashlib.sha256(b"".join(np.asarray(array).tobytes() for array in arrays)).hexdigest())

simulator = Simulator("both")
starts, goals = simulator.sample(np.random.default_rng(0), 64)
rollouts = simulator.rollout(load_policy("ppo-tuned-both-seed0"), starts, goals, record=True)
show(starts, goals, rollouts.returns, rollouts.steps, rollouts.paths)
world = simulator.world
poses = world.poses(starts)
pointing = world.inverse_kinematics(poses[:, :3, 3], [0, 0, -1])
posed = world.inverse_kinematics(poses)
show(poses, world.jacobians(starts), posed.configurations, pointing.configurations)
show(*world.clearance(starts)[::2])
solutions = Oracle("both").solve_batch(starts[:8], goals[:8])
show(solutions.steps_lower_bound, solutions.actions, solutions.distance_lower_bound)
for name, problem in (("paper", "right"), ("tuned", "both")):
    state = train_policy(recipe("ars", name, problem=problem, iterations=10)).state
    curve = np.array([point[:4] for point in state.curve])
    show(state.theta, state.normalizer.mean, state.normalizer.squares, curve)
small = dict(n_envs=50, n_steps=6, batch_size=100, n_epochs=2, iterations=3, net_arch=(40, 24))
for name in ("paper", "tuned"):
    state = train_policy(replace(recipe("ppo", name, problem="both", seed=1), **small)).state
    show(state.parameters, state.first_moment, state.second_moment, state.episodes.q)
"""

CAN = {name for name, present in numpy_core.__cpu_features__.items() if present}
AVX2_LIBRARIES = {"OPENBLAS_CORETYPE": "Haswell", "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F"}
PLAIN_LIBRARIES = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": " ".join(CAN.intersection(numpy_core.__cpu_dispatch__)),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
}
MACHINES = {
    "plain libraries": (PLAIN_LIBRARIES, "SSE3"),
    "libraries with AVX2": (AVX2_LIBRARIES, "FMA3"),
    "BLAS with AVX-512": ({"OPENBLAS_CORETYPE": "SkylakeX"}, "AVX512_SKX"),
    "plain kernels": ({"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"}, "SSE3"),
    "AVX2 kernels": ({"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": ""}, "FMA3"),
}
"""What makes a process believe to run on another machine, and what this one must have for it."""

SLOW = {"BLAS with AVX-512", "plain kernels", "AVX2 kernels"}
"""What most machines compute with anyway, and kernels, all of which are compiled anew."""


@pytest.fixture(scope="module")
def computed():
    """Computes in a process with other environment variables, and returns hashes of the results."""

    def compute(variables):
        command = [sys.executable, "-P", "-c", COMPUTE_AND_PRINT]
        done = subprocess.run(
            command, env=os.environ | variables, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    return compute


@pytest.fixture(scope="module")
def usual(computed):
    return computed({})


@pytest.mark.parametrize(
    "machine",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in MACHINES],
)
def test_rollouts_bounds_and_trainings_are_the_same_bits(machine, computed, usual):
    variables, needs = MACHINES[machine]
    if needs not in CAN:
        pytest.skip(f"this processor lacks {needs}")
    assert len(set(usual)) == 8
    assert computed(variables) == usual
