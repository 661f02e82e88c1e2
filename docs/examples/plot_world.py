"""
The world
=========

The arm, the benches and a cube in the world frame, and where episodes start and cubes lie.
"""

# %%
# The scene
# ---------
# The world frame has z up, x forward and y to the left; lengths are in metres. The base of the arm
# stands at the origin. A red cube lies on the right bench, and the arm holds its tool point, the
# small orange sphere, just above it. :py:meth:`kinarm.Arm.tool_position` is the forward
# kinematics of that point.

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from kinarm import Arm, Scene, Simulator

sys.path.insert(0, str(Path.cwd() / "docs"))
from drawing import Camera, arm_solids, render, scene_solids

arm, scene = Arm.load("paper"), Scene()
configuration = np.deg2rad([-73.8, 36.6, 22.8, -10.4, -52.4, 0.0])
goal = np.array([0.22, -0.64, scene.bench("right").height + scene.cube_edge / 2])
print("tool point [m]:", arm.tool_position(configuration).round(3))

camera = Camera()
picture = render(arm_solids(arm, configuration) + scene_solids(scene, goal), camera)


def draw_ruler(axes, name, start, direction, ticks, sideways, colour):
    """Draw an axis of the world frame with ticks in metres; ``sideways`` points to the labels."""
    start, direction, sideways = (np.array(v, dtype=float) for v in (start, direction, sideways))
    places = start + np.array(ticks)[:, None] * direction
    tip = places[-1] + 0.08 * direction
    axes.plot(*camera.project([places[0], tip]).T, color=colour, linewidth=1.6)
    for tick, place in zip(ticks, places, strict=True):
        axes.plot(*camera.project([place, place + 0.025 * sideways]).T, color=colour, linewidth=1.2)
        where = camera.project(place + 0.075 * sideways)
        axes.text(*where, f"{tick:g}", color=colour, fontsize=7.5, ha="center", va="center")
    where = camera.project(tip + 0.06 * direction)
    axes.text(*where, f"{name} [m]", color=colour, fontsize=9, ha="center", va="center")


def point_out(axes, text, place, offset):
    """Label a point of the world, ``offset`` pixels away."""
    axes.annotate(
        text,
        camera.project(place),
        xytext=offset,
        textcoords="offset pixels",
        fontsize=9,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": "#444444", "linewidth": 0.8, "shrinkB": 2},
    )


figure = plt.figure(figsize=(9.6, 6.4), dpi=100)
axes = figure.add_axes((0, 0, 1, 1))
axes.imshow(picture)
axes.set_axis_off()
half_metre = np.arange(-0.5, 0.6, 0.25)
draw_ruler(axes, "x", (0, -0.32, 0), (1, 0, 0), half_metre, (0, 1, 0), "#a8201a")
draw_ruler(axes, "y", (-0.58, 0, 0), (0, 1, 0), half_metre, (-1, 0, 0), "#1b6e3c")
draw_ruler(axes, "z", (-0.58, 0.70, 0), (0, 0, 1), half_metre[2:], (0, 1, 0), "#1a4e8a")
point_out(axes, "tool point", arm.tool_position(configuration), (80, 45))
point_out(axes, "cube", goal - np.array([0.0, 0.025, 0.0]), (85, -15))
point_out(axes, "right bench", (-0.1, -0.75, 0.3), (125, 5))
point_out(axes, "left bench", (0.35, 0.65, 0.3), (-10, 70))
point_out(axes, "base, at the origin", (-0.14, 0.12, 0.02), (-110, -20))

# %%
# Starts and goals
# ----------------
# :py:meth:`kinarm.Simulator.sample` draws episodes of a task. The centres of the cubes are uniform
# over the benches. The start is uniform over the *joint* range, less the configurations in
# contact; the tool points that follow from it, seen here from above, are not uniform in space.

simulator = Simulator(arm, "both", scene)
starts, goals = simulator.sample(np.random.default_rng(0), 1500)
tools = np.array([arm.tool_position(start) for start in starts])

figure, axes = plt.subplots(figsize=(6.4, 6.0), layout="constrained")
for bench in scene.benches:
    corner, size = bench.lower[1::-1], (bench.upper - bench.lower)[1::-1]
    axes.add_patch(Rectangle(corner, *size, color="#c9d0d6", zorder=0))
axes.scatter(tools[:, 1], tools[:, 0], s=5, color="#0072b2", label="tool point at the start")
axes.scatter(goals[:, 1], goals[:, 0], s=5, color="#d55e00", label="goal")
axes.plot(0, 0, marker="+", color="black", markersize=12, linestyle="none", label="base")
axes.set(xlabel="y [m] (left bench at y > 0)", ylabel="x [m] (forward)", aspect="equal")
axes.invert_xaxis()
axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=3, frameon=False)
axes.spines[["top", "right"]].set_visible(False)

# sphinx_gallery_thumbnail_number = 1
