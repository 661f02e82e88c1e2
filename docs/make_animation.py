"""Draw ``docs/_static/reach.gif``: a shipped policy reaches one goal after the other.

Run ``python docs/make_animation.py`` from the root of a clone. Each motion starts where the last
one ended. Goals are drawn at random; those that the policy misses, or reaches late, are skipped:
the animation shows what a success looks like and not how often there is one.
"""

from pathlib import Path

import numpy as np
from drawing import Camera, arm_solids, render, scene_solids
from numpy.typing import NDArray
from PIL import Image

from kinarm import CompiledPolicy, Simulator
from kinarm.policies import load_policy

POLICY = "ars-tuned-both"
OUT = Path(__file__).parent / "_static" / "reach.gif"
CAMERA = Camera(target=(0.03, -0.04, 0.32), view=37.0, width=600, height=420)
SEED = 0
SIDES = ("right", "left", "left")
"""Benches of the goals."""
SHORTEST, LONGEST = 8, 60
"""Steps that a motion may take: enough to see, and few enough to keep the file small."""
ATTEMPTS = 200
STRIDE = 2
"""Steps of 20 ms a frame: at 25 frames a second, the arm is shown at its own speed."""
HOLD = 6
"""Frames for which the arm rests at a goal."""

Frame = tuple[NDArray[np.float64], NDArray[np.float64], bool]
"""Configuration, goal, and whether the goal is reached."""


def record_motions(simulator: Simulator, policy: CompiledPolicy) -> list[Frame]:
    """Chain successful episodes, each from where the last one ended."""
    rng = np.random.default_rng(SEED)
    for _ in range(ATTEMPTS):
        (start,), _ = simulator.sample(rng, 1)
        frames: list[Frame] = []
        for side in SIDES:
            motion = record_motion(simulator, policy, start, side, rng)
            if motion is None:
                break
            frames += motion
            start = motion[-1][0]
        else:
            return frames
    raise SystemExit(f"no chain of {len(SIDES)} motions found in {ATTEMPTS} attempts")


def record_motion(
    simulator: Simulator,
    policy: CompiledPolicy,
    start: NDArray[np.float64],
    side: str,
    rng: np.random.Generator,
) -> list[Frame] | None:
    """Reach the first of some random goals that works out, or None."""
    _, goals = simulator.sample(rng, 100)
    goals = goals[(goals[:, 1] > 0) == (side == "left")]
    rollouts = simulator.rollout(policy, np.tile(start, (len(goals), 1)), goals, record=True)
    lengths = rollouts.steps
    fitting = np.flatnonzero(rollouts.success & (lengths > SHORTEST) & (lengths <= LONGEST))
    if fitting.size == 0:
        return None
    path, goal = rollouts.paths[fitting[0], : lengths[fitting[0]] + 1], goals[fitting[0]]
    moving: list[Frame] = [(q, goal, False) for q in path[:-1:STRIDE]]
    return moving + [(path[-1], goal, True)] * HOLD


def draw(simulator: Simulator, frame: Frame) -> Image.Image:
    """One picture."""
    configuration, goal, reached = frame
    solids = arm_solids(simulator.arm, configuration)
    solids += scene_solids(simulator.scene, goal, reached)
    return Image.fromarray(render(solids, CAMERA))


def save_animation(pictures: list[Image.Image], frames: list[Frame], path: Path) -> None:
    """Write pictures as a GIF with one palette for all, so that what rests costs nothing."""
    palette = common_palette(pictures, frames)
    reduced = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    path.parent.mkdir(exist_ok=True)
    reduced[0].save(
        path, save_all=True, append_images=reduced[1:], duration=40, loop=0, optimize=True
    )


def common_palette(pictures: list[Image.Image], frames: list[Frame]) -> Image.Image:
    """Choose 255 colours from some of the pictures, and from the small cube enlarged."""
    width, height = CAMERA.width, CAMERA.height
    chosen = np.linspace(0, len(pictures) - 1, 6).astype(int)
    sample = Image.new("RGB", (2 * width, height * len(chosen)), "white")
    for row, index in enumerate(chosen):
        column, line = CAMERA.project(frames[index][1])
        cube = pictures[index].crop((column - 9, line - 8, column + 9, line + 8))
        sample.paste(pictures[index], (0, row * height))
        sample.paste(cube.resize((width // 6, height // 6)), (width, row * height))
    palette = sample.quantize(255, method=Image.Quantize.MEDIANCUT)
    palette.putpalette([*palette.getpalette()[: 255 * 3], 255, 255, 255])
    return palette


def main() -> None:
    """Record, draw and write the animation."""
    simulator = Simulator("paper", "both")
    frames = record_motions(simulator, load_policy(POLICY))
    save_animation([draw(simulator, frame) for frame in frames], frames, OUT)
    print(f"{OUT}: {len(frames)} frames, {OUT.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
