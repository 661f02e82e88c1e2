"""Gymnasium environments: one arm, or a native batch of them."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError
from kinarm.scene import Scene
from kinarm.simulator import Simulator, StepResult
from kinarm.task import ReachTask, RewardWeights, load_task

Array = NDArray[np.float64]

PREFETCHED = 8


class ScenarioStream:
    """Starts and goals of successive episodes, drawn a few at a time.

    Parameters
    ----------
    simulator : Simulator
        Draws them.
    rng : numpy.random.Generator
        Source of randomness.
    """

    def __init__(self, simulator: Simulator, rng: np.random.Generator) -> None:
        self._simulator = simulator
        self._rng = rng
        self._ready: list[tuple[Array, Array]] = []

    def next(self) -> tuple[Array, Array]:
        """Return a start, shape (n_axes,), and a goal, shape (3,)."""
        if not self._ready:
            starts, goals = self._simulator.sample(self._rng, PREFETCHED)
            self._ready = list(zip(starts, goals, strict=True))[::-1]
        return self._ready.pop()


def make_simulator(
    task: ReachTask | str,
    arm: Arm | str,
    scene: Scene | None,
    reward: RewardWeights | Mapping[str, float] | None,
    threads: int | None = None,
    **settings: Any,
) -> Simulator:
    """Build the simulator of an environment from its keyword arguments."""
    base = load_task(task, **settings)
    if isinstance(reward, Mapping):
        try:
            reward = RewardWeights(**reward)
        except TypeError as error:
            raise InvalidInputError(f"reward has an unknown term: {error}") from error
    return Simulator(arm, load_task(base, reward=reward), scene, threads=threads)


def observation_space(simulator: Simulator) -> Box:
    """Bounds of an observation: goals to within the tolerance, quaternions to within rounding."""
    regions = [simulator.scene.goal_region(name) for name in simulator.task.benches]
    goal_low = np.min([region[0] for region in regions], axis=0) - simulator.task.tolerance
    goal_high = np.max([region[1] for region in regions], axis=0) + simulator.task.tolerance
    reach, n_axes = simulator.arm.reach, simulator.arm.n_axes
    turns, places = np.full(4 * n_axes, 1 + 1e-6), np.full(3 * n_axes, reach)
    low = np.concatenate([goal_low, goal_low - reach, -turns, -places])
    high = np.concatenate([goal_high, goal_high + reach, turns, places])
    return Box(low, high, dtype=np.float64)


def action_space(simulator: Simulator) -> Box:
    """Fractions of the rated speeds."""
    return Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float64)


class ReachEnv(gymnasium.Env[Array, Array]):
    """Reach a cube on a bench with a six-axis arm (paper, section 3).

    Parameters
    ----------
    task : str or ReachTask
        ``"left"``, ``"right"`` or ``"both"``.
    arm : str or Arm
        A shipped arm, the path of a URDF, or an arm.
    scene : Scene, optional
        The paper's scene by default.
    reward : RewardWeights or mapping, optional
        Weights of the reward terms, such as ``{"success": 1.0}``.
    tolerance, horizon, start_spread : optional
        Settings of the task to replace; see `ReachTask`.

    Notes
    -----
    **Action** (n = number of actuated axes, 5 for the shipped arms), ``Box(-1, 1, (n,))``:
    fraction of each axis's rated speed during one time step of 0.02 s. At full speed the axes of
    the default arm move 7, 7, 8, 9 and 9 degrees a step. Larger actions are clipped.

    **Observation** (6 + 7 axes, 48 for the shipped arms), float64, world frame with z up:

    ======== ============================================================ =========
    Index    Meaning                                                      Unit
    ======== ============================================================ =========
    0-2      position of the goal x, y, z                                 m
    3-5      goal minus tool point x, y, z                                m
    6-29     orientation of the six axis frames, quaternion w, x, y, z    1
    30-47    position of the six axis frames x, y, z                      m
    ======== ============================================================ =========

    Quaternions are composed along the chain, so they have no sign flips over the joint range.

    **Reward**: sum of the terms ``reward_progress`` (metres by which the tool came closer),
    ``reward_collision`` (-1 when a move touches something), ``reward_success`` (0) and
    ``reward_step`` (0), with the default weights in brackets.

    **Start**: each actuated axis uniform within its limits, rejected until the arm touches
    nothing and the tool is farther from the goal than the tolerance. Goals are uniform over the
    benches of the task. ``reset(options={"start": q, "goal": p})`` sets either.

    **End**: terminated when the tool is within 0.05 m of the goal, or when a move would touch the
    ground, a bench or the arm itself (the move is refused); truncated after 64 steps.

    **Info**: ``distance`` [m]; and after a step ``success``, ``collision``, ``contact`` (names of
    the two bodies that would have touched, or None) and the four reward terms.

    **Versions**: v0, the first.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        task: ReachTask | str = "right",
        arm: Arm | str = DEFAULT_ARM,
        scene: Scene | None = None,
        *,
        reward: RewardWeights | Mapping[str, float] | None = None,
        tolerance: float | None = None,
        horizon: int | None = None,
        start_spread: float | None = None,
        render_mode: None = None,
    ) -> None:
        if render_mode is not None:
            raise InvalidInputError(f"render_mode must be None, got {render_mode!r}")
        self.simulator = make_simulator(
            task,
            arm,
            scene,
            reward,
            threads=1,
            tolerance=tolerance,
            horizon=horizon,
            start_spread=start_spread,
        )
        self.observation_space = observation_space(self.simulator)
        self.action_space = action_space(self.simulator)
        self._stream: ScenarioStream | None = None
        self._episode: Episodes | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; ``options`` may set ``start`` and ``goal``."""
        super().reset(seed=seed)
        if self._stream is None or seed is not None:
            self._stream = ScenarioStream(self.simulator, self.np_random)
        start, goal = chosen_scenario(self._stream, options)
        self._episode = self.simulator.reset([start], [goal])
        return self._episode.observation[0].copy(), {"distance": float(self._episode.distance[0])}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Move for one time step."""
        episode = self._episode
        if episode is None or episode.status[0] != RUNNING:
            raise InvalidInputError("the episode is over or was never begun: call reset()")
        result = self.simulator.step(episode, np.asarray(action)[None])
        info = {
            "distance": float(episode.distance[0]),
            "success": bool(result.success[0]),
            "collision": bool(result.collision[0]),
            "contact": contact_of(self.simulator, episode, 0) if result.collision[0] else None,
            **{f"reward_{name}": float(term[0]) for name, term in result.terms._asdict().items()},
        }
        return (
            episode.observation[0].copy(),
            float(result.reward[0]),
            bool(result.terminated[0]),
            bool(result.truncated[0]),
            info,
        )


