"""Checkpoint files of PPO, which need none of its packages; resuming is tested in test_ppo."""

import numpy as np
import pytest

from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies import (
    CurvePoint,
    Normalizer,
    PPOConfig,
    PPOState,
    load_checkpoint,
    save_checkpoint,
)
from kinarm.policies.ppo import EpisodeStates

CONFIG = PPOConfig(problem="left", net_arch=(9, 8), n_envs=3, n_steps=4, batch_size=6)


@pytest.fixture(scope="module")
def state():
    rng = np.random.default_rng(0)
    return PPOState(
        parameters=rng.normal(size=50).astype(np.float32),
        first_moment=rng.normal(size=50).astype(np.float32),
        second_moment=rng.random(50).astype(np.float32),
        normalizer=Normalizer(1000, rng.normal(size=48), rng.random(48)),
        episodes=EpisodeStates(
            q=rng.normal(size=(3, 6)),
            goal=rng.normal(size=(3, 3)),
            steps=np.array([0, 5, 63]),
            total=rng.normal(size=3),
            start=rng.normal(size=(3, 6)),
            replayed=np.array([False, True, False]),
        ),
        failed=FailedScenarios(rng.normal(size=(4, 6)), rng.normal(size=(4, 3))),
        scenarios=5000,
        curve=(
            CurvePoint(float("nan"), float("nan"), float("nan"), 12, 0.5),
            CurvePoint(0.25, 0.5, 0.125, 24, 0.75),
        ),
    )


@pytest.fixture
def saved(state, tmp_path):
    path = tmp_path / "run.ckpt"
    save_checkpoint(path, CONFIG, state)
    return path


def test_round_trip(saved, state):
    config, loaded = load_checkpoint(saved)
    assert config == CONFIG
    for name in ("parameters", "first_moment", "second_moment"):
        first, second = getattr(loaded, name), getattr(state, name)
        assert (first.dtype, first.tobytes()) == (second.dtype, second.tobytes())
    parts = zip((*loaded.episodes, *loaded.failed), (*state.episodes, *state.failed), strict=True)
    for first, second in parts:
        assert (first.dtype, first.tobytes()) == (second.dtype, second.tobytes())
    assert (loaded.normalizer.count, loaded.scenarios) == (1000, 5000)
    assert loaded.normalizer.mean.tobytes() == state.normalizer.mean.tobytes()
    assert loaded.normalizer.squares.tobytes() == state.normalizer.squares.tobytes()
    np.testing.assert_array_equal(loaded.curve, state.curve)
    assert (loaded.iteration, loaded.environment_steps, loaded.wall_time) == (2, 24, 0.75)
