from .arm_page import ArmPage as ArmPage
from .arm_page import arm_page as arm_page
from .camera import Camera as Camera
from .page import ReplayPage as ReplayPage
from .page import replay_page as replay_page
from .renderer import Renderer as Renderer

__all__ = ["ArmPage", "Camera", "Renderer", "ReplayPage", "arm_page", "replay_page"]
