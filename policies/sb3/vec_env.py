"""The native batch as a vectorised environment of Stable-Baselines3."""

import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from kinarm.envs.environment import Lifecycle, action_space, environment_metadata, pick_scenario
from kinarm.envs.interface import Interface, Observations, one_by_one
from kinarm.envs.rendering import EnvPictures
from kinarm.episodes import SUCCESS, Episodes
from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import FailedScenarios, Replay, StartsAndGoals
from kinarm.randomness import Stream, stream_generator
from kinarm.scenarios import ScenarioStream
from kinarm.simulator import Simulator

StepReturn = tuple[Observations, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]
Indices = int | Iterable[int] | None
"""Arms by number; None stands for all."""


class SB3VecEnv(Lifecycle, VecEnv):
    """Many arms, stepped by one call of the simulator; made by `kinarm.policies.sb3_vec_env`.

    Arm i goes through the same episodes as a single environment that is reset with the seed + i, as
    in the ``DummyVecEnv`` of Stable-Baselines3. An episode that ends is replaced at once.

    Parameters
    ----------
    simulator : Simulator
        What is stepped.
    num_envs : int
        Number of arms.
    interface : Interface
        What is shown of it.
    spec : EnvSpec, optional
        Of the single environment, if it is registered.
    replay : Replay, optional
        How scenarios of episodes that ended without success are replayed; never, if it is not
        given.
    render_mode, **picture
        As for `kinarm.ReachEnv`: mode, ``width``, ``height`` and ``camera`` of pictures.

    Notes
    -----
    The info of an episode that ended holds what Stable-Baselines3 and its wrappers look for:
    ``terminal_observation``, ``TimeLimit.truncated``, ``is_success`` and what ``Monitor`` adds,
    ``episode`` (return ``r``, length ``l``, time ``t`` since the environment was made [s]); besides
    ``collision`` and ``distance`` [m], and with replay ``replayed``: whether the episode began
    where an earlier one had failed. That of a move that was refused holds ``collision``. All other
    infos are empty, which saves time.

    The arms share this object and its interface, from which ``get_attr`` and ``env_method`` read.
    """

    def __init__(
        self,
        simulator: Simulator,
        num_envs: int,
        interface: Interface,
        *,
        spec: EnvSpec | None = None,
        replay: Replay | None = None,
        render_mode: str | None = None,
        **picture: Any,
    ) -> None:
        self._pictures = EnvPictures(simulator, render_mode, num_envs, **picture)
        self.simulator, self.interface, self.spec = simulator, interface, spec
        self.render_mode = render_mode
        super().__init__(num_envs, interface.observation_space, action_space(simulator))
        self.metadata = environment_metadata(simulator)
        self._streams: dict[int, ScenarioStream] = {}
        self._replay, self._chooser = replay, np.random.default_rng()
        self._failed = self._restored = FailedScenarios.none(simulator.arm.n_joints)
        self._starts = np.empty((num_envs, simulator.arm.n_joints))
        self._replayed = np.zeros(num_envs, dtype=bool)
        self._actions = np.zeros((num_envs, simulator.n_actions))
        self._returns = np.zeros(num_envs)
        self._made = time.time()

    @property
    def replayed(self) -> NDArray[np.bool_]:
        """Which episodes began where an earlier one had failed, shape (num_envs,)."""
        return self._replayed

    @property
    def failed(self) -> FailedScenarios:
        """Scenarios of the last episodes that failed, which may be replayed."""
        return self._failed

    def restore_failed(self, starts: ArrayLike, goals: ArrayLike) -> None:
        """Replay the `failed` scenarios of an earlier environment, and none that failed in this.

        A reset with a seed goes back to them: the same seed gives the same episodes again, also
        where a learner seeds the environment later.

        Parameters
        ----------
        starts : array_like, shape (n, n_joints)
            Start configurations, the oldest first [rad or m]; the last ``replay_size`` are kept.
        goals : array_like, shape (n, 3)
            Goal positions [m].

        Raises
        ------
        InvalidInputError
            If nothing is replayed here, or as `kinarm.Simulator.reset` says.
        StartInContactError
            If a start touches something.
        """
        if self._replay is None:
            raise InvalidInputError("failed scenarios need an environment with a replay_share")
        checked, size = self.simulator.reset(starts, goals), self._replay.size
        self._failed = FailedScenarios(checked.q[-size:], checked.goal[-size:])
        self._restored = self._failed

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps of the running episodes so far, shape (num_envs,)."""
        return self.episodes.steps

    def reset(self) -> Observations:
        """Begin all episodes anew, with the seeds and options that were set before.

        Returns
        -------
        ndarray, shape (num_envs, n_observations), or dict of ndarray

        Raises
        ------
        InvalidInputError
            If the environment is closed, or an option is unknown, has the wrong shape or an entry
            that is not finite.
        StartInContactError
            If a start touches something.
        """
        self._check_open()
        for row, seed in enumerate(self._seeds):
            if seed is not None:
                self._streams[row] = self._stream(seed)
        if self._seeds[0] is not None:
            self._chooser = stream_generator(Stream.REPLAY, self._seeds[0])
            self._failed = self._restored
        starts, goals = self._draw(np.arange(self.num_envs))
        for row, options in enumerate(self._options):
            starts[row], goals[row] = pick_scenario(options, starts[row], goals[row])
        self._reset_seeds()
        self._reset_options()
        return self._begin(self.simulator.reset(starts, goals))

    def _begin(self, episodes: Episodes) -> Observations:
        """Go on with these episodes, of all arms."""
        self._episodes = episodes
        self._starts[:] = episodes.q
        self._returns[:] = 0.0
        self._announce(episodes, np.arange(self.num_envs))
        return self.interface.observe(episodes.observation)

    def _draw(self, rows: NDArray[np.int64]) -> StartsAndGoals:
        """Starts and goals of the next episodes of some arms."""
        return self._new_or_failed(rows, self._chooser)

    def _new_or_failed(self, rows: NDArray[np.int64], rng: np.random.Generator) -> StartsAndGoals:
        """Starts and goals for some arms, new ones or failed ones again, as a generator decides."""
        if self._replay is None:
            return self._draw_new(rows)
        scenarios, self._replayed[rows] = self._failed.mixed(
            self._replay.share, rng, rows.size, lambda new: self._draw_new(rows[new])
        )
        return scenarios

    def _draw_new(self, rows: NDArray[np.int64]) -> StartsAndGoals:
        """Starts and goals for some arms, each from its own stream."""
        scenarios = []
        for row in rows.tolist():
            if row not in self._streams:
                self._streams[row] = self._stream(None)
            scenarios.append(self._streams[row].next())
        starts, goals = (np.array(part) for part in zip(*scenarios, strict=True))
        return starts, goals

    def _stream(self, seed: int | None) -> ScenarioStream:
        """Scenarios of one arm, other ones every time without a seed."""
        return ScenarioStream(self.simulator.world, np.random.default_rng(seed))

    def _announce(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Tell pictures and infos which episodes begin."""
        for row, distance in zip(rows.tolist(), episodes.distance[rows].tolist(), strict=True):
            self.reset_infos[row] = {"distance": distance}
        self._pictures.begin(rows, episodes)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take note of the actions, shape (num_envs, n_actions), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> StepReturn:
        """Move every arm for one time step.

        Returns
        -------
        observations : ndarray or dict of ndarray
            Those of new episodes where one ended.
        rewards : ndarray of float32, shape (num_envs,)
        dones : ndarray of bool, shape (num_envs,)
        infos : list of dict

        Raises
        ------
        InvalidInputError
            If the environment is closed or was never reset, or the actions have another shape or
            an entry that is not finite.
        """
        episodes = self.episodes
        result = self.simulator.step(episodes, self._actions)
        verdict = self.interface.step_outcome(episodes, result)
        self._returns += verdict.reward
        self._pictures.step(episodes)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(result.collision).tolist():
            infos[row]["collision"] = True
        dones = verdict.terminated | verdict.truncated
        ended = np.flatnonzero(dones)
        if ended.size:
            reasons = (verdict.truncated & ~verdict.terminated, result.success, result.collision)
            finals = self._final_infos(episodes, ended, *reasons)
            for row, info in zip(ended.tolist(), finals, strict=True):
                infos[row] = info
            self._renew(episodes, ended)
        observations = self.interface.observe(episodes.observation)
        return observations, verdict.reward.astype(np.float32), dones, infos

    def _final_infos(
        self, episodes: Episodes, rows: NDArray[np.int64], *reasons: NDArray[np.bool_]
    ) -> list[dict[str, Any]]:
        """Infos of episodes that ended: truncated, reached or touching."""
        finals = one_by_one(self.interface.observe(episodes.observation[rows]), rows.size)
        elapsed = round(time.time() - self._made, 6)
        columns = (*reasons, episodes.distance, self._returns, episodes.steps)
        infos = [
            {
                "terminal_observation": final,
                "TimeLimit.truncated": truncated,
                "is_success": reached,
                "collision": touching,
                "distance": distance,
                "episode": {"r": total, "l": length, "t": elapsed},
            }
            for final, truncated, reached, touching, distance, total, length in zip(
                finals, *(column[rows].tolist() for column in columns), strict=True
            )
        ]
        if self._replay is not None:
            for info, replayed in zip(infos, self._replayed[rows].tolist(), strict=True):
                info["replayed"] = replayed
        return infos

    def _renew(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Replace episodes that ended."""
        if self._replay is not None:
            failed = rows[episodes.status[rows] != SUCCESS]
            scenarios = self._starts[failed], episodes.goal[failed]
            self._failed = self._failed.followed_by(*scenarios, self._replay.size)
        self._starts[rows], episodes.goal[rows] = self._draw(rows)
        episodes.q[rows] = self._starts[rows]
        self.simulator.begin(episodes, rows)
        self._returns[rows] = 0.0
        self._announce(episodes, rows)

    def render(self, mode: str | None = None) -> Any:
        """Draw the arms, as the render mode says; see `kinarm.ReachVectorEnv`.

        A picture shows all arms side by side, as in every environment of Stable-Baselines3.

        Raises
        ------
        InvalidInputError
            If the environment is closed or was never reset.
        """
        _ = self.episodes  # refuses if there are none
        if self.render_mode is None or mode not in (None, self.render_mode):
            return super().render(mode)
        shown = self._pictures.render()
        if self.render_mode == "rgb_array_list":
            return [pictures.tiled for pictures in shown]
        return shown.tiled if self.render_mode == "rgb_array" else None

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """One picture of each arm, shape (height, width, 3), if the mode is ``rgb_array``."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        _ = self.episodes  # refuses if there are none
        return list(self._pictures.render())

    def close(self) -> None:
        """Let go of what draws the arms; nothing can be done afterwards."""
        self._pictures.close()
        self.closed = True

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Value of an attribute of the environment or of its interface, repeated for every arm.

        Raises
        ------
        AttributeError
            If neither has it.
        """
        owner = self if hasattr(self, attr_name) else self.interface
        return [getattr(owner, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of the environment, which all arms share.

        Parameters
        ----------
        attr_name, value, indices
            As for ``VecEnv``; there is no choice of arms but all.

        Raises
        ------
        InvalidInputError
            If it is to be set for some arms only.
        """
        if set(self._get_indices(indices)) != set(range(self.num_envs)):
            raise InvalidInputError(
                f"cannot set {attr_name!r} for some arms: they share one environment"
            )
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """What a method of the interface returns, repeated for every arm.

        Parameters
        ----------
        method_name, *method_args, indices, **method_kwargs
            As for ``VecEnv``.
        """
        result = getattr(self.interface, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """True for ``Monitor``, whose infos this environment writes; False for other wrappers."""
        return [issubclass(Monitor, wrapper_class) for _ in self._get_indices(indices)]
