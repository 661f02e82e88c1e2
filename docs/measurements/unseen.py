"""What policies for a UR5 reach in MotionBenchMaker's problems, which they have never seen.

``python -m docs.measurements.unseen FOLDER PROBLEMS`` prints a table. FOLDER is that of a study of
``obstacles-ur5``, PROBLEMS that of the unpacked ``problems.tar.bz2`` that *Own scene* names. The
arm has no gripper. The goal is the position of the tool at the wanted configuration, within the
tolerance of their own problem; configurations there are chosen as in that.
"""

import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from docs.measurements.motionbenchmaker import problems_in
from kinarm import Body, Mount, Scene, Simulator
from kinarm.chain import quaternion_of
from kinarm.evaluation import METRICS, Study
from kinarm.evaluation.report.templating import markdown_table
from kinarm.evaluation.statistics import share_over_seeds
from kinarm.policies import Policy
from kinarm.scenarios import solved_by_ways

BASE = Mount(position=(0.0, 0.0, 0.9144), rpy=(0.0, 0.0, 1.57))
"""Where the arm stands in the scenes, by the URDF that they come with."""

HEADER = ("problems", "reached %", "contact %", "behind a shield: reached %", "contact %")
"""The first column names a set and its number of problems."""


def seen_from_base(body: Body) -> Body:
    """A body of a scene in the frame of the arm's base, where policies have theirs."""
    back = BASE.rotation.T
    place, turned = back @ np.subtract(body.position, BASE.position), back @ body.rotation
    quaternion = tuple(quaternion_of(turned).tolist())
    return replace(body, position=tuple(place.tolist()), rpy=(0, 0, 0), quaternion=quaternion)


def main(folder: Path, policies: list[Policy]) -> None:
    """Run each policy once from each start, bare and behind a shield."""
    sets = defaultdict[str, list[list[tuple[bool, ...]]]](list)
    own = policies[0].problem
    for name, found, ends in problems_in(folder, own.arm):
        scene = Scene(
            obstacles=tuple(map(seen_from_base, found.scene.obstacles)),
            ground=False,
            goal_regions=own.scene.goal_regions,
        )
        bare = Simulator(own.replace(scene=scene, reachable_goals=False), threads=1)
        goal, came = bare.world.reached(ends[1:]), list[tuple[bool, ...]]()
        goal[:, 3:] = np.nan
        goal = solved_by_ways(bare.world, goal, ends[:1], bare.world.scenes_of(ends[:1], goal))[1]
        for policy in policies:
            pair = [each.rollout(policy, ends[:1], goal) for each in (bare, bare.shielded())]
            came.append(tuple(bool(x[0]) for did in pair for x in (did.success, did.collision)))
        sets[name].append(came)
    rows, reached = [], METRICS["success"]
    everything = [each for members in sets.values() for each in members]
    for name, members in {**sets, "all": everything}.items():
        shares = []
        for hits in np.array(members).transpose(2, 1, 0):
            share = share_over_seeds(hits)
            shares.append(f"{reached.write(share.value)} ({reached.write_range(*share.ci95)})")
        rows.append([f"`{name}`, {len(members)}", *shares])
    print(markdown_table(HEADER, rows))


if __name__ == "__main__":
    study = Study.load(Path(sys.argv[1]))
    runs = [run for run in study.finished if run.config.problem.name == "obstacles-ur5"]
    main(Path(sys.argv[2]), [study.policy(run) for run in runs])
