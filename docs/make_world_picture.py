"""Make ``docs/_static/world.png``: the arm in its scene, with the axes of the world in metres.

Run ``python docs/make_world_picture.py`` from the root of a clone.
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from kinarm import Arm
from kinarm.viewer import Camera, Renderer

OUT = Path(__file__).parent / "_static" / "world.png"
WIDTH, HEIGHT, SCALE = 960, 640, 2
CAMERA = Camera(position=(-2.35, -1.5, 1.75), target=(0.03, -0.04, 0.2))
CONFIGURATION = np.deg2rad([-73.8, 36.6, 22.8, -10.4, -52.4, 0.0])
GOAL = np.array([0.22, -0.64, 0.325])


def photograph() -> Image.Image:
    """The arm beside the cube."""
    size = {"width": 2 * SCALE * WIDTH, "height": 2 * SCALE * HEIGHT}
    taken = Renderer("right", camera=CAMERA, **size).render(CONFIGURATION, GOAL)
    return Image.fromarray(taken).reduce(2)


def pixels(points: ArrayLike) -> NDArray[np.float64]:
    """Where points of the world [m] are in the picture, shape (..., 2)."""
    points = np.asarray(points, dtype=float)
    seen = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    seen = seen @ CAMERA.projection(SCALE * WIDTH, SCALE * HEIGHT).T
    return seen[..., :2] / seen[..., 2:]


def draw_ruler(
    axes: Axes,
    name: str,
    start: ArrayLike,
    direction: ArrayLike,
    ticks: NDArray[np.float64],
    sideways: ArrayLike,
    colour: str,
) -> None:
    """Draw an axis of the world frame with ticks in metres; ``sideways`` points to the labels."""
    start, direction, sideways = (np.array(v, dtype=float) for v in (start, direction, sideways))
    places = start + ticks[:, None] * direction
    tip = places[-1] + 0.08 * direction
    middle = {"color": colour, "ha": "center", "va": "center"}
    axes.plot(*pixels([places[0], tip]).T, color=colour, linewidth=1.6)
    for tick, place in zip(ticks, places, strict=True):
        axes.plot(*pixels([place, place + 0.025 * sideways]).T, color=colour, linewidth=1.2)
        axes.text(*pixels(place + 0.075 * sideways), f"{tick:g}", fontsize=8, **middle)
    axes.text(*pixels(tip + 0.06 * direction), f"{name} [m]", fontsize=9.5, **middle)


def point_out(axes: Axes, text: str, place: ArrayLike, offset: tuple[float, float]) -> None:
    """Label a point of the world; ``offset`` is in points."""
    line = {"arrowstyle": "-", "color": "#444444", "linewidth": 0.8, "shrinkB": 2}
    settings = {"textcoords": "offset points", "ha": "center", "va": "center", "fontsize": 9.5}
    axes.annotate(text, pixels(place), xytext=offset, arrowprops=line, **settings)


def main() -> None:
    """Photograph the arm and put rulers and labels on the picture."""
    arm = Arm.load("paper")
    figure = plt.figure(figsize=(9.6, 6.4), dpi=100 * SCALE)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(photograph())
    axes.set_axis_off()
    half_metre = np.arange(-0.5, 0.6, 0.25)
    draw_ruler(axes, "x", (0, -0.32, 0), (1, 0, 0), half_metre, (0, 1, 0), "#a8201a")
    draw_ruler(axes, "y", (-0.58, 0, 0), (0, 1, 0), half_metre, (-1, 0, 0), "#1b6e3c")
    draw_ruler(axes, "z", (-0.58, 0.70, 0), (0, 0, 1), half_metre[2:], (0, 1, 0), "#1a4e8a")
    point_out(axes, "tool point", arm.tool_position(CONFIGURATION), (65, 40))
    point_out(axes, "cube", GOAL - [0.0, 0.025, 0.0], (70, -10))
    point_out(axes, "right bench", (-0.1, -0.75, 0.3), (100, -5))
    point_out(axes, "left bench", (0.35, 0.65, 0.3), (-10, 55))
    point_out(axes, "base, at the origin", (-0.14, 0.12, 0.02), (-90, -20))
    figure.savefig(OUT)
    Image.open(OUT).convert("RGB").quantize(256).save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
