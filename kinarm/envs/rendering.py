"""Pictures of an environment's arms, and a live page."""

import math
import webbrowser
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm.episode_draws import scene_of_episode
from kinarm.episodes import COLLISION, SUCCESS, TRUNCATED, Episodes
from kinarm.errors import InvalidInputError, whole_number
from kinarm.simulator import Simulator
from kinarm.viewer.camera import Camera

if TYPE_CHECKING:
    from kinarm.collision import Contact
    from kinarm.viewer.drawing import LiveStage
    from kinarm.viewer.renderer import Renderer

Picture = NDArray[np.uint8]

RENDER_MODES = ("rgb_array", "human")

OUTCOMES = {SUCCESS: "success", COLLISION: "collision", TRUNCATED: "truncated"}

FULL_SIZE = 4
"""Largest number of arms with full-size pictures; more share their area."""


class EnvPictures:
    """Pictures of the arms of an environment, by the settings of `ReachEnv`.

    Without a mode nothing happens, and nothing is drawn or imported before it is needed.
    """

    def __init__(
        self,
        simulator: Simulator,
        mode: str | None,
        num_envs: int,
        *,
        width: int,
        height: int,
        camera: Camera | None,
    ) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise InvalidInputError(
                f"render_mode must be one of {list(RENDER_MODES)} or None, got {mode!r}"
            )
        columns = math.ceil(math.sqrt(num_envs))
        share = math.sqrt(FULL_SIZE) / max(columns, math.sqrt(FULL_SIZE))
        sides = {"width": width, "height": height}.items()
        wanted = [whole_number(name, pixels, 1) for name, pixels in sides]
        self._size = [max(round(pixels * share), 1) for pixels in wanted]
        if camera is not None and not isinstance(camera, Camera):
            raise InvalidInputError(f"camera must be a kinarm.viewer.Camera, got {camera!r}")
        self._camera = camera
        self.mode = mode
        self._simulator, self._num_envs = simulator, num_envs
        self._traces = np.empty((num_envs if mode else 0, simulator.task.horizon + 1, 3))
        self._contacts: dict[int, Contact | None] = {}
        self._starts = np.zeros((num_envs, simulator.arm.n_joints))
        self._renderers: dict[int, Renderer] = {}
        self._stage: LiveStage | None = None
        self._begun: Episodes

    def begin(self, rows: NDArray[np.int64], episodes: Episodes) -> None:
        """Note the episodes that some arms begin."""
        if self.mode is None:
            return
        self._begun = episodes
        self._traces[rows, 0] = self._tools(episodes)[rows]
        self._starts[rows] = episodes.q[rows]
        for row in rows.tolist():
            self._contacts.pop(row, None)
            if self._simulator.world.has_random_bodies:
                self._renderers.pop(row, None)
        if self.mode == "human" and 0 in rows:
            self._live_stage().begin(episodes.q[0], episodes.goal[0])

    def step(self, episodes: Episodes) -> None:
        """Note that all arms moved, or rested after their episode."""
        if self.mode is None:
            return
        self._begun = episodes
        self._traces[np.arange(self._num_envs), episodes.steps] = self._tools(episodes)
        for row in np.flatnonzero(episodes.status == COLLISION).tolist():
            if row not in self._contacts:
                world = self._simulator.world.in_scene(self._starts[row], episodes.first_goals[row])
                refused, step = (episodes.q[row], episodes.target[row]), int(episodes.steps[row])
                self._contacts[row] = world.contact(*refused, step=step - 1)
        if self.mode == "human":
            stage = self._live_stage()
            stage.show(episodes.q[0], int(episodes.steps[0]))
            stage.aim(episodes.goal[0])
            stage.draw_trace(*self._way(0))
            stage.pace(self._simulator.problem.stepping.time_step)

    def __getstate__(self) -> dict[str, Any]:
        """Copies have their own renderer and page."""
        return {**self.__dict__, "_renderers": {}, "_stage": None}

    def close(self) -> None:
        """End the live page."""
        if self._stage is not None:
            self._stage.close()
        self._stage, self._renderers = None, {}

    def render(self) -> tuple[Picture, ...] | None:
        """A picture of each arm, in the mode for it."""
        if self.mode != "rgb_array":
            return None
        pictures = []
        for row, (q, goal) in enumerate(zip(self._begun.q, self._begun.goal, strict=True)):
            trace, outcome = self._way(row)
            contact, render = self._contacts.get(row), self._renderer(row).render
            time = self._begun.steps[row] * self._simulator.problem.stepping.time_step
            shown = {"trace": trace, "outcome": outcome, "contact": contact, "time": time}
            pictures.append(render(q, goal, **shown))
        return tuple(pictures)

    def _renderer(self, row: int) -> "Renderer":
        """Renderer of an arm's scene, one for all arms if they have the same."""
        world = self._simulator.world
        key = row if world.has_random_bodies else 0
        if key not in self._renderers:
            from kinarm.viewer.renderer import Renderer

            episode = self._starts[row], self._begun.first_goals[row]
            scene = scene_of_episode(world.problem.scene, world.arm, *episode)
            problem, (width, height) = world.problem.replace(scene=scene), self._size
            self._renderers[key] = Renderer(
                problem, width=width, height=height, camera=self._camera
            )
        return self._renderers[key]

    def _live_stage(self) -> "LiveStage":
        if self._stage is None:
            from kinarm.viewer.drawing import LiveStage

            self._stage = LiveStage(self._simulator.problem, self._simulator.arm)
            webbrowser.open(self._stage.address)
        return self._stage

    def _way(self, row: int) -> tuple[NDArray[np.float64], str | None]:
        """The tool's way of an arm, shape (n, 3) [m], and how the episode ended."""
        outcome = OUTCOMES.get(int(self._begun.status[row]))
        return self._traces[row, : self._begun.steps[row] + 1], outcome

    def _tools(self, episodes: Episodes) -> NDArray[np.float64]:
        """Tool points, shape (num_envs, 3) [m]."""
        return self._simulator.world.poses(episodes.q)[:, :3, 3]
