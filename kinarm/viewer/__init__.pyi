from .camera import Camera as Camera
from .html_page import HtmlPage as HtmlPage
from .pages import arm_page as arm_page
from .pages import replay_page as replay_page
from .renderer import Renderer as Renderer

__all__ = [
    "Camera",
    "HtmlPage",
    "Renderer",
    "arm_page",
    "replay_page",
]
