from .camera import Camera as Camera
from .pages import ArmPage as ArmPage
from .pages import ReplayPage as ReplayPage
from .pages import arm_page as arm_page
from .pages import replay_page as replay_page
from .pages import replay_path as replay_path
from .renderer import Renderer as Renderer

__all__ = [
    "ArmPage",
    "Camera",
    "Renderer",
    "ReplayPage",
    "arm_page",
    "replay_page",
    "replay_path",
]
