"""Pictures of an arm."""

import numpy as np

from kinarm.evaluation.measurements.timing import Timing, timed
from kinarm.policies.policy import Policy
from kinarm.simulator import Simulator

PICTURES = 40


def measure_pictures(simulator: Simulator, policy: Policy, repetitions: int) -> Timing:
    """Pictures per second of an environment's usual size, on one core, with the tool's ways."""
    from kinarm.viewer import Renderer

    renderer = Renderer(simulator.problem)
    starts, goals = simulator.sample(np.random.default_rng(0), PICTURES)
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    ways = [
        [simulator.arm.tool_position(state) for state in path[: steps + 1]]
        for path, steps in zip(rollouts.paths, rollouts.steps, strict=True)
    ]

    def run() -> int:
        for state, goal, way in zip(rollouts.configurations, goals, ways, strict=True):
            renderer.render(state, goal, trace=way)
        return len(goals)

    return timed(run, repetitions)
