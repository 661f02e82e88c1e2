"""Make ``docs/_static/reach.gif``: a shipped policy reaches one goal after the other.

Run ``python docs/make_animation.py`` from the root of a clone. Each motion starts where the last
one ended. Goals are drawn at random; those that the policy misses, or reaches late, are skipped:
the animation shows what a success looks like and not how often there is one.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kinarm import CompiledPolicy, Recording, Simulator
from kinarm.policies import load_policy
from kinarm.recording import record_rollouts
from kinarm.viewer import Camera, Renderer

POLICY = "ppo-best-both"
OUT = Path(__file__).parent / "_static" / "reach.gif"
WIDTH, HEIGHT, SCALE = 600, 420, 2
"""Size of the animation, and how much larger pictures are taken, for smoother edges."""
CAMERA = Camera(position=(-2.35, -1.5, 1.65), target=(0.04, -0.03, 0.3))
SEED = 2
SIDES = ("left", "right", "right", "left")
"""Benches of the goals."""
SHORTEST, LONGEST = 12, 40
"""Steps that a motion may take: enough to see, and few enough to keep the file small."""
ATTEMPTS = 200
FRAME = 40
"""Duration of a frame [ms]: with a step of 20 ms each, the arm is shown at half its own speed."""
HOLD = 14
"""Frames for which the arm rests at a goal."""


def record_motions(simulator: Simulator, policy: CompiledPolicy) -> list[Recording]:
    """Chain successful episodes, each from where the last one ended."""
    rng = np.random.default_rng(SEED)
    for _ in range(ATTEMPTS):
        (start,), _ = simulator.sample(rng, 1)
        motions: list[Recording] = []
        for side in SIDES:
            motion = record_motion(simulator, policy, start, side, rng)
            if motion is None:
                break
            motions.append(motion)
            start = motion.states[-1]
        else:
            return motions
    raise SystemExit(f"no chain of {len(SIDES)} motions found in {ATTEMPTS} attempts")


def record_motion(
    simulator: Simulator,
    policy: CompiledPolicy,
    start: NDArray[np.float64],
    side: str,
    rng: np.random.Generator,
) -> Recording | None:
    """Reach the first of some random goals that works out, or None."""
    _, goals = simulator.sample(rng, 100)
    goals = goals[(goals[:, 1] > 0) == (side == "left")]
    rollouts = simulator.rollout(policy, np.tile(start, (len(goals), 1)), goals, record=True)
    in_time = (rollouts.steps > SHORTEST) & (rollouts.steps <= LONGEST)
    fitting = np.flatnonzero(rollouts.success & in_time)[:1]
    return next(iter(record_rollouts(simulator, rollouts, POLICY, fitting)), None)


def photograph(motions: list[Recording]) -> list[Image.Image]:
    """Pictures of motions, one after the other."""
    problem = motions[0].problem
    size = {"width": SCALE * WIDTH, "height": SCALE * HEIGHT}
    renderer, arm = Renderer(problem, camera=CAMERA, **size), problem.load_arm()
    pictures = []
    for motion in motions:
        way = [arm.tool_position(state) for state in motion.states]
        for step, state in enumerate(motion.states):
            outcome = motion.outcome if step == motion.steps else None
            taken = renderer.render(state, motion.goal, trace=way[: step + 1], outcome=outcome)
            pictures.append(Image.fromarray(taken).reduce(SCALE))
        pictures += [pictures[-1]] * (HOLD - 1)
    return pictures


def save_animation(pictures: list[Image.Image], path: Path) -> None:
    """Write pictures as a GIF with one palette for all, so that what rests costs nothing."""
    palette = common_palette(pictures[:: len(pictures) // 6])
    first, *others = (
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    )
    first.save(path, save_all=True, append_images=others, duration=FRAME, loop=0, optimize=True)


def common_palette(pictures: list[Image.Image]) -> Image.Image:
    """Choose 255 colours: half by how often they are seen, half by how many there are."""
    pixels = np.concatenate([np.asarray(picture).reshape(-1, 3) for picture in pictures])
    kinds = np.unique(pixels // 8 * 8 + 4, axis=0)
    rare = np.tile(kinds, (len(pixels) // len(kinds), 1))
    sample = np.concatenate([pixels, rare])[None]
    return Image.fromarray(sample).quantize(255, method=Image.Quantize.MEDIANCUT)


def main() -> None:
    """Record, photograph and write the animation."""
    motions = record_motions(Simulator("both"), load_policy(POLICY))
    pictures = photograph(motions)
    save_animation(pictures, OUT)
    print(f"{OUT}: {len(pictures)} frames, {OUT.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
