"""The Gymnasium environment for many arms, stepped as one batch."""

from collections.abc import Sequence
from itertools import chain, repeat
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import DTypeLike, NDArray

from kinarm.envs.environment import ArmEnvironment, Array, Observations, one_by_one
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError, whole_number
from kinarm.problem import ProblemLike


class ReachVectorEnv(ArmEnvironment, VectorEnv[Any, Array, NDArray[Any]]):
    """A native batch of `ReachEnv`, stepped by one call of the compiled simulator.

    Sub-environment i behaves like a `ReachEnv` reset with ``seed + i``. Spaces,
    rewards, ends and infos are those of `ReachEnv`, batched as in Gymnasium.

    Parameters
    ----------
    num_envs : int
        Number of arms.
    problem : ReachProblem, str or Path
        As for `ReachEnv`.
    autoreset_mode : AutoresetMode or str
        ``NextStep`` (default, as in Gymnasium): the step after an episode's end
        begins the next one and ignores its action. ``SameStep``: a finished
        episode is replaced at once; its last observation and info are in
        ``final_obs`` and ``final_info``. ``Disabled``: an arm rests until
        ``reset(options={"reset_mask": mask})``.
    threads : int, optional
        As for `kinarm.Simulator`.
    render_mode, width, height, camera, observation_dtype
        As for `ReachEnv`; `render` returns a picture per arm.
    max_episode_steps : int, optional
        Gymnasium's name of the horizon.
    **overrides
        As for `ReachEnv`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        **ArmEnvironment.metadata,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        problem: ProblemLike = "right",
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 360,
        camera: Any = None,
        observation_dtype: DTypeLike = np.float64,
        max_episode_steps: int | None = None,
        **overrides: Any,
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 1)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError as error:
            raise InvalidInputError(
                f"autoreset_mode must be one of {[mode.value for mode in AutoresetMode]}, "
                f"got {autoreset_mode!r}"
            ) from error
        if max_episode_steps is not None:
            overrides = {"horizon": max_episode_steps, **overrides}
        settings = threads, overrides, observation_dtype, render_mode
        picture = {"width": width, "height": height, "camera": camera}
        self._set_up(problem, num_envs, *settings, **picture)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.num_envs = num_envs
        self.single_observation_space = self.interface.observation_space
        self.single_action_space = self.interface.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        entries = (*self._told, "success", "collision", "contact")
        self._numbers = slice(1, 1 + len(self._told))
        self._told = (*entries, *(f"_{key}" for key in entries))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes; see `ReachEnv.reset`.

        ``options`` may hold ``reset_mask``, a boolean array, shape (num_envs,), of arms to reset,
        and ``start`` and ``goal``, shape (num_envs, n_joints) and (num_envs,
        goal_width), or one for all.
        """
        chosen = dict(options or {})
        rows = self._masked_rows(chosen.pop("reset_mask", None))
        seeds = self._seeds(seed)
        for row in rows.tolist():
            if seeds[row] is not None:
                self._queues.seed(row, np.random.default_rng(seeds[row]))
        episodes = self._begin(rows, chosen)
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[rows] = True
        distance = np.where(mask, episodes.distance, 0.0)
        shown = self.interface.observe(episodes.observation)
        return shown, {"distance": distance, "_distance": mask, **_configurations(episodes, mask)}

    def step(
        self, actions: Array
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Move every arm for one time step."""
        episodes = self.episodes
        running = episodes.status == RUNNING
        resting = np.count_nonzero(running) < self.num_envs
        if resting and self.autoreset_mode is AutoresetMode.DISABLED:
            over = np.flatnonzero(~running).tolist()
            raise InvalidInputError(f"episodes {over} are over: reset them with reset_mask")
        result = self.simulator.step(episodes, actions)
        reward, terminated, truncated = self.interface.step_outcome(episodes, result)
        self._pictures.step(episodes)
        self._find_contacts(episodes, result)
        # Infos are rows of tables, which are split at once where episodes are replaced.
        tables = result.numbers[self._numbers], result.flags[1:], result.contact[None]
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = self._with_finals(episodes, tables, terminated | truncated)
        else:
            infos = self._named(tables, running)
            if resting:
                rows = (~running).nonzero()[0]
                reward[rows] = 0.0
                self._renew(episodes, rows, infos)
        infos |= _configurations(episodes, infos["_distance"])
        return self.interface.observe(episodes.observation), reward, terminated, truncated, infos

    def render(self) -> Any:
        """Take a picture of every arm (``render_mode``)."""
        _ = self.episodes  # refuses if there are none
        return self._pictures.render()

    def close_extras(self, **_: Any) -> None:
        """Close the live page, if any."""
        self._pictures.close()

    def _named(
        self, tables: tuple[NDArray[Any], ...], told: NDArray[np.bool_]
    ) -> dict[str, NDArray[Any]]:
        """Name the rows of the tables, and add the mask of their arms."""
        infos = dict(zip(self._told, chain(*tables, repeat(told)), strict=False))
        infos["is_success"], infos["_is_success"] = infos["success"], told
        return infos

    def _with_finals(
        self, episodes: Episodes, tables: tuple[NDArray[Any], ...], over: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """Infos of a step; then episodes that are over are replaced."""
        rows = over.nonzero()[0]
        if not rows.size:
            return self._named(tables, ~over)
        finals = self._named(tuple(np.where(over, table, False) for table in tables), over)
        finals |= _configurations(episodes, over)
        for table in tables:
            np.copyto(table, False, where=over)  # which is a zero of every type
        final_obs = np.empty(self.num_envs, dtype=object)
        shown = one_by_one(self.interface.observe(episodes.observation[rows]), rows.size)
        for row, observation in zip(rows.tolist(), shown, strict=True):
            final_obs[row] = observation
        infos: dict[str, Any] = self._named(tables, ~over)
        infos.update(final_obs=final_obs, _final_obs=over, final_info=finals, _final_info=over)
        self._renew(episodes, rows, infos)
        return infos

    def _renew(self, episodes: Episodes, rows: NDArray[np.int64], infos: dict[str, Any]) -> None:
        """Begin new episodes and report their distance."""
        self._begin(rows)
        infos["distance"][rows] = episodes.distance[rows]
        infos["_distance"] = infos["_distance"].copy()  # the others' stays
        infos["_distance"][rows] = True

    def _masked_rows(self, mask: object) -> NDArray[np.int64]:
        if mask is None:
            return np.arange(self.num_envs)
        if self._episodes is None:
            raise InvalidInputError("reset_mask needs episodes: call reset() without it first")
        array = np.asarray(mask)
        if array.shape != (self.num_envs,) or array.dtype != bool or not array.any():
            raise InvalidInputError(
                f"reset_mask must hold {self.num_envs} booleans, one of them true, got {mask!r}"
            )
        return np.flatnonzero(array)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | float | np.generic):
            return [whole_number("seed", seed, 0) + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise InvalidInputError(f"seed must hold {self.num_envs} numbers, got {len(seed)}")
        return [None if one is None else whole_number("seed", one, 0) for one in seed]


def _configurations(episodes: Episodes, told: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """Joint positions of some arms, and which, for infos; zeros for others."""
    return {"configuration": np.where(told[:, None], episodes.q, 0.0), "_configuration": told}