class ReachVectorEnv(VectorEnv[Array, Array, Array]):
    """A native batch of `ReachEnv`: all arms are stepped by one call of the compiled simulator.

    Sub-environment i behaves like a `ReachEnv` reset with ``seed + i``. Spaces, rewards, endings
    and infos are those of `ReachEnv`, batched as Gymnasium batches them.

    Parameters
    ----------
    num_envs : int
        Number of arms.
    autoreset_mode : AutoresetMode or str
        ``SameStep`` (default): an episode that ends is replaced at once; its last observation and
        info are in ``final_obs`` and ``final_info``. ``NextStep``: the next call of `step`
        resets it and ignores its action. ``Disabled``: reset it by
        ``reset(options={"reset_mask": mask})``.
    task, arm, scene, reward, tolerance, horizon, start_spread
        As for `ReachEnv`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium replaces it per instance)
        "render_modes": [],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        task: ReachTask | str = "right",
        arm: Arm | str = DEFAULT_ARM,
        scene: Scene | None = None,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        reward: RewardWeights | Mapping[str, float] | None = None,
        tolerance: float | None = None,
        horizon: int | None = None,
        start_spread: float | None = None,
        threads: int | None = None,
        render_mode: None = None,
    ) -> None:
        if num_envs < 1:
            raise InvalidInputError(f"num_envs must be at least 1, got {num_envs}")
        if render_mode is not None:
            raise InvalidInputError(f"render_mode must be None, got {render_mode!r}")
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError as error:
            raise InvalidInputError(
                f"autoreset_mode must be one of {[mode.value for mode in AutoresetMode]}, "
                f"got {autoreset_mode!r}"
            ) from error
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.simulator = make_simulator(
            task,
            arm,
            scene,
            reward,
            threads=threads,
            tolerance=tolerance,
            horizon=horizon,
            start_spread=start_spread,
        )
        self.num_envs = num_envs
        self.single_observation_space = observation_space(self.simulator)
        self.single_action_space = action_space(self.simulator)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._streams: list[ScenarioStream] = []
        self._episodes: Episodes | None = None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin episodes; see `ReachEnv.reset`.

        ``options`` may hold ``reset_mask``, a boolean array of shape (num_envs,), to reset only
        some, and one ``start`` or ``goal`` for all.
        """
        chosen = dict(options or {})
        rows = self._masked_rows(chosen.pop("reset_mask", None))
        seeds = self._seeds(seed)
        if not self._streams:
            first = [np.random.SeedSequence().entropy if s is None else s for s in seeds]
            self._streams = [self._stream(s) for s in first]
        else:
            for row in rows:
                if seeds[row] is not None:
                    self._streams[row] = self._stream(seeds[row])
        scenarios = [chosen_scenario(self._streams[row], chosen) for row in rows]
        starts, goals = (np.array(part) for part in zip(*scenarios, strict=True))
        if self._episodes is None:
            self._episodes = self.simulator.reset(starts, goals)
        else:
            self._restart(self._episodes, rows, starts, goals)
        distance = np.zeros(self.num_envs)
        distance[rows] = self._episodes.distance[rows]
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[rows] = True
        return self._episodes.observation.copy(), {"distance": distance, "_distance": mask}

    def step(
        self, actions: Array
    ) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Move every arm for one time step."""
        episodes = self._episodes
        if episodes is None:
            raise InvalidInputError("the environment was never begun: call reset()")
        before = episodes.status == RUNNING
        if self.autoreset_mode is AutoresetMode.DISABLED and not before.all():
            over = np.flatnonzero(~before).tolist()
            raise InvalidInputError(f"episodes {over} are over: reset them with reset_mask")
        result = self.simulator.step(episodes, actions)
        infos = self._step_infos(episodes, result, before)
        reward = np.where(before, result.reward, 0.0)
        ended = np.flatnonzero(before & (episodes.status != RUNNING))
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and not before.all():
            self._renew(episodes, np.flatnonzero(~before), infos)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and ended.size:
            self._keep_final(episodes, ended, infos)
            self._renew(episodes, ended, infos)
        return episodes.observation.copy(), reward, result.terminated, result.truncated, infos

    def _step_infos(
        self, episodes: Episodes, result: StepResult, stepped: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """Infos of the arms that moved, with their masks."""
        contact = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(result.collision):
            contact[row] = contact_of(self.simulator, episodes, row)
        infos: dict[str, Any] = {
            "distance": episodes.distance.copy(),
            "success": result.success.copy(),
            "collision": result.collision.copy(),
            "contact": contact,
            **{
                f"reward_{name}": np.where(stepped, term, 0.0)
                for name, term in result.terms._asdict().items()
            },
        }
        for key in tuple(infos):
            infos[f"_{key}"] = stepped.copy()
        return infos

    def _keep_final(
        self, episodes: Episodes, ended: NDArray[np.int64], infos: dict[str, Any]
    ) -> None:
        """Move the infos of ended episodes to ``final_obs`` and ``final_info``."""
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[ended] = True
        final_obs = np.full(self.num_envs, None, dtype=object)
        for row in ended:
            final_obs[row] = episodes.observation[row].copy()
        final_info: dict[str, Any] = {}
        for key in [key for key in infos if not key.startswith("_")]:
            kept = np.zeros_like(infos[key])
            if kept.dtype == object:
                kept[:] = None
            kept[ended] = infos[key][ended]
            infos[key][ended] = None if kept.dtype == object else 0
            infos[f"_{key}"][ended] = False
            final_info[key], final_info[f"_{key}"] = kept, mask.copy()
        infos.update(
            final_obs=final_obs, _final_obs=mask.copy(), final_info=final_info, _final_info=mask
        )

    def _renew(self, episodes: Episodes, rows: NDArray[np.int64], infos: dict[str, Any]) -> None:
        """Begin new episodes from the streams and report their distance."""
        scenarios = [self._streams[row].next() for row in rows]
        starts, goals = (np.array(part) for part in zip(*scenarios, strict=True))
        self._restart(episodes, rows, starts, goals)
        infos["distance"][rows] = episodes.distance[rows]
        infos["_distance"][rows] = True

    def _restart(
        self, episodes: Episodes, rows: NDArray[np.int64], starts: Array, goals: Array
    ) -> None:
        """Put new starts and goals into some rows of the batch."""
        checked = self.simulator.check_scenarios(starts, goals)
        episodes.q[rows], episodes.goal[rows] = checked
        self.simulator.begin(episodes, rows)

    def _masked_rows(self, mask: object) -> NDArray[np.int64]:
        """Rows to reset."""
        if mask is None or self._episodes is None:
            return np.arange(self.num_envs)
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
            return [int(seed) + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise InvalidInputError(f"seed must hold {self.num_envs} numbers, got {len(seed)}")
        return list(seed)

    def _stream(self, seed: Any) -> ScenarioStream:
        return ScenarioStream(self.simulator, np.random.default_rng(seed))


def chosen_scenario(
    stream: ScenarioStream, options: Mapping[str, Any] | None
) -> tuple[Array, Array]:
    """Take the next scenario of a stream and replace what the options of a reset set."""
    given = dict(options or {})
    unknown = set(given) - {"start", "goal"}
    if unknown:
        raise InvalidInputError(f"unknown reset options {sorted(unknown)}; available: start, goal")
    start, goal = stream.next()
    return given.get("start", start), given.get("goal", goal)


def contact_of(simulator: Simulator, episodes: Episodes, row: int) -> tuple[str, str] | None:
    """Bodies that the refused step of an episode would have brought into contact."""
    return simulator.contact_pair(episodes.q[row], episodes.target[row])
