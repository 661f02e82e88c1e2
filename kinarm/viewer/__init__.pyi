from .camera import Camera as Camera
from .page import ReplayPage as ReplayPage
from .page import replay_page as replay_page
from .path import replay_path as replay_path
from .renderer import Renderer as Renderer

__all__ = ["Camera", "Renderer", "ReplayPage", "replay_page", "replay_path"]
