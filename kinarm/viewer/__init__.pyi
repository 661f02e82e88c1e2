from .camera import Camera as Camera
from .html_page import HtmlPage as HtmlPage
from .pages import replay_page as replay_page
from .renderer import Renderer as Renderer

__all__ = [
    "Camera",
    "HtmlPage",
    "Renderer",
    "replay_page",
]
