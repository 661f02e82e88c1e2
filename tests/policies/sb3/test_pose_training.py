"""Hindsight replay on goals with a rotation."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import SAC

from kinarm._parallel import one_torch_thread
from kinarm.policies import sb3_vec_env
from kinarm.policies.sb3.hindsight import HindsightReplayBuffer
from kinarm.scene import GoalRegion, Scene
from kinarm.world import World

HORIZON = 24


def arms(count, seed):
    """Arms near home, and poses about one that they reach."""
    middle = World("right").poses([0.5, 0.4, -0.3, 0.2, 0.5, 0.0])[:3, 3]
    region = GoalRegion(name="right", lower=tuple(middle - 0.1), upper=tuple(middle + 0.1))
    return sb3_vec_env(
        "kinarm/ReachGoalRight-v0",
        count,
        seed=seed,
        scene=Scene(obstacles=(), goal_regions=(region,)),
        goal={"kind": "pose", "rotation_tolerance": 0.5},
        tolerance=0.15,
        horizon=HORIZON,
        start_spread=0.1,
    )


def success(model):
    env = arms(200, 5)
    observation, reached, over = env.reset(), np.zeros(200, bool), np.zeros(200, bool)
    for _ in range(HORIZON):
        observation, _, ended, infos = env.step(model.predict(observation, deterministic=True)[0])
        for row in np.flatnonzero(ended & ~over):
            reached[row] = infos[row]["is_success"]
        over |= ended
    return reached.mean()


@pytest.mark.rare
@one_torch_thread()
def test_sac_learns_to_reach_poses():
    model = SAC(
        *("MultiInputPolicy", arms(8, 0)),
        replay_buffer_class=HindsightReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        policy_kwargs={"net_arch": [128, 128]},
        learning_starts=800,
        gradient_steps=2,
        gamma=0.95,
        learning_rate=1e-3,
        seed=0,
    )
    assert success(model) < 0.1
    model.learn(28_000)
    assert success(model) > 0.4
