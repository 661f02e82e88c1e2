"""The native batch as a vectorised environment of Stable-Baselines3."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices, VecEnvStepReturn

from kinarm.envs import ReachVectorEnv
from kinarm.envs.environment import Observations, fixed_scenario, one_by_one
from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError
from kinarm.simulator import Simulator


class SB3VecEnv(VecEnv):
    """A batch of arms for Stable-Baselines3; made by `kinarm.policies.sb3_vec_env`.

    An episode that ends is replaced at once.

    Parameters
    ----------
    env : ReachVectorEnv
        The batch. Its steps would find what touches in every contact, which no
        info tells here; so they are taken part by part.

    Notes
    -----
    The info of an episode that ended holds what Stable-Baselines3 looks for:
    ``terminal_observation``, ``TimeLimit.truncated``, ``is_success`` and, as of ``Monitor``,
    ``episode`` (return ``r``, length ``l``, time ``t`` since the environment was made [s]); besides
    ``collision``, ``distance`` [m] and ``configuration`` [rad or m]. That of a refused move holds
    ``collision``. Other infos are empty, which saves time.

    The arms share the batch, which ``get_attr`` and ``env_method`` ask.
    """

    def __init__(self, env: ReachVectorEnv) -> None:
        self.env, self.spec, self.render_mode = env, env.spec, env.render_mode
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = env.metadata
        self._returns, self._made = np.zeros(self.num_envs), time.time()

    @property
    def simulator(self) -> Simulator:
        """The simulator of the batch."""
        return self.env.simulator

    @property
    def episodes(self) -> Episodes:
        """The episodes, one row per arm; refused before a reset."""
        return self.env.episodes

    @property
    def configuration(self) -> NDArray[np.float64]:
        """A copy of the joint positions, shape (n, n_joints) [rad or m]."""
        return self.env.configuration

    def reset(self) -> Observations:
        """Begin all episodes anew, with the seeds and options set before."""
        shown, _ = self.env.reset(seed=self._seeds)
        if any(self._options):  # in the place of what was drawn
            starts, goals = self.episodes.q.copy(), self.episodes.first_goals.copy()
            for row, options in enumerate(self._options):
                fixed = fixed_scenario(options, self.simulator, 1)
                starts[row] = fixed.get("start", starts[row])
                goals[row] = fixed.get("goal", goals[row])
            scenarios = {"start": starts, "goal": goals}
            shown, _ = self.env.reset(seed=self._seeds, options=scenarios)
        self._reset_seeds()
        self._reset_options()
        self._note_begun(np.arange(self.num_envs))
        return shown

    def set_options(self, options: Any = None) -> None:
        """Set ``start`` and ``goal`` of the next reset.

        Parameters
        ----------
        options : mapping or sequence of mapping, optional
            As for `kinarm.ReachVectorEnv.reset`, or a mapping for each arm.
        """
        if isinstance(options, dict):
            fixed = fixed_scenario(options, self.simulator, self.num_envs)
            rows = range(self.num_envs)
            options = [{name: array[row] for name, array in fixed.items()} for row in rows]
        super().set_options(options)

    def _note_begun(self, rows: NDArray[np.int64]) -> None:
        """Note the episodes that some arms begin."""
        episodes, self._returns[rows] = self.episodes, 0.0
        for row, distance in zip(rows.tolist(), episodes.distance[rows].tolist(), strict=True):
            self.reset_infos[row] = {"distance": distance, "configuration": episodes.q[row].copy()}

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions, shape (num_envs, n_actions), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Move every arm for one step; ended episodes show the next one's observation."""
        env, episodes = self.env, self.episodes
        result = env.simulator.step(episodes, self._actions)
        rewards, terminated, truncated = env.interface.step_outcome(episodes, result)
        env._pictures.step(episodes)
        self._returns += rewards
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(result.collision).tolist():
            infos[row]["collision"] = True
        dones = terminated | truncated
        ended = np.flatnonzero(dones)
        if ended.size:
            columns = {
                "TimeLimit.truncated": truncated & ~terminated,
                "is_success": result.success,
                "collision": result.collision,
                "distance": episodes.distance,
                **result.told,
            }
            finals = one_by_one(env.interface.observe(episodes.observation[ended]), ended.size)
            elapsed = round(time.time() - self._made, 6)
            for row, final in zip(ended.tolist(), finals, strict=True):
                total, length = self._returns[row].item(), episodes.steps[row].item()
                infos[row] = {
                    "terminal_observation": final,
                    **{name: column[row].item() for name, column in columns.items()},
                    "configuration": episodes.q[row].copy(),
                    "episode": {"r": total, "l": length, "t": elapsed},
                }
            env._begin(ended)
            self._note_begun(ended)
        shown = env.interface.observe(episodes.observation)
        return shown, rewards.astype(np.float32), dones, infos

    def render(self, mode: str | None = None) -> Any:
        """Draw all arms side by side; see `kinarm.ReachVectorEnv`."""
        _ = self.episodes  # refuses if there are none
        live = self.render_mode == "human" and mode in (None, "human")
        return None if live else super().render(mode)

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """One picture of each arm, shape (height, width, 3), for ``rgb_array``."""
        return list(self.env.render() or [None] * self.num_envs)

    def close(self) -> None:
        """Let go of what draws the arms."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the environment or its batch, for every arm."""
        if attr_name == "configuration":  # that of each
            return list(self.configuration[list(self._get_indices(indices))])
        owner = self if hasattr(self, attr_name) else self.env
        return [getattr(owner, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the environment, which all arms share.

        Parameters
        ----------
        attr_name, value, indices
            As for ``VecEnv``; a choice of some arms is refused.
        """
        if set(self._get_indices(indices)) != set(range(self.num_envs)):
            raise InvalidInputError(
                f"cannot set {attr_name!r} for some arms: they share one environment"
            )
        setattr(self, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """The answer of a method of the batch, for every arm.

        Parameters
        ----------
        method_name, *method_args, indices, **method_kwargs
            As for ``VecEnv``.
        """
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """True for ``Monitor`` alone, whose infos this environment writes."""
        return [issubclass(Monitor, wrapper_class) for _ in self._get_indices(indices)]
