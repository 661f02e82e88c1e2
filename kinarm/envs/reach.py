"""The Gymnasium environment: one arm."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import DTypeLike

from kinarm.envs.environment import ArmEnvironment, Array, Observations, one_by_one
from kinarm.episodes import RUNNING, Episodes
from kinarm.errors import InvalidInputError, finite_array
from kinarm.problem import ProblemLike
from kinarm.simulator import StepResult


class ReachEnv(ArmEnvironment, gymnasium.Env[Any, Array]):
    """Reach a cube on a bench with a six-axis arm (paper, section 3).

    Parameters
    ----------
    problem : ReachProblem, str or Path
        ``"left"``, ``"right"``, ``"both"``, a problem file, or a problem.
    render_mode : {"rgb_array", "human"}, optional
        What `render` returns: a picture, or nothing, while a browser's page
        follows the arm. Films, by Gymnasium's ``RecordVideo``, need the extra
        ``render``.
    width, height : int
        Size of pictures [pixels].
    camera : kinarm.viewer.Camera, optional
        Where pictures are taken from.
    observation_dtype : {"float64", "float32"}
        Type of observations.
    **overrides
        What `kinarm.ReachProblem.replace` takes, such as ``arm``,
        ``tolerance``, ``horizon``, ``start_spread``, or ``reward={"success":
        1.0}``.

    Notes
    -----
    **Action** (n = number of actuated joints, 5 for the shipped arms), ``Box(-1, 1, (n,))``:
    fraction of each joint's velocity limit during one time step of 0.02 s. At full speed the joints
    of the default arm move 7, 7, 8, 9 and 9 degrees a step. Larger actions are clipped; float64 is
    not rounded.

    **Observation** (6 + 7 joints, 48 for the shipped arms), world frame with z
    up:

    ===== ====================================================== ====
    Index Meaning                                                Unit
    ===== ====================================================== ====
    0-2   position of the goal x, y, z                           m
    3-5   goal minus tool point x, y, z                          m
    6-29  orientation of each joint frame, quaternion w, x, y, z 1
    30-47 position of each joint frame x, y, z                   m
    ===== ====================================================== ====

    Quaternions are composed along the chain, so they do not flip signs.

    **Reward**: sum of the terms ``reward_progress`` (metres by which the tool
    came closer), ``reward_closer`` (0, for every step closer), ``reward_step``
    (0), ``reward_collision`` (-1 when a move touches something) and
    ``reward_success`` (0), with the default weights in brackets; see
    `kinarm.RewardWeights`.

    **Start**: each actuated joint uniform within its limits, until the arm
    touches nothing and the tool is farther from the goal than the tolerance.
    Goals are uniform over the task's regions. ``reset(options={"start": q,
    "goal": p})`` sets either.

    **End**: terminated when the tool is within 0.05 m of the goal, or when a
    move would touch the ground, an obstacle or the arm itself (the move is
    refused); truncated after 64 steps. A step after the end is an error.

    **Info**: ``distance`` [m]; ``configuration``, the joint positions [rad or
    m], as the attribute of that name has them; and after a step ``success``
    and, the same, ``is_success``; ``collision``; ``contact``, the number of
    two bodies that would touch at the move's end, or if none do, on its way, whose names are
    ``contact_names[contact]``, or 0; and the five reward terms.

    **Versions**: v0, the first.
    """

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
        picture = {"width": width, "height": height, "camera": camera}
        settings = overrides, observation_dtype, render_mode
        self._set_up(problem, 1, 1, *settings, **picture)
        self.observation_space = self.interface.observation_space
        self.action_space = self.interface.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode; ``options`` may set ``start`` and ``goal``."""
        super().reset(seed=seed)
        if self._episodes is None or seed is not None:
            self._queues.seed(0, self.np_random)
        episode = self._begin(np.arange(1), options)
        info = {"distance": episode.distance.item(), "configuration": self.configuration}
        return self._observation(episode), info

    def step(self, action: Array) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Move for one time step."""
        episode = self.episodes
        if episode.status.item() != RUNNING:
            raise InvalidInputError("the episode is over: call reset() first")
        try:
            result = self.simulator.step(episode, np.asarray(action)[None])
        except ValueError:  # of the simulator, or of NumPy
            finite_array("action", action, (self.simulator.n_actions,))
            raise
        reward, terminated, truncated = self.interface.step_outcome(episode, result)
        self._find_contacts(episode, result)
        self._pictures.step(episode)
        answer = reward.item(), terminated.item(), truncated.item()
        return self._observation(episode), *answer, self._info(episode, result)

    def render(self) -> Any:
        """Take a picture of the arm (``render_mode``)."""
        _ = self.episodes  # refuses if there are none
        pictures = self._pictures.render()
        return pictures and pictures[0]

    @property
    def configuration(self) -> Array:
        """A copy of the joint positions, shape (n_joints,) [rad or m]."""
        return np.array(self.episodes.q[0])

    def close(self) -> None:
        """Close the live page, if any."""
        self._pictures.close()

    def _observation(self, episode: Episodes) -> Observations:
        return one_by_one(self.interface.observe(episode.observation), 1)[0]

    def _info(self, episode: Episodes, result: StepResult) -> dict[str, Any]:
        told = dict(zip(self._told, result.numbers[1:, 0].tolist(), strict=False))
        _, success, collision = result.flags[:, 0].tolist()
        told["success"] = told["is_success"] = success
        told["collision"], told["contact"] = collision, result.contact.item()
        told["configuration"] = episode.q[0].copy()
        return told
