"""Hashes of what kinarm computes, in a process that may take its processor for another one."""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import cache

COMPUTE_AND_PRINT = """
import hashlib
from dataclasses import replace
import numpy as np
from kinarm import Simulator
from kinarm.goals import GoalSpecification
from kinarm.policies import Oracle, load_policy, plan, train_policy
from kinarm.policies.recipes import recipe
from kinarm.scene import Obstacle, Scene

def show(*arrays):
    print(hashlib.sha256(b"".join(np.asarray(array).tobytes() for array in arrays)).hexdigest())

simulator = Simulator("both")
starts, goals = simulator.sample(np.random.default_rng(0), 64)
rollouts = simulator.rollout(load_policy("ppo-best-both-seed0"), starts, goals, record=True)
show(starts, goals, rollouts.returns, rollouts.steps, rollouts.paths)
world = simulator.world
poses = world.poses(starts)
pointing = world.inverse_kinematics(poses[:, :3, 3], [0, 0, -1])
posed = world.inverse_kinematics(poses)
show(poses, posed.configurations, pointing.configurations)
solutions = Oracle("both").solve_batch(starts[:8], goals[:8])
show(solutions.steps_lower_bound, solutions.actions, solutions.final_distance)
posed = simulator.problem.replace(goal=GoalSpecification(kind="pose", rotation_tolerance=0.2))
oracle = Oracle(posed)
solutions = oracle.solve_batch(*oracle.simulator.sample(np.random.default_rng(0), 8))
show(solutions.steps_lower_bound, solutions.actions, solutions.final_distance)
wall = Obstacle(name="wall", lower=(0.35, -0.06, 0.0), upper=(0.8, 0.06, 0.9))
walled = simulator.problem.replace(scene=Scene(obstacles=(wall,)))
planned = plan(walled, [-0.9, 0.3, 0, 0, 0.2, 0.7], [0.5, 0.5, 0.4], goal_kind="position")
show(planned.waypoints, planned.trajectory.at(planned.times()))
for name, problem in (("paper", "right"), ("tuned", "both")):
    state = train_policy(recipe("ars", name, problem=problem, iterations=10)).state
    curve = np.array([point[:4] for point in state.curve])
    show(state.theta, state.normalizer.mean, state.normalizer.squares, curve)
small = dict(n_envs=50, n_steps=6, batch_size=100, n_epochs=2, iterations=3, net_arch=(40, 24))
for name in ("paper", "quick"):
    state = train_policy(replace(recipe("ppo", name, problem="both", seed=1), **small)).state
    show(state.parameters, state.first_moment, state.second_moment, state.episodes.q)
"""


def computed_bits(variables: Mapping[str, str]) -> list[str]:
    """Compute in a process with other environment variables."""
    command = [sys.executable, "-P", "-c", COMPUTE_AND_PRINT]
    done = subprocess.run(
        command, env=os.environ | variables, capture_output=True, text=True, check=True
    )
    return hashes(done.stdout)


@cache
def usual_bits() -> list[str]:
    """What this process computes."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(COMPUTE_AND_PRINT, {})
    return hashes(said.getvalue())


def hashes(said: str) -> list[str]:
    """What was printed."""
    found = said.split()
    assert len(set(found)) == 9
    return found
