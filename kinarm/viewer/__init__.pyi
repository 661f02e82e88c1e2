from .arm_page import ArmPage as ArmPage
from .arm_page import arm_page as arm_page
from .camera import Camera as Camera
from .renderer import Renderer as Renderer
from .replays import ReplayPage as ReplayPage
from .replays import replay_page as replay_page
from .replays import replay_path as replay_path

__all__ = [
    "ArmPage",
    "Camera",
    "Renderer",
    "ReplayPage",
    "arm_page",
    "replay_page",
    "replay_path",
]
