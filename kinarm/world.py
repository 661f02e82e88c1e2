"""The world of a problem: arm, scene, and questions about configurations."""

from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import available_threads, run_rows
from kinarm.bodies import PARKED
from kinarm.chain import Chain
from kinarm.collision import ContactModel
from kinarm.contact_shapes import PLANE, ContactShapes, unit_boxes
from kinarm.episode_draws import EpisodePlants, drawn_rows
from kinarm.episodes import Control, Episodes, Rules, shield_table
from kinarm.errors import InvalidInputError, finite_array, one_or_many, whole_number
from kinarm.goal_kinematics import GoalKinematics
from kinarm.kernels.compiling import Array, Stage
from kinarm.kernels.network import ACT_BY_NETWORKS
from kinarm.kernels.records import recorded
from kinarm.kernels.rollout import begin
from kinarm.kernels.screening import screen
from kinarm.kernels.session import Session
from kinarm.kernels.shield import REPLACE_STEP
from kinarm.kernels.work_space import Alone, Block, furnish, sizes_of, work_space
from kinarm.observation import observer
from kinarm.observation_layout import ObservationLayout
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scene_draws import SceneDraws
from kinarm.step_contact import StepContact
from kinarm.task import NEVER


class World(GoalKinematics, StepContact):
    """An arm in a scene.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or file.
    threads : int, optional
        Threads for large batches; as many as available processors by default.

    Attributes
    ----------
    problem, arm : ReachProblem and Arm
        What it was built from.
    contact_model : ContactModel
        Shapes that may touch.
    starts : ndarray, shape (n, n_joints)
        The task's starts [rad or m]; empty if it has none.
    rules : Rules
        Task and motion limits for the kernels.
    plants : EpisodePlants
        Draws the plants of episodes.
    has_random_bodies : bool
        Whether each episode has a scene of its own.

    Notes
    -----
    Of bodies that move, questions about configurations take the first position,
    and those about steps the position at the number of the step, from 0.
    """

    def __init__(self, problem: ProblemLike, *, threads: int | None = None) -> None:
        self.problem = ReachProblem.load(problem)
        wanted = available_threads() if threads is None else threads
        self.threads = whole_number("threads", wanted, 1)
        self.arm = self.problem.load_arm()
        self.contact_model = ContactModel.build(self.arm, self.problem.scene)
        self._derive()
        self.has_random_bodies = bool(self.problem.scene.random_bodies)
        self._idle: list[tuple[Block, Alone]] = []

    def _derive(self) -> None:
        """Find what kernels have to know of the problem."""
        task, stepping = self.problem.task, self.problem.stepping
        self.starts = self.checked("task.starts", task.starts)
        self.rules = Rules(
            step_limit=self.arm.velocity_limits[: self.arm.n_actuated] * stepping.time_step,
            tested=stepping.tested_configurations,
            tolerance=float(task.tolerance) if task.tolerance > NEVER else -1.0,
            horizon=int(task.horizon),
            reward=task.reward.vector,
            moves=self.problem.body_offsets(np.arange(task.horizon + 1)),
            time_step=stepping.time_step,
            commanded=int(self.problem.plant.feedback == "commanded"),
            **self.layout.rules(self.problem),
            boxes=unit_boxes(self.problem.scene.bodies),
            goal=self._goal_rules(),
            shield=shield_table(self.arm.n_actuated if stepping.shield else 0),
        )
        self.plants = EpisodePlants(self.problem, self.rules.step_limit)

    def __repr__(self) -> str:
        return f"World({self.problem!r})"

    def __getstate__(self) -> dict[str, Any]:
        # A copy may get other rules or bodies, and needs its own work space.
        own = ("records", "layout", "_stages", "goals", "goal_width", "reachable_of_sample")
        kept = {name: value for name, value in self.__dict__.items() if name not in own}
        return kept | {"_idle": []}

    @cached_property
    def layout(self) -> ObservationLayout:
        """Where the parts of an observation are."""
        return ObservationLayout.of(self.problem, self.arm)

    @cached_property
    def records(self) -> tuple[Chain, ContactShapes, Rules]:
        """Chain, shapes and rules for the kernels, by their addresses."""
        shapes = self.contact_model.shapes
        return recorded(self.arm.chain), recorded(shapes), recorded(self.rules)

    @cached_property
    def _stages(self) -> tuple[Stage, Stage, Stage]:
        """What writes observations, runs networks and replaces steps; see `Session`."""
        return observer(tuple(self.layout.places)), ACT_BY_NETWORKS, REPLACE_STEP

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return self.layout.size

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return self.arm.n_actuated

    def observe(self, configurations: ArrayLike, goals: ArrayLike, step: int = 0) -> Array:
        """Observations of configurations, shape (n, n_observations), also of those in contact.

        They are those of episodes that begin there, after so many steps, if plants are ideal. Takes
        joint positions, shape (n, n_joints) [rad or m], and goals, shape (n, goal_width).
        """
        return self._begun_at(configurations, goals, step).observation

    def distances(self, configurations: ArrayLike, goals: ArrayLike) -> Array:
        """Distances of the tool from goals, shape (n,) [m]; see `observe`."""
        return self._begun_at(configurations, goals).distance

    def screen(
        self, configurations: ArrayLike, scenes: Array | None = None
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Tool points, shape (n, 3) [m], and which configurations touch something, shape (n,).

        Takes joint positions, shape (n, n_joints) [rad or m], perhaps in scenes of `scenes_of`.
        """
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        tools, free, touching, n_proven = self.proven(q, scenes)
        if n_proven < len(q):
            doubtful = ~(free | touching)
            there = self.no_scenes if scenes is None or not len(scenes) else scenes[doubtful]
            touching[doubtful] = self.contact_model.touching(q[doubtful], there)
        return tools, touching

    def free(self, q: Array, scenes: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Tool points, shape (n, 3) [m], and which configurations count as free in draws.

        Without scenes, Coal decides as in `screen`. In scenes of their own, those are free that
        kernels prove to be: of what these leave open, Coal calls about one in 300 free, and takes
        most of the time.
        """
        if len(scenes):
            return self.proven(q, scenes)[:2]
        tools, touching = self.screen(q)
        return tools, ~touching

    def proven(
        self, q: Array, scenes: Array | None = None
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_], int]:
        """Tool points of finite configurations, and what kernels prove of these.

        Points have the shape (n, 3) [m]. Then follow which are free, which touch something, shape
        (n,) each, and how many are one or the other; Coal decides about the rest. Takes the scenes
        of `scenes_of`, one for each; without, random bodies are absent.
        """
        n, scenes = len(q), self.no_scenes if scenes is None else scenes
        tools, free, touching = np.empty((n, 3)), np.empty(n, dtype=bool), np.empty(n, dtype=bool)
        chain, shapes, _ = self.records
        arrays = (chain, shapes, q, scenes, tools, free, touching)
        n_proven = run_rows(self._screen_some, n, n, self.threads, *arrays)
        return tools, free, touching, n_proven

    def in_contact(self, configurations: ArrayLike) -> NDArray[np.bool_]:
        """Whether configurations, as for `poses`, touch something, shape () or (n,)."""
        q, one = one_or_many("configurations", configurations, (self.arm.n_joints,))
        touching = self.screen(q)[1]
        return touching[0] if one else touching

    def contact_pairs(self, configurations: ArrayLike) -> tuple[tuple[str, str] | None, ...]:
        """First tested pair that touches, per configuration; None where nothing does.

        Takes joint positions, shape (n, n_joints) [rad or m].
        """
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        pairs: list[tuple[str, str] | None] = [None] * len(q)
        for row in np.flatnonzero(self.in_contact(q)):
            pairs[row] = self.contact_model.contact_pair(q[row])
        return tuple(pairs)

    @cached_property
    def _draws(self) -> SceneDraws:
        return SceneDraws.of(self.problem.scene)

    def scenes_of(self, starts: Array, goals: Array) -> Array:
        """Rows of the bodies of each episode, shape (n, n_placed, 16); empty if all have the same.

        See `kinarm.contact_shapes.ContactShapes.placed`. Takes starts, shape (n, n_joints) [rad or
        m], and goals, shape (n, goal_width); ProblemError if a body finds no place.
        """
        if not self.has_random_bodies:
            return self.no_scenes
        drawn = self.problem.scene, self._draws, self.arm.chain
        scenes = drawn_rows(*drawn, starts, np.ascontiguousarray(goals[:, :3]), self.threads)
        shapes, moving = self.contact_model.shapes, list(self.problem.scene.moving)
        if not len(shapes.moving):  # see `without_moving_bodies`
            scenes[:, moving, 13:] = shapes.placed[moving, 13:]
        return scenes

    def changed(self, **changes: Any) -> Self:
        """The same world of a problem with other settings of task, plant, observation or stepping.

        Takes what `kinarm.ReachProblem.replace` does, but for arm and scene. Raises ProblemError if
        arm or scene cannot have the observation.
        """
        other = copy(self)
        other.problem = self.problem.replace(**changes)
        other._derive()
        return other

    def in_scene(self, start: ArrayLike, goal: ArrayLike) -> Self:
        """The world of one episode, whose random bodies stay where they are.

        Takes its start, shape (n_joints,) [rad or m], and its goal, shape (3 or goal_width,).
        """
        if not self.has_random_bodies:
            return self
        q = finite_array("start", start, (self.arm.n_joints,))
        aim = finite_array("goal", goal, (3 if np.size(goal) == 3 else self.goal_width,))
        other, scenes = copy(self), self.scenes_of(q[None], aim[None])
        other.has_random_bodies = False
        other.contact_model = self.contact_model.fixed(scenes[0])
        return other

    def without_moving_bodies(self) -> Self:
        """The same world without the bodies that move."""
        shapes = self.contact_model.shapes
        if not len(shapes.moving):
            return self
        rows = shapes.placed.copy()
        # What is on the other side of a half-space is far from its plane.
        rows[shapes.moving, 13:] = PARKED[2] * rows[shapes.moving][:, [6, 9, 12]]
        other, model = copy(self), self.contact_model.fixed(rows)
        none = np.zeros(0, dtype=np.int64)
        other.contact_model = replace(model, shapes=model.shapes._replace(moving=none))
        return other

    def episodes(
        self, starts: Array, goals: Array, *, record: bool = False, shift: Array | None = None
    ) -> Episodes:
        """Episodes at their starts; the kernel ``begin`` completes them.

        Parameters
        ----------
        starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
            Configurations [rad or m] and goals [m].
        record : bool
            Whether configurations are kept.
        shift : ndarray, shape (n_observations,), optional
            Collect sums of the observations about it.
        """
        n, n_joints = starts.shape
        horizon, n_observations = self.rules.horizon, self.n_observations
        shapes = self.contact_model.shapes
        own_scenes = self.has_random_bodies or len(shapes.moving) > 0
        shielded = len(self.rules.shield) > 0
        plants = np.zeros((n if self.plants.width else 0, self.plants.width))
        return Episodes(
            status=np.zeros(n, dtype=np.int64),
            steps=np.zeros(n, dtype=np.int64),
            stop=np.full(n, horizon),
            q=starts.copy(),
            target=starts.copy(),
            doubt=np.zeros(n, dtype=np.int64),
            touched=np.zeros(n, dtype=np.int64),
            cleared=np.zeros(n, dtype=bool),
            planes=np.zeros((n, shapes.travel.shape[1], PLANE)),
            scenes=np.tile(shapes.placed, (n if own_scenes else 0, 1, 1)),
            plant=plants,
            drive=self.plants.at_rest(plants, starts[: len(plants)]),
            sensed=starts.copy() if self.plants.width else starts[:0],
            goal=goals.copy(),
            pursuit=self.pursuit(goals, record=record),
            observation=np.zeros((n, n_observations)),
            distance=np.zeros(n),
            terms=np.zeros((n, len(self.rules.reward))),
            total=np.zeros(n),
            moments=np.zeros((0 if shift is None else n, 2, n_observations)),
            shift=np.zeros(n_observations) if shift is None else shift.copy(),
            shielding=np.zeros(n, dtype=np.int64),
            blocker=np.zeros(n, dtype=np.int64),
            interventions=np.zeros(n if shielded else 0, dtype=np.int64),
            replaced=np.zeros((n if shielded and record else 0, horizon), dtype=np.int64),
            path=np.full((n, horizon + 1, n_joints) if record else (0, 0, n_joints), np.nan),
        )

    def session(self, control: Control, episodes: Episodes) -> Session:
        """Bind episodes and their source of actions for the kernels."""
        return Session(*self.records, recorded(control), recorded(episodes), self._stages)

    def _screen_some(self, first: int, last: int, *arrays: Any) -> int:
        """Screen some rows, with work space for this thread alone."""
        try:
            space = self._idle.pop()
        except IndexError:
            shapes = self.contact_model.shapes
            space = work_space(n_joints=self.arm.n_joints, **sizes_of(shapes))
            furnish(shapes.placed, *space)
        n_proven = screen(first, last, np.arange(first, last), *space, *arrays)
        self._idle.append(space)
        return n_proven

    def checked_steps(self, taken: NDArray[np.int64] | int) -> NDArray[np.int64]:
        """Numbers of steps taken before, one or of each episode, within the horizon."""
        steps, horizon = np.asarray(taken), self.rules.horizon
        whole = steps.dtype.kind in "iu"
        if not whole or steps.min(initial=0) < 0 or steps.max(initial=0) > horizon:
            raise InvalidInputError(f"steps taken must be whole numbers in 0..{horizon}")
        return steps

    def _begun_at(self, configurations: ArrayLike, goals: ArrayLike, step: int = 0) -> Episodes:
        """Episodes that begin at configurations, in contact or not."""
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        goal = finite_array("goals", goals, (len(q), self.goal_width))
        session = self.session(Control(), self.episodes(q, goal))
        session.episodes.steps[:] = self.checked_steps(step)
        if self.has_random_bodies and self.layout.sees_bodies:
            session.episodes.scenes[:] = self.scenes_of(q, goal)
        begin(np.zeros(1, dtype=np.int64), session, np.arange(len(q)))
        return session.episodes
