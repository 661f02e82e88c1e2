"""Make ``docs/_static/scenes.png``: the scenes that ship, with the arms of the problems.

Run ``python docs/make_scene_pictures.py`` from the root of a clone, with the extra ``robots``.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kinarm import ReachProblem
from kinarm.viewer import Renderer

OUT = Path(__file__).parent / "_static" / "scenes.png"
WIDTH, HEIGHT, COLUMNS = 480, 340, 3
SCENES = {
    "benches": "benches-ur5",
    "table": "table-paper",
    "shelf": "shelf-panda",
    "ring": "ring-ur5",
    "post": "post-paper",
    "desk": "desk-so101",
}


def photograph(scene: str, name: str) -> Image.Image:
    """An arm at home in a scene, named."""
    problem = ReachProblem.load(name)
    region = problem.scene.goal_region(problem.task.goal_regions[0])
    goal = (np.array(region.lower) + region.upper) / 2
    size = {"width": 2 * WIDTH, "height": 2 * HEIGHT}
    taken = Renderer(problem, **size).render(problem.load_arm().home, goal)
    picture = Image.fromarray(taken).reduce(2)
    font = ImageFont.load_default(15)
    ImageDraw.Draw(picture).text((12, 10), f"{scene} ({problem.arm.name})", "#333333", font)
    return picture


def main() -> None:
    """Put the pictures side by side."""
    rows = -(-len(SCENES) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * WIDTH, rows * HEIGHT))
    for index, (scene, name) in enumerate(SCENES.items()):
        place = (index % COLUMNS * WIDTH, index // COLUMNS * HEIGHT)
        whole.paste(photograph(scene, name), place)
    whole.quantize(256).save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
