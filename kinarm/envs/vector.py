"""The Gymnasium environment for many arms, stepped as one batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import DTypeLike, NDArray

from kinarm._validation import whole_number
from kinarm.envs.interface import FlatInterface, Interface, Observations
from kinarm.envs.lifecycle import Lifecycle
from kinarm.envs.portable import PortableSpec
from kinarm.envs.reach import (
    Array,
    action_space,
    environment_metadata,
    make_simulator,
    pick_scenario,
)
from kinarm.envs.rendering import RENDER_MODES, EnvPictures
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError
from kinarm.problem import ProblemLike
from kinarm.rollouts import StepResult
from kinarm.scenarios import ScenarioStream
from kinarm.simulator import Simulator
from kinarm.task import REWARD_TERMS


class ReachVectorEnv(Lifecycle, PortableSpec, VectorEnv[Any, Array, NDArray[Any]]):
    """A native batch of `ReachEnv`: all arms are stepped by one call of the compiled simulator.

    Sub-environment i behaves like a `ReachEnv` reset with ``seed + i``. Spaces, rewards, endings
    and infos are those of `ReachEnv`, batched as Gymnasium batches them.

    Parameters
    ----------
    num_envs : int
        Number of arms.
    problem : ReachProblem, str or Path
        As for `ReachEnv`.
    autoreset_mode : AutoresetMode or str
        ``NextStep`` (default, as in Gymnasium): the step after the end of an episode begins the
        next one and ignores its action. ``SameStep``: an episode that ends is replaced at once;
        its last observation and info are in ``final_obs`` and ``final_info``. ``Disabled``: an
        arm rests until ``reset(options={"reset_mask": mask})``.
    threads : int, optional
        As for `kinarm.Simulator`.
    render_mode, width, height, camera, observation_dtype
        As for `ReachEnv`; `render` returns as many pictures as there are arms.
    max_episode_steps : int, optional
        Another name of the horizon, which Gymnasium uses.
    **overrides
        As for `ReachEnv`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        "render_modes": list(RENDER_MODES),
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
        horizon = {} if max_episode_steps is None else {"horizon": max_episode_steps}
        self.simulator = make_simulator(problem, threads, {**horizon, **overrides})
        self.interface = self._make_interface(self.simulator, observation_dtype)
        self.metadata = environment_metadata(self.simulator, autoreset_mode=self.autoreset_mode)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space = self.interface.observation_space
        self.single_action_space = action_space(self.simulator)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        picture = {"width": width, "height": height, "camera": camera}
        self._pictures = EnvPictures(self.simulator, render_mode, num_envs, **picture)
        self._streams: list[ScenarioStream] = []

    def _make_interface(self, simulator: Simulator, dtype: DTypeLike) -> Interface:
        """What the environment shows of its simulator."""
        return FlatInterface(simulator, dtype)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes; see `ReachEnv.reset`.

        ``options`` may hold ``reset_mask``, a boolean array of shape (num_envs,), to reset only
        some, and one ``start`` or ``goal`` for all.
        """
        self._check_open()
        chosen = dict(options or {})
        rows = self._masked_rows(chosen.pop("reset_mask", None))
        seeds = self._seeds(seed)
        self._check_choice(chosen)
        if not self._streams:
            first = [np.random.SeedSequence().entropy if s is None else s for s in seeds]
            self._streams = [self._stream(s) for s in first]
        else:
            for row in rows:
                if seeds[row] is not None:
                    self._streams[row] = self._stream(seeds[row])
        scenarios = [pick_scenario(chosen, *self._streams[row].next()) for row in rows]
        starts, goals = (np.array(part) for part in zip(*scenarios, strict=True))
        if self._episodes is None:
            self._episodes = self.simulator.reset(starts, goals)
        else:
            self._restart(self._episodes, rows, starts, goals)
        self._pictures.begin(rows, self._episodes)
        distance = np.zeros(self.num_envs)
        distance[rows] = self._episodes.distance[rows]
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[rows] = True
        shown = self.interface.observe(self._episodes.observation)
        return shown, {"distance": distance, "_distance": mask}

    def step(
        self, actions: Array
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Move every arm for one time step."""
        episodes = self._begun_episodes()
        before = episodes.status == RUNNING
        if self.autoreset_mode is AutoresetMode.DISABLED and not before.all():
            over = np.flatnonzero(~before).tolist()
            raise InvalidInputError(f"episodes {over} are over: reset them with reset_mask")
        result = self.simulator.step(episodes, actions)
        reward, terminated, truncated = self.interface.judge(episodes, result)
        self._pictures.step(episodes)
        infos = self._step_infos(episodes, result, before)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and not before.all():
            reward[~before] = 0.0
            self._renew(episodes, np.flatnonzero(~before), infos)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            ended = np.flatnonzero(terminated | truncated)
            if ended.size:
                self._keep_final(episodes, ended, infos)
                self._renew(episodes, ended, infos)
        return self.interface.observe(episodes.observation), reward, terminated, truncated, infos

    def render(self) -> Any:
        """Take a picture of every arm; see ``render_mode``."""
        self._begun_episodes()
        return self._pictures.render()

    def close_extras(self, **_: Any) -> None:
        """Close the live page, if there is one; the environment cannot be used any more."""
        self._pictures.close()

    def _step_infos(
        self, episodes: Episodes, result: StepResult, stepped: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """Infos of the arms that moved, with their masks; takes over the arrays of the result."""
        contact = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(result.collision):
            contact[row] = self.simulator.world.contact_pair(episodes.q[row], episodes.target[row])
        infos: dict[str, Any] = {
            "distance": episodes.distance.copy(),
            "success": result.success,
            "is_success": result.success.copy(),
            "collision": result.collision,
            "contact": contact,
        }
        if self.interface.tells_terms:
            terms = zip(REWARD_TERMS, result.terms.T, strict=True)
            infos |= {f"reward_{name}": values for name, values in terms}
        mask = stepped.copy()
        infos.update({f"_{key}": mask for key in infos if key != "distance"})
        infos["_distance"] = stepped.copy()
        return infos

    def _keep_final(
        self, episodes: Episodes, ended: NDArray[np.int64], infos: dict[str, Any]
    ) -> None:
        """Move the infos of ended episodes to ``final_obs`` and ``final_info``."""
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[ended] = True
        final_obs = np.full(self.num_envs, None, dtype=object)
        shown = self.interface.observe(episodes.observation[ended])
        for index, row in enumerate(ended):
            if isinstance(shown, dict):
                final_obs[row] = {name: part[index] for name, part in shown.items()}
            else:
                final_obs[row] = shown[index]
        final_info: dict[str, Any] = {}
        for key in [key for key in infos if not key.startswith("_")]:
            blank = None if infos[key].dtype == object else 0
            kept = infos[key].copy()
            kept[~mask], infos[key][mask] = blank, blank
            final_info[key], final_info[f"_{key}"] = kept, mask
        infos["_success"][ended] = False  # the mask of all but the distance, which is renewed
        infos.update(final_obs=final_obs, _final_obs=mask, final_info=final_info, _final_info=mask)

    def _renew(self, episodes: Episodes, rows: NDArray[np.int64], infos: dict[str, Any]) -> None:
        """Begin new episodes from the streams and report their distance."""
        scenarios = [self._streams[row].next() for row in rows]
        starts, goals = (np.array(part) for part in zip(*scenarios, strict=True))
        self._restart(episodes, rows, starts, goals)
        self._pictures.begin(rows, episodes)
        infos["distance"][rows] = episodes.distance[rows]
        infos["_distance"][rows] = True

    def _restart(
        self, episodes: Episodes, rows: NDArray[np.int64], starts: Array, goals: Array
    ) -> None:
        """Put new starts and goals into some rows of the batch."""
        episodes.q[rows], episodes.goal[rows] = starts, goals
        self.simulator.begin(episodes, rows)

    def _check_choice(self, chosen: dict[str, Any]) -> None:
        """Refuse a bad start or goal before anything changes."""
        arm = self.simulator.arm
        start, goal = pick_scenario(chosen, arm.home, np.zeros(3))
        if "start" in chosen:
            self.simulator.reset(start[None], goal[None])

    def _masked_rows(self, mask: object) -> NDArray[np.int64]:
        """Rows to reset."""
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
        """Seeds of the sub-environments."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [whole_number("seed", seed, 0) + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise InvalidInputError(f"seed must hold {self.num_envs} numbers, got {len(seed)}")
        return [None if one is None else whole_number("seed", one, 0) for one in seed]

    def _stream(self, seed: Any) -> ScenarioStream:
        return ScenarioStream(self.simulator.world, np.random.default_rng(seed))
