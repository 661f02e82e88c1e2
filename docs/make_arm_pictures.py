"""Make ``docs/_static/other_arms``: each arm of *Other arms* at a goal, in a motion of the oracle.

Run ``python docs/make_arm_pictures.py`` from the root of a clone.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from kinarm.policies.oracle import Oracle
from kinarm.simulator import Simulator
from kinarm.viewer import Camera, Renderer

OUT = Path(__file__).parent / "_static" / "other_arms"
PROBLEMS = ("benches-ur5", "benches-panda", "benches-xarm7", "shelf-panda", "desk-so101")
WIDTH, HEIGHT, SHRINK = 480, 360, 2
SCENARIOS = 8
NEAR = {"desk-so101": Camera(position=(0.62, -0.62, 0.42), target=(0.14, 0.0, 0.06))}
"""Where arms are looked at from closer than usual."""


def main() -> None:
    """Draw the end of the first motion that reaches its goal."""
    OUT.mkdir(exist_ok=True)
    for name in PROBLEMS:
        simulator = Simulator(name)
        starts, goals = simulator.sample(np.random.default_rng(0), SCENARIOS)
        found = Oracle(simulator.problem).solve_batch(starts, goals)
        first = int(np.flatnonzero(found.reachable)[0])
        end = found.paths[first, found.steps[first]]
        size = {"width": SHRINK * WIDTH, "height": SHRINK * HEIGHT}
        renderer = Renderer(name, camera=NEAR.get(name), **size)
        picture = Image.fromarray(renderer.render(end, goals[first])).reduce(SHRINK)
        picture.save(OUT / f"{name}.png", optimize=True)
        print(f"{name}: trial {first}, {found.steps[first]} steps")


if __name__ == "__main__":
    main()
