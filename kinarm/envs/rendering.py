"""Pictures of the arms of an environment."""

from typing import Any

from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError
from kinarm.simulator import Simulator

RENDER_MODES = ("rgb_array", "rgb_array_list", "human")


class EnvPictures:
    """Placeholder until the renderer is merged."""

    def __init__(self, simulator: Simulator, mode: str | None, num_envs: int, **_: Any) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise InvalidInputError(
                f"render_mode must be one of {list(RENDER_MODES)} or None, got {mode!r}"
            )
        self.mode, self._num = mode, num_envs
        self._shape = (_["height"], _["width"], 3)
        self._simulator = simulator

    def begin(self, rows: object, episodes: Episodes) -> None:
        """Nothing yet."""

    def step(self, episodes: Episodes) -> None:
        """Nothing yet."""

    def render(self) -> Any:
        """Nothing yet."""
        import numpy as np

        frames = tuple(np.zeros(self._shape, np.uint8) for _ in range(self._num))
        if self.mode == "rgb_array":
            return frames
        return [frames] if self.mode == "rgb_array_list" else None

    def close(self) -> None:
        """Nothing yet."""
