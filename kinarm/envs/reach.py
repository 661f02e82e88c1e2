"""The Gymnasium environment: one arm."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import DTypeLike

from kinarm._validation import finite_array
from kinarm.envs.environment import (
    ArmEnvironment,
    action_space,
    environment_metadata,
    make_simulator,
    pick_scenario,
)
from kinarm.envs.infos import TERM_KEYS, Contacts
from kinarm.envs.interface import Array, Observations
from kinarm.envs.rendering import RENDER_MODES, EnvPictures
from kinarm.episodes import COLLISION, RUNNING, SUCCESS, TRUNCATED, Episodes
from kinarm.observation import observation_table
from kinarm.problem import ProblemLike
from kinarm.rollouts import StepResult
from kinarm.scenarios import ScenarioStream

FIRST_ROW = np.zeros(1, dtype=np.int64)
"""The only row of a batch of one."""


class ReachEnv(ArmEnvironment, gymnasium.Env[Any, Array]):
    """Reach a cube on a bench with a six-axis arm (paper, section 3).

    Parameters
    ----------
    problem : ReachProblem, str or Path
        ``"left"``, ``"right"``, ``"both"``, a problem file, or a problem.
    render_mode : {"rgb_array", "rgb_array_list", "human"}, optional
        What `render` returns: a picture, all pictures since it was last called, or nothing, while
        a page in the browser follows the arm. Only films, by Gymnasium's ``RecordVideo``, need the
        extra ``render``.
    width, height : int
        Size of pictures [pixels].
    camera : kinarm.viewer.Camera, optional
        Where pictures are taken from.
    observation_dtype : {"float64", "float32"}
        Type of observations.
    **overrides
        What `kinarm.ReachProblem.replace` takes, such as ``arm``, ``tolerance``, ``horizon``,
        ``start_spread``, or ``reward={"success": 1.0}``.

    Notes
    -----
    **Action** (n = number of actuated joints, 5 for the shipped arms), ``Box(-1, 1, (n,))``:
    fraction of each joint's velocity limit during one time step of 0.02 s. At full speed the joints
    of the default arm move 7, 7, 8, 9 and 9 degrees a step. Larger actions are clipped; float64 is
    accepted and not rounded.

    **Observation** (6 + 7 joints, 48 for the shipped arms), world frame with z up:

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
    ground, an obstacle or the arm itself (the move is refused); truncated after 64 steps. After
    that nothing moves until `reset`: steps have the reward 0, and Gymnasium warns.

    **Info**: ``distance`` [m]; and after a step ``success`` and, the same, ``is_success``;
    ``collision``; ``contact``, the number of the two bodies that would have touched, whose names
    are ``contact_names[contact]``, or 0; and the five reward terms.

    **Versions**: v0, the first.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012  (as Gymnasium declares it)

    def __init__(
        self,
        problem: ProblemLike = "right",
        *,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 360,
        camera: Any = None,
        observation_dtype: DTypeLike = np.float64,
        **overrides: Any,
    ) -> None:
        self.simulator = make_simulator(problem, 1, overrides)
        self.interface = self._make_interface(self.simulator, observation_dtype)
        self.observation_space = self.interface.observation_space
        self.action_space = action_space(self.simulator)
        self.metadata = environment_metadata(self.simulator)
        self.render_mode = render_mode
        picture = {"width": width, "height": height, "camera": camera}
        self._pictures = EnvPictures(self.simulator, render_mode, 1, **picture)
        self._contacts = Contacts(self.simulator.world)
        self._told = ("distance", *(TERM_KEYS if self.interface.tells_terms else ()))
        self._stream: ScenarioStream | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode; ``options`` may set ``start`` and ``goal``."""
        self._check_open()
        super().reset(seed=seed)
        if self._stream is None or seed is not None:
            self._stream = ScenarioStream(self.simulator.world, self.np_random)
        start, goal = self._stream.next()
        if self._episodes is None or options:
            start, goal = pick_scenario(options, start, goal)
            self._episodes = self.simulator.reset([start], [goal])
        else:
            self._episodes.q[0], self._episodes.goal[0] = start, goal
            self.simulator.begin(self._episodes, FIRST_ROW)
        self._pictures.begin(FIRST_ROW, self._episodes)
        distance = self._episodes.distance.item()
        return self._observation(self._episodes), {"distance": distance}

    def step(self, action: Array) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Move for one time step."""
        episode = self.episodes
        if episode.status.item() != RUNNING:
            self._check_action(action)
            return self._rest(episode)
        try:
            result = self.simulator.step(episode, np.asarray(action)[None])
        except ValueError:  # of the simulator, or of NumPy
            self._check_action(action)
            raise
        reward, terminated, truncated = self.interface.step_outcome(episode, result)
        self._contacts.find(episode, result)
        self._pictures.step(episode)
        return (
            self._observation(episode),
            reward.item(),
            terminated.item(),
            truncated.item(),
            self._info(result),
        )

    def render(self) -> Any:
        """Take a picture of the arm; see ``render_mode``."""
        _ = self.episodes  # refuses if there are none
        pictures = self._pictures.render()
        if self.render_mode == "rgb_array_list":
            return [picture for (picture,) in pictures]
        return pictures and pictures[0]

    def close(self) -> None:
        """Close the live page, if there is one; the environment cannot be used any more."""
        self.closed = True
        self._pictures.close()

    def _rest(self, episode: Episodes) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Answer a step after the end: nothing moves."""
        gymnasium.logger.warn(
            "step() was called although the episode is over: call reset() first. "
            "Nothing moves until then, and rewards are 0."
        )
        result, status = StepResult.empty(1), episode.status
        result.numbers[:], result.contact[:] = 0.0, episode.touched * (status == COLLISION)
        result.numbers[1] = episode.distance
        result.flags[:] = np.equal.outer((TRUNCATED, SUCCESS, COLLISION), status)
        self._contacts.find(episode, result)
        ended = bool(result.terminated[0]), bool(result.truncated[0])
        return self._observation(episode), 0.0, *ended, self._info(result)

    def _observation(self, episode: Episodes) -> Observations:
        shown = self.interface.observe(episode.observation)
        if isinstance(shown, dict):
            return {name: part[0] for name, part in shown.items()}
        return shown[0]

    def _info(self, result: StepResult) -> dict[str, Any]:
        """Tell about a step."""
        told = dict(zip(self._told, result.numbers[1:, 0].tolist(), strict=False))
        _, success, collision = result.flags[:, 0].tolist()
        told["success"] = told["is_success"] = success
        told["collision"], told["contact"] = collision, result.contact.item()
        return told

    def _check_action(self, action: Array) -> None:
        """Refuse an action that is not one number for each actuated joint."""
        finite_array("action", action, (self.simulator.n_actions,))


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
