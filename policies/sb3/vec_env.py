"""The native batch as a vectorised environment of Stable-Baselines3."""

import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices, VecEnvStepReturn

from kinarm.envs.environment import Lifecycle, Observations, fixed_scenario, one_by_one
from kinarm.envs.reach import ReachEnv
from kinarm.envs.rendering import EnvPictures
from kinarm.episodes import SUCCESS, Episodes
from kinarm.errors import SHARE, InvalidInputError, check_range, whole_number
from kinarm.failed_scenarios import LARGEST_REPLAY, FailedScenarios, StartsAndGoals
from kinarm.randomness import Stream, stream_generator
from kinarm.scenarios import ScenarioQueues
from kinarm.simulator import Simulator


class SB3VecEnv(Lifecycle, VecEnv):
    """Arms stepped together; made by `kinarm.policies.sb3_vec_env`.

    An episode that ends is replaced at once.

    Parameters
    ----------
    single : ReachEnv
        The environment of one arm, with problem, observations and rewards.
    num_envs : int
        Number of arms.
    replay_share, replay_size : float and int
        As for `kinarm.policies.sb3_vec_env`.
    threads : int, optional
        As for `kinarm.Simulator`.
    render_mode, **picture
        As for `kinarm.ReachEnv`: mode, ``width``, ``height`` and ``camera``.

    Notes
    -----
    The info of an episode that ended holds what Stable-Baselines3 looks for:
    ``terminal_observation``, ``TimeLimit.truncated``, ``is_success`` and, as of ``Monitor``,
    ``episode`` (return ``r``, length ``l``, time ``t`` since the environment was made [s]); besides
    ``collision``, ``distance`` [m], ``configuration`` [rad or m] and, with replay, ``replayed``:
    whether it began where an earlier one had failed. That of a refused move holds ``collision``.
    Other infos are empty, which saves time.

    The arms share this object and its interface, which ``get_attr`` and ``env_method`` ask.
    """

    def __init__(
        self,
        single: ReachEnv,
        num_envs: int,
        *,
        replay_share: float,
        replay_size: int,
        threads: int | None = None,
        render_mode: str | None = None,
        **picture: Any,
    ) -> None:
        self.simulator = simulator = Simulator(single.simulator.problem, threads=threads)
        self._pictures = EnvPictures(simulator, render_mode, num_envs, **picture)
        self.interface, self.spec, self.render_mode = single.interface, single.spec, render_mode
        super().__init__(num_envs, single.observation_space, single.action_space)
        self.metadata = single.metadata
        self._queues = ScenarioQueues(simulator.world, num_envs)
        check_range("replay_share", float(replay_share), SHARE)
        self._share = replay_share
        self._size = whole_number("replay_size", replay_size, 1, LARGEST_REPLAY)
        self._chooser = np.random.default_rng()
        self._failed = self._restored = FailedScenarios.none(
            simulator.arm.n_joints, simulator.world.goal_width
        )
        self._starts = np.empty((num_envs, simulator.arm.n_joints))
        self._replayed = np.zeros(num_envs, dtype=bool)
        self._returns = np.zeros(num_envs)
        self._made = time.time()

    @property
    def failed(self) -> FailedScenarios:
        """Scenarios of the last failed episodes, for replay."""
        return self._failed

    def restore_failed(self, starts: ArrayLike, goals: ArrayLike) -> None:
        """Replay the `failed` scenarios of an earlier environment instead.

        A reset with a seed goes back to them: the same seed gives the same
        episodes.

        Parameters
        ----------
        starts, goals : array_like, shape (n, n_joints) and (n, goal_width)
            Configurations [rad or m] and goals [m], oldest first; the last
            ``replay_size`` are kept.
        """
        if not self._share:
            raise InvalidInputError("failed scenarios need an environment with a replay_share")
        checked, size = self.simulator.reset(starts, goals), self._size
        self._failed = FailedScenarios(checked.q[-size:], checked.first_goals[-size:])
        self._restored = self._failed

    def reset(self) -> Observations:
        """Begin all episodes anew, with the seeds and options set before."""
        for row, seed in enumerate(self._seeds):
            if seed is not None:
                self._queues.seed(row, np.random.default_rng(seed))
        if self._seeds[0] is not None:
            self._chooser = stream_generator(Stream.REPLAY, self._seeds[0])
            self._failed = self._restored
        starts, goals = self._draw(np.arange(self.num_envs))
        for row, options in enumerate(self._options):
            fixed = fixed_scenario(options, self.simulator, 1)
            starts[row] = fixed.get("start", starts[row])
            goals[row] = fixed.get("goal", goals[row])
        self._reset_seeds()
        self._reset_options()
        self._episodes = episodes = self.simulator.reset(starts, goals)
        self._starts[:], self._returns[:] = episodes.q, 0.0
        self._announce(episodes, np.arange(self.num_envs))
        return self.interface.observe(episodes.observation)

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

    def _draw(self, rows: NDArray[np.int64]) -> StartsAndGoals:
        """Starts and goals of the next episodes."""

        def draw_new(new: NDArray[np.int64]) -> StartsAndGoals:
            width = self.simulator.world.goal_width
            starts, goals = np.empty(self._starts.shape), np.empty((self.num_envs, width))
            self._queues.put(rows[new], starts, goals)
            return starts[rows[new]], goals[rows[new]]

        scenarios, self._replayed[rows] = self._failed.mixed(
            self._share, self._chooser, rows.size, draw_new
        )
        return scenarios

    def _announce(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Tell pictures and infos which episodes begin."""
        for row, distance in zip(rows.tolist(), episodes.distance[rows].tolist(), strict=True):
            self.reset_infos[row] = {"distance": distance, "configuration": episodes.q[row].copy()}
        self._pictures.begin(rows, episodes)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions, shape (num_envs, n_actions), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Move every arm for one step; ended episodes show the next one's observation."""
        episodes = self.episodes
        result = self.simulator.step(episodes, self._actions)
        reward, terminated, truncated = self.interface.step_outcome(episodes, result)
        self._returns += reward
        self._pictures.step(episodes)
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
            if self._share:
                columns["replayed"] = self._replayed
            finals = one_by_one(self.interface.observe(episodes.observation[ended]), ended.size)
            elapsed = round(time.time() - self._made, 6)
            for row, final in zip(ended.tolist(), finals, strict=True):
                total, length = self._returns[row].item(), episodes.steps[row].item()
                infos[row] = {
                    "terminal_observation": final,
                    **{name: column[row].item() for name, column in columns.items()},
                    "configuration": episodes.q[row].copy(),
                    "episode": {"r": total, "l": length, "t": elapsed},
                }
            self._renew(episodes, ended)
        observations = self.interface.observe(episodes.observation)
        return observations, reward.astype(np.float32), dones, infos

    def _renew(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Replace episodes that ended."""
        if self._share:
            failed = rows[episodes.status[rows] != SUCCESS]
            scenarios = self._starts[failed], episodes.first_goals[failed]
            self._failed = self._failed.followed_by(*scenarios, self._size)
        self._starts[rows], episodes.goal[rows] = self._draw(rows)
        episodes.q[rows] = self._starts[rows]
        self.simulator.begin(episodes, rows)
        self._returns[rows] = 0.0
        self._announce(episodes, rows)

    def render(self, mode: str | None = None) -> Any:
        """Draw all arms side by side; see `kinarm.ReachVectorEnv`."""
        _ = self.episodes  # refuses if there are none
        live = self.render_mode == "human" and mode in (None, "human")
        return None if live else super().render(mode)

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """One picture of each arm, shape (height, width, 3), for ``rgb_array``."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        _ = self.episodes  # refuses if there are none
        return list(self._pictures.render() or ())

    def close(self) -> None:
        """Let go of what draws the arms; nothing works afterwards."""
        self._pictures.close()
        self.closed = True

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the environment or its interface, for every arm."""
        if attr_name == "configuration":  # that of each
            return list(self.configuration[list(self._get_indices(indices))])
        owner = self if hasattr(self, attr_name) else self.interface
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
        """The answer of a method of the interface, for every arm.

        Parameters
        ----------
        method_name, *method_args, indices, **method_kwargs
            As for ``VecEnv``.
        """
        result = getattr(self.interface, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """True for ``Monitor`` alone, whose infos this environment writes."""
        return [issubclass(Monitor, wrapper_class) for _ in self._get_indices(indices)]
