"""What *Contact* claims, held against Coal: ``python -m docs.measurements.contact_claims``.

All of it takes days. Counts and contradictions are kept after every lot; the next call goes on.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from kinarm import PROBLEMS, Arm, Body, GoalRegion, HeldBody, ProblemError, Simulator, arm_names
from kinarm._files import write_text
from kinarm.evaluation.report.templating import markdown_table
from kinarm.evaluation.statistics import share_over_seeds
from tests.helpers.configurations import substeps
from tests.helpers.random_scenes import random_scene
from tests.helpers.reference import SAMPLES, ReferenceSimulator
from tests.helpers.reference_episodes import assert_equal_outcome, held_actions, scripted

BOTH = PROBLEMS["both"]
PLATE, PEN = 0.005, (0.002, 0.25)
"""Thickness of the plate; radius and length of the pen [m]."""
TIME_STEP, DRAWN = 0.1, 16
"""Duration of a step [s], and starts drawn for each, of which those nearest the plate count."""
NOTHING = {"lots": 0, "cases": 0, "checked": 0}
"""What is known of an arm before its first lot."""
Lot = tuple[str, str, int, int]
"""Cases that are checked together: a part, an arm, which of its lots, and how many cases."""
Checked = tuple[int, dict[str, Any], list[dict[str, Any]]]
"""How many of them a claim is about, counts, and what contradicts it."""


@lru_cache(maxsize=16)
def reach_of(name: str) -> float:
    """About how far an arm reaches [m]."""
    arm, rng = Arm.load(name), np.random.default_rng(0)
    q = rng.uniform(arm.lower, arm.upper, (1000, arm.n_joints))
    return float(max(np.linalg.norm(arm.tool_position(each)) for each in q))


def cluttered(arm: str, rng: np.random.Generator) -> Simulator:
    """An arm among bodies of every shape, of which half move, where it can begin."""
    reach = reach_of(arm)
    goals = GoalRegion(name="around", lower=(-reach, -reach, 0), upper=(reach, reach, reach))
    task = replace(BOTH.task, goal_regions=("around",), tolerance=reach / 6)
    while True:
        drawn = random_scene(rng, moving=4, reach=reach, largest=reach / 4)
        scene = replace(drawn, goal_regions=(goals,))
        with suppress(ProblemError):
            problem = BOTH.replace(arm=arm, scene=scene, task=task, tested_configurations=4)
            simulator = Simulator(problem, threads=1)
            simulator.sample(np.random.default_rng(0), 1)
            return simulator


@lru_cache(maxsize=16)
def before_plate(name: str) -> Simulator:
    """An arm with a pen, whose whole motion is tested, before a plate."""
    reach, arm = reach_of(name), Arm.load(name)
    size, position = (PLATE, reach / 2, reach / 2), (reach / 2, 0, reach / 2)
    plate = Body(name="plate", shape="box", size=size, position=position)
    link, place = arm.tool_frame.removesuffix("_point"), (0, 0, PEN[1] / 2)
    pen = HeldBody(name="pen", shape="capsule", size=PEN, position=place, link=link)
    holding = replace(BOTH.replace(arm=name).arm, held_bodies=(pen,))
    scene = replace(BOTH.scene, obstacles=(plate,))
    stepped = {"horizon": 1, "time_step": TIME_STEP}
    return Simulator(BOTH.replace(arm=holding, scene=scene, **stepped), threads=1)


def check_configurations(arm: str, rng: np.random.Generator, size: int) -> Checked:
    """Ask Coal about what is proven of random configurations."""
    world = cluttered(arm, rng).world
    q = rng.uniform(world.arm.lower, world.arm.upper, (size, world.arm.n_joints))
    _, free, touching, proven = world.proven(q)
    coal, problem = world.contact_model.in_contact(q), world.problem.to_json()
    wrong = q[(free & coal) | (touching & ~coal)].tolist()
    cases = [{"problem": problem, "configuration": each} for each in wrong]
    counts = {"proven free": free.sum(), "proven in contact": touching.sum()}
    return proven, {**counts, "left to Coal": size - proven}, cases


def check_episodes(arm: str, rng: np.random.Generator, size: int) -> Checked:
    """Hold episodes of random actions against the reference."""
    simulator, cases = cluttered(arm, rng), []
    starts, goals = simulator.sample(rng, size)
    actions, reference = held_actions(simulator, rng, size), ReferenceSimulator(simulator)
    did = simulator.rollout_actions(actions, starts, goals, record=True)
    for i, (start, goal, table) in enumerate(zip(starts, goals, actions, strict=True)):
        episode = reference.rollout(scripted(table), start, goal)
        try:
            assert_equal_outcome(simulator, did, i, episode)
        except AssertionError as error:
            case = {"start": start.tolist(), "goal": goal.tolist(), "actions": table.tolist()}
            cases.append({"problem": simulator.problem.to_json(), **case, "error": str(error)})
    counts = {"their steps": did.steps, "succeeded": did.success, "in contact": did.collision}
    return size, {name: each.sum() for name, each in counts.items()}, cases


def check_steps(arm: str, rng: np.random.Generator, size: int) -> Checked:
    """Look at many configurations of full-speed steps that are found free."""
    simulator, cases = before_plate(arm), []
    world, plate = simulator.world, simulator.scene.obstacles[0]
    starts, goals = simulator.sample(rng, DRAWN * size)
    beyond = np.abs(world.screen(starts)[0] - plate.position) - np.divide(plate.size, 2)
    near = np.argsort(np.linalg.norm(np.maximum(beyond, 0), axis=1), kind="stable")[:size]
    actions = rng.choice([-1.0, 1.0], (size, 1, simulator.n_actions))
    did = simulator.rollout_actions(actions, starts[near], goals[near])
    refused, free = did.collision, ~did.collision
    shares = np.arange(1, SAMPLES + 1)[:, None] / SAMPLES
    for start, end in zip(did.starts[free], did.configurations[free], strict=True):
        if world.screen(start + shares * (end - start))[1].any():
            case = {"start": start.tolist(), "end": end.tolist()}
            cases.append({"problem": world.problem.to_json(), **case})
    quarters = substeps(world, did.starts[refused], did.targets[refused])[:, 3::4]
    seen = [world.screen(way)[1].any() for way in quarters]
    return free.sum(), {"refused": len(seen), "unseen by four": seen.count(False)}, cases


PARTS = {
    "configurations": (check_configurations, 20_000, 1_000_000),
    "episodes": (check_episodes, 50, 10_000),
    "steps": (check_steps, 1_000, 1_000_000),
}
"""What is checked; how many cases are a lot, and wanted of each arm."""


def check(lot: Lot) -> Checked:
    """Draw and check a lot, which always has the same cases."""
    part, arm, number, size = lot
    rng = np.random.default_rng([*f"{part} {arm}".encode(), number])
    return PARTS[part][0](arm, rng, size)


def lots_left(record: dict[str, Any], wanted: argparse.Namespace) -> list[Lot]:
    """Lots that are still to be checked; all parts and arms come forward alike."""
    left: list[tuple[float, Lot]] = []
    for part, arm in product(PARTS, wanted.arms):
        done, most, size = record[part].get(arm, NOTHING), vars(wanted)[part], PARTS[part][1]
        for number, first in enumerate(range(done["cases"], most, size), done["lots"]):
            left.append((first / most, (part, arm, number, min(size, most - first))))
    return [lot for _, lot in sorted(left)]


def add(record: dict[str, Any], lot: Lot, found: Checked) -> None:
    """Keep what a lot came to."""
    (part, arm, _, size), (checked, counts, cases) = lot, found
    done = Counter(record[part].get(arm, NOTHING))
    done.update({name: int(each) for name, each in counts.items()})
    done.update(lots=1, cases=size, checked=int(checked), contradicted=len(cases))
    record[part][arm] = dict(done)
    record["found"] += [{"lot": lot, **each} for each in cases]


def table(part: str, arms: Mapping[str, Mapping[str, int]]) -> str:
    """Counts of a part by arm, and the upper end of the interval of what is contradicted."""
    total: Counter[str] = Counter()
    for counts in arms.values():
        total.update(counts)
    rows, names = [], [name for name in total if name not in NOTHING]
    for arm, counts in {**{f"`{arm}`": arms[arm] for arm in arms}, "all": total}.items():
        hits = np.arange(counts["checked"]) < counts["contradicted"]
        most = share_over_seeds(hits[None]).ci95[1] if hits.size else 1.0
        shown = (f"{counts[name]:,}" for name in ("cases", *names))
        rows.append((arm, *shown, f"{most:.1e}"))
    return markdown_table(("arm", part, *names, "rate at most"), rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Check what is left, and write record and tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for part, (_, _, most) in PARTS.items():
        parser.add_argument(f"--{part}", type=int, default=most, help=f"of each arm ({most:,})")
    parser.add_argument("--arms", nargs="+", default=arm_names(), metavar="NAME")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--folder", type=Path, default=Path("data/results/contact"))
    given = parser.parse_args(arguments)
    file, record = given.folder / "claims.json", {**{part: {} for part in PARTS}, "found": []}
    if file.exists():
        record = json.loads(file.read_text("utf-8"))
    given.folder.mkdir(parents=True, exist_ok=True)
    lots = lots_left(record, given)
    with get_context("spawn").Pool(given.jobs) as pool:
        for done, (lot, found) in enumerate(zip(lots, pool.imap(check, lots), strict=True), 1):
            add(record, lot, found)
            write_text(file, json.dumps(record, indent=1) + "\n")
            sys.stderr.write(f"\rlot {done} of {len(lots)}, contradictions: {len(record['found'])}")
    tables = (table(part, record[part]) for part in PARTS)
    write_text(given.folder / "claims.md", "\n".join(tables))


if __name__ == "__main__":
    main()
