"""
Starts and goals
================

Where episodes start and where the cubes lie, seen from above.
"""

# %%
# :py:meth:`kinarm.Simulator.sample` draws starts and goals of a problem. The centres of the cubes
# are uniform over the benches. The start is uniform over the *joint* range, less the configurations
# in contact; the tool points that follow from it by forward kinematics
# (:py:meth:`kinarm.Arm.tool_position`) are not uniform in space. Lengths are in metres.

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from kinarm import Simulator

simulator = Simulator("both")
starts, goals = simulator.sample(np.random.default_rng(0), 1500)
tools = np.array([simulator.arm.tool_position(start) for start in starts])

figure, axes = plt.subplots(figsize=(6.4, 6.0), layout="constrained")
for bench in simulator.scene.obstacles:
    corner, size = bench.lower[1::-1], bench.body.size[1::-1]
    axes.add_patch(Rectangle(corner, *size, color="#c9d0d6", zorder=0))
axes.scatter(tools[:, 1], tools[:, 0], s=5, color="#0072b2", label="tool point at the start")
axes.scatter(goals[:, 1], goals[:, 0], s=5, color="#d55e00", label="goal")
axes.plot(0, 0, marker="+", color="black", markersize=12, linestyle="none", label="base")
axes.set(xlabel="y [m] (left bench at y > 0)", ylabel="x [m] (forward)", aspect="equal")
axes.invert_xaxis()
axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=3, frameon=False)
axes.spines[["top", "right"]].set_visible(False)
