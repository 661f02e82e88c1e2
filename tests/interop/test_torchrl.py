"""TorchRL wraps the environments, and its checker accepts them."""

import multiprocessing

import gymnasium
import pytest

from kinarm.envs import ENVIRONMENTS

pytestmark = pytest.mark.filterwarnings("default")  # those that importing torchrl raises


@pytest.fixture(scope="module")
def envs():
    """Its environments; importing it sets how processes start, which is put back."""
    before = multiprocessing.get_start_method(allow_none=True)
    pytest.importorskip("torchrl")
    from torchrl import envs

    multiprocessing.set_start_method(before, force=True)
    return envs


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_single_environments(envs, env_id):
    made = (
        envs.GymEnv(env_id),
        envs.GymEnv(env_id, observation_dtype="float32", horizon=8),
        envs.GymWrapper(gymnasium.make(env_id)),
    )
    for env in made:
        envs.utils.check_env_specs(env, seed=0)
        rollout = env.rollout(10, break_when_any_done=False)
        assert rollout["action"].shape == (10, 5)
        assert rollout["next", "reward"].shape == (10, 1)
        env.close()


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_native_batch(envs, env_id):
    """In the autoreset mode that it prefers; the infos come along."""
    batch = gymnasium.make_vec(env_id, num_envs=3, autoreset_mode="Disabled", horizon=8)
    env = envs.GymWrapper(batch).auto_register_info_dict()
    envs.utils.check_env_specs(env, seed=0)
    rollout = env.rollout(40, break_when_any_done=False)
    assert rollout["next", "reward"].shape == (3, 40, 1)
    assert (rollout["next", "done"].sum(dim=1) >= 40 // 8).all()
    told = rollout["next"]
    assert (told["contact"] > 0).equal(told["collision"])
    env.close()
