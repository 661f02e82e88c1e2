"""The Gymnasium environment: one arm."""

from collections.abc import Mapping
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from kinarm._validation import finite_array
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError
from kinarm.observation import Ranges, observation_bounds, observation_table
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scenarios import ScenarioStream
from kinarm.simulator import Simulator
from kinarm.task import REWARD_TERMS

Array = NDArray[np.float64]


def make_simulator(
    problem: ProblemLike, render_mode: None, threads: int | None, overrides: Mapping[str, Any]
) -> Simulator:
    """Build the simulator of an environment from the environment's arguments."""
    if render_mode is not None:
        raise InvalidInputError(f"render_mode must be None, got {render_mode!r}")
    return Simulator(ReachProblem.load(problem).replace(**overrides), threads=threads)


def observation_space(simulator: Simulator) -> Space[Array]:
    """Bounds of an observation: goals to within the tolerance, quaternions to within rounding."""
    task = simulator.task
    regions = [simulator.scene.goal_region(name) for name in task.goal_regions]
    ranges = Ranges(
        goal_lower=np.min([region.lower for region in regions], axis=0) - task.tolerance,
        goal_upper=np.max([region.upper for region in regions], axis=0) + task.tolerance,
        reach=simulator.arm.reach,
    )
    lower, upper = observation_bounds(ranges, simulator.arm.n_joints)
    return cast("Space[Array]", Box(lower, upper, dtype=np.float64))


def action_space(simulator: Simulator) -> Space[Array]:
    """Fractions of the velocity limits."""
    return cast("Space[Array]", Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float64))


class ReachEnv(gymnasium.Env[Array, Array]):
    """Reach a cube on a bench with a six-axis arm (paper, section 3).

    Parameters
    ----------
    problem : ReachProblem, str or Path
        ``"left"``, ``"right"``, ``"both"``, a problem file, or a problem.
    **overrides
        What `kinarm.ReachProblem.replace` takes, such as ``arm``, ``tolerance``, ``horizon``,
        ``start_spread``, or ``reward={"success": 1.0}``.

    Notes
    -----
    **Action** (n = number of actuated joints, 5 for the shipped arms), ``Box(-1, 1, (n,))``:
    fraction of each joint's velocity limit during one time step of 0.02 s. At full speed the joints
    of the default arm move 7, 7, 8, 9 and 9 degrees a step. Larger actions are clipped.

    **Observation** (6 + 7 joints, 48 for the shipped arms), float64, world frame with z up:

    OBSERVATION_TABLE

    Quaternions are composed along the chain, so they have no sign flips over the joint range.

    **Reward**: sum of the terms ``reward_progress`` (metres by which the tool came closer),
    ``reward_closer`` (0, for every step closer), ``reward_step`` (0), ``reward_collision`` (-1
    when a move touches something) and ``reward_success`` (0), with the default weights in
    brackets; see `kinarm.RewardWeights`.

    **Start**: each actuated joint uniform within its limits, rejected until the arm touches
    nothing and the tool is farther from the goal than the tolerance. Goals are uniform over the
    regions of the task. ``reset(options={"start": q, "goal": p})`` sets either.

    **End**: terminated when the tool is within 0.05 m of the goal, or when a move would touch the
    ground, an obstacle or the arm itself (the move is refused); truncated after 64 steps.

    **Info**: ``distance`` [m]; and after a step ``success``, ``collision``, ``contact`` (names of
    the two bodies that would have touched, or None) and the five reward terms.

    **Versions**: v0, the first.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (as Gymnasium declares it)

    def __init__(
        self,
        problem: ProblemLike = "right",
        *,
        render_mode: None = None,
        **overrides: Any,
    ) -> None:
        self.simulator = make_simulator(problem, render_mode, 1, overrides)
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
            self._stream = ScenarioStream(self.simulator.world, self.np_random)
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
            contact = self.simulator.world.contact_pair(episode.q[0], episode.target[0])
        info = {
            "distance": float(episode.distance[0]),
            "success": bool(result.success[0]),
            "collision": bool(result.collision[0]),
            "contact": contact,
            **{
                f"reward_{name}": term
                for name, term in zip(REWARD_TERMS, result.terms[0].tolist(), strict=True)
            },
        }
        return (
            episode.observation[0].copy(),
            float(result.reward[0]),
            bool(result.terminated[0]),
            bool(result.truncated[0]),
            info,
        )


def _rst_table(rows: "list[tuple[str, ...]]") -> str:
    """Lay out rows, the first of which are headings, as a table in a docstring."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        " ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    rule = " ".join("=" * width for width in widths)
    return "\n    ".join([rule, lines[0], rule, *lines[1:], rule])


ReachEnv.__doc__ = (ReachEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE", _rst_table([("Index", "Meaning", "Unit"), *observation_table(6)])
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
