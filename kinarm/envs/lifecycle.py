"""The life of an environment: it is made, reset, stepped and closed, in this order."""

from kinarm.envs.errors import ClosedEnvironmentError, ResetNeededError
from kinarm.episodes import Episodes


class Lifecycle:
    """An environment that refuses to be used before its first reset, and after its end."""

    closed: bool = False
    _episodes: Episodes | None = None

    @property
    def episodes(self) -> Episodes:
        """The episodes under way, one row per arm.

        Raises
        ------
        ClosedEnvironmentError
            If the environment is closed.
        ResetNeededError
            If it was never reset.
        """
        self._check_open()
        if self._episodes is None:
            raise ResetNeededError("the environment was never begun: call reset()")
        return self._episodes

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("the environment is closed: make another one")
