"""The Gymnasium environment: one arm."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.scenarios import ScenarioStream
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.task import ReachTask, RewardWeights, load_task
from kinarm.validation import finite_array

Array = NDArray[np.float64]


def make_simulator(
    task: ReachTask | str = "right",
    arm: Arm | str = DEFAULT_ARM,
    scene: Scene | None = None,
    *,
    reward: RewardWeights | Mapping[str, float] | None = None,
    threads: int | None = None,
    render_mode: None = None,
    **settings: Any,
) -> Simulator:
    """Build the simulator of an environment from the environment's arguments."""
    if render_mode is not None:
        raise InvalidInputError(f"render_mode must be None, got {render_mode!r}")
    if isinstance(reward, Mapping):
        terms = [item.name for item in fields(RewardWeights)]
        for name in reward:
            if name not in terms:
                raise UnknownNameError("reward term", name, terms)
        reward = RewardWeights(**reward)
    return Simulator(arm, load_task(task, reward=reward, **settings), scene, threads=threads)


def observation_space(simulator: Simulator) -> Space[Array]:
    """Bounds of an observation: goals to within the tolerance, quaternions to within rounding."""
    regions = [simulator.scene.goal_region(name) for name in simulator.task.benches]
    goal_low = np.min([region[0] for region in regions], axis=0) - simulator.task.tolerance
    goal_high = np.max([region[1] for region in regions], axis=0) + simulator.task.tolerance
    reach, n_axes = simulator.arm.reach, simulator.arm.n_axes
    turns, places = np.full(4 * n_axes, 1 + 1e-6), np.full(3 * n_axes, reach)
    low = np.concatenate([goal_low, goal_low - reach, -turns, -places])
    high = np.concatenate([goal_high, goal_high + reach, turns, places])
    return cast("Space[Array]", Box(low, high, dtype=np.float64))


def action_space(simulator: Simulator) -> Space[Array]:
    """Fractions of the rated speeds."""
    return cast("Space[Array]", Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float64))


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
    ``reward_closer`` (0, for every step closer), ``reward_collision`` (-1 when a move touches
    something), ``reward_success`` (0) and ``reward_step`` (0), with the default weights in
    brackets.

    **Start**: each actuated axis uniform within its limits, rejected until the arm touches
    nothing and the tool is farther from the goal than the tolerance. Goals are uniform over the
    benches of the task. ``reset(options={"start": q, "goal": p})`` sets either.

    **End**: terminated when the tool is within 0.05 m of the goal, or when a move would touch the
    ground, a bench or the arm itself (the move is refused); truncated after 64 steps.

    **Info**: ``distance`` [m]; and after a step ``success``, ``collision``, ``contact`` (names of
    the two bodies that would have touched, or None) and the five reward terms.

    **Versions**: v0, the first.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (as Gymnasium declares it)

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
        self.simulator = make_simulator(
            task,
            arm,
            scene,
            reward=reward,
            threads=1,
            render_mode=render_mode,
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
        start, goal = pick_scenario(options, *self._stream.next())
        self._episode = self.simulator.reset([start], [goal])
        return self._episode.observation[0].copy(), {"distance": float(self._episode.distance[0])}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Move for one time step."""
        episode = self._episode
        if episode is None or episode.status[0] != RUNNING:
            raise InvalidInputError("the episode is over or was never begun: call reset()")
        chosen = finite_array("action", action, (self.simulator.n_actions,))
        result = self.simulator.step(episode, chosen[None])
        contact = None
        if result.collision[0]:
            contact = self.simulator.contact_pair(episode.q[0], episode.target[0])
        info = {
            "distance": float(episode.distance[0]),
            "success": bool(result.success[0]),
            "collision": bool(result.collision[0]),
            "contact": contact,
            **{f"reward_{name}": float(term[0]) for name, term in result.terms._asdict().items()},
        }
        return (
            episode.observation[0].copy(),
            float(result.reward[0]),
            bool(result.terminated[0]),
            bool(result.truncated[0]),
            info,
        )


def pick_scenario(
    options: Mapping[str, Any] | None, start: Array, goal: Array
) -> tuple[Array, Array]:
    """Replace a start and a goal by what the options of a reset set.

    Raises
    ------
    InvalidInputError
        If an option is unknown, or has the wrong shape or an entry that is not finite.
    """
    given = dict(options or {})
    unknown = set(given) - {"start", "goal"}
    if unknown:
        raise InvalidInputError(f"unknown reset options {sorted(unknown)}; available: start, goal")
    return (
        finite_array("start", given.get("start", start), start.shape),
        finite_array("goal", given.get("goal", goal), goal.shape),
    )
