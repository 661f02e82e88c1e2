"""The viewer: recordings as pages that play offline, and scenes that are served live."""

from kinarm.viewer.page import ReplayPage, replay_page

__all__ = ["ReplayPage", "replay_page"]
