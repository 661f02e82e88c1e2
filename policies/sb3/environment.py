"""Making the environment for Stable-Baselines3, from any problem or id."""

from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium
from gymnasium.envs.registration import EnvSpec

from kinarm._validation import whole_number
from kinarm.envs.registration import ENVIRONMENTS
from kinarm.errors import UnknownNameError
from kinarm.policies.learners import find_learner
from kinarm.problem import ProblemLike

if TYPE_CHECKING:
    from kinarm.policies.sb3.vec_env import SB3VecEnv
