"""Pictures of the arms of an environment, and a live page that follows them."""

from __future__ import annotations

import math
import webbrowser
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import COLLISION, SUCCESS, TRUNCATED, Episodes
from kinarm.errors import InvalidInputError
from kinarm.observation import part_slices
from kinarm.simulator import Simulator
from kinarm.viewer.camera import Camera, CameraLike, picture_size

if TYPE_CHECKING:
    from kinarm.collision import Contact
    from kinarm.viewer.live_stage import LiveStage
    from kinarm.viewer.renderer import Renderer

Picture = NDArray[np.uint8]

RENDER_MODES = ("rgb_array", "rgb_array_list", "human")

OUTCOMES = {SUCCESS: "success", COLLISION: "collision", TRUNCATED: "truncated"}

FULL_SIZE = 4
"""Up to so many arms have pictures of the full size; more share the area that these take."""


class Pictures(tuple[Picture, ...]):
    """Pictures of all arms, of one size, as Gymnasium expects them of a batch."""

    @property
    def tiled(self) -> Picture:
        """All in one picture, row by row from the upper left; empty tiles are white."""
        height, width = self[0].shape[:2]
        columns = _columns(len(self))
        rows = math.ceil(len(self) / columns)
        sheet = np.full((rows, height, columns, width, 3), 255, dtype=np.uint8)
        for number, picture in enumerate(self):
            sheet[number // columns, :, number % columns] = picture
        return sheet.reshape(rows * height, columns * width, 3)


class EnvPictures:
    """Pictures of the arms of an environment.

    Nothing is drawn, imported or built before a picture is needed.

    Parameters
    ----------
    simulator : Simulator
        Simulator of the environment.
    mode : str, optional
        One of `RENDER_MODES`; with None, all calls return at once.
    num_envs : int
        Number of arms.
    width, height : int
        Size of a picture [pixels]. More than four arms share the area of four: 64 have pictures
        of a quarter of the width and height.
    camera : Camera, optional
        Where pictures are taken from; as the replay page does by default.

    Attributes
    ----------
    mode : str or None
        As given.

    Raises
    ------
    InvalidInputError
        If there is no such mode, or the size or the camera cannot be used.
    """

    def __init__(
        self,
        simulator: Simulator,
        mode: str | None,
        num_envs: int,
        *,
        width: int = 480,
        height: int = 360,
        camera: CameraLike | None = None,
    ) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise InvalidInputError(
                f"render_mode must be one of {list(RENDER_MODES)} or None, got {mode!r}"
            )
        self._size = _tile_size(num_envs, *picture_size(width, height))
        self._camera = None if camera is None else Camera.checked(camera)
        self.mode = mode
        self._simulator, self._num_envs = simulator, num_envs
        horizon = 0 if mode is None else simulator.task.horizon
        self._traces = np.empty((num_envs, horizon + 1, 3) if mode else (0, 0, 3))
        self._contacts: dict[int, Contact | None] = {}
        self._frames: list[Pictures] = []
        self._renderer: Renderer | None = None
        self._stage: LiveStage | None = None
        self._begun: Episodes

    def begin(self, rows: NDArray[np.int64], episodes: Episodes) -> None:
        """Take note that the episodes of some arms were begun."""
        if self.mode is None:
            return
        self._begun = episodes
        self._traces[rows, 0] = self._tools(episodes)[rows]
        for row in rows.tolist():
            self._contacts.pop(row, None)
        if self.mode == "rgb_array_list":
            anew = len(rows) == self._num_envs
            del self._frames[0 if anew else -1 :]
            self._frames.append(self._take())
        elif self.mode == "human" and 0 in rows:
            self._live_stage().begin(episodes.q[0], episodes.goal[0])

    def step(self, episodes: Episodes) -> None:
        """Take note that all arms moved, or rested because their episode is over."""
        if self.mode is None:
            return
        self._begun = episodes
        self._traces[np.arange(self._num_envs), episodes.steps] = self._tools(episodes)
        for row in np.flatnonzero(episodes.status == COLLISION).tolist():
            if row not in self._contacts:
                self._contacts[row] = self._simulator.world.contact(
                    episodes.q[row], episodes.target[row]
                )
        if self.mode == "rgb_array_list":
            self._frames.append(self._take())
        elif self.mode == "human":
            stage = self._live_stage()
            stage.show(episodes.q[0])
            stage.draw_trace(*self._way(0))
            stage.pace(self._simulator.problem.stepping.time_step)

    def render(self) -> Any:
        """Show the arms.

        Returns
        -------
        Pictures, list of Pictures or None
            ``"rgb_array"``: a picture of each arm. ``"rgb_array_list"``: such pictures of all
            steps since the last call, or since all arms began anew. ``"human"`` or no mode: None.
        """
        if self.mode == "rgb_array":
            return self._take()
        if self.mode == "rgb_array_list":
            frames, self._frames = self._frames, []
            return frames
        return None

    def __getstate__(self) -> dict[str, Any]:
        """Copies draw with a renderer, and on a page, of their own."""
        return {**self.__dict__, "_renderer": None, "_stage": None}

    def close(self) -> None:
        """End the live page, and forget all pictures."""
        if self._stage is not None:
            self._stage.server.close()
        self._stage, self._renderer, self._frames = None, None, []

    def _take(self) -> Pictures:
        """A picture of each arm."""
        if self._renderer is None:
            from kinarm.viewer.renderer import Renderer

            width, height = self._size
            self._renderer = Renderer(
                self._simulator.problem, width=width, height=height, camera=self._camera
            )
        return Pictures(self._picture(self._renderer, row) for row in range(self._num_envs))

    def _picture(self, renderer: Renderer, row: int) -> Picture:
        """Picture of one arm."""
        q, goal = self._begun.q[row], self._begun.goal[row]
        trace, outcome = self._way(row)
        contact = self._contacts.get(row)
        return renderer.render(q, goal, trace=trace, outcome=outcome, contact=contact)

    def _live_stage(self) -> LiveStage:
        """The live page, opened with the first call."""
        if self._stage is None:
            from kinarm.viewer.live_server import LiveServer
            from kinarm.viewer.live_stage import LiveStage

            server = LiveServer()
            self._stage = LiveStage(server, self._simulator.problem, self._simulator.arm)
            webbrowser.open(server.address)
        return self._stage

    def _way(self, row: int) -> tuple[NDArray[np.float64], str | None]:
        """Where the tool of an arm has been, shape (n, 3) [m], and how the episode ended."""
        outcome = OUTCOMES.get(int(self._begun.status[row]))
        return self._traces[row, : self._begun.steps[row] + 1], outcome

    def _tools(self, episodes: Episodes) -> NDArray[np.float64]:
        """Tool points, shape (num_envs, 3) [m]."""
        offset = part_slices(self._simulator.arm.n_joints)["goal_minus_tool"]
        return episodes.goal - episodes.observation[:, offset]


def _columns(count: int) -> int:
    """How many pictures stand side by side."""
    return math.ceil(math.sqrt(count))


def _tile_size(count: int, width: int, height: int) -> tuple[int, int]:
    """Size of each of some pictures [pixels], so that they take the area of four at most."""
    share = math.sqrt(FULL_SIZE) / max(_columns(count), math.sqrt(FULL_SIZE))
    return max(round(width * share), 1), max(round(height * share), 1)
