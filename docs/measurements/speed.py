"""All that *How fast* shows: ``python -m docs.measurements.speed data/results/speed``.

It runs ``kinarm-bench --ppo``, `docs.measurements.limits` and `docs.measurements.peers` one after
the other, and arms with meshes. It writes ``speed.json``, what ``kinarm-bench`` measured, and
``SPEED.md``, all tables. It needs the extras peers and robots, and vamp for VAMP.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from docs.measurements import limits, peers
from kinarm import PROBLEMS, Simulator
from kinarm._files import write_text
from kinarm.evaluation.bench import measure, timed
from kinarm.evaluation.report.templating import markdown_table, template
from kinarm.policies import load_policy

POLICY, REPETITIONS = "ars-tuned-both", 3

ROBOTS, EPISODES, CONFIGURATIONS = ("ur5", "panda"), 512, 16_000


def robots() -> Iterator[tuple[str, ...]]:
    """Rates of shipped arms with meshes between the paper's benches, on one thread [1/s]."""
    for arm in ROBOTS:
        simulator = Simulator(PROBLEMS["both"].replace(arm=arm), threads=1)
        rng = np.random.default_rng(0)
        scenarios = simulator.sample(rng, EPISODES)
        shape = EPISODES, simulator.task.horizon, simulator.n_actions
        actions = rng.uniform(-1, 1, shape)
        configurations = rng.uniform(
            simulator.arm.lower, simulator.arm.upper, (CONFIGURATIONS, simulator.arm.n_joints)
        )

        def rollouts(simulator=simulator, actions=actions, scenarios=scenarios) -> int:
            return int(simulator.rollout_actions(actions, *scenarios).steps.sum())

        def contact(simulator=simulator, configurations=configurations) -> int:
            return len(simulator.world.in_contact(configurations))

        for what, run in (
            (f"steps of {EPISODES} random episodes", rollouts),
            (f"contact of {CONFIGURATIONS:,} random configurations", contact),
        ):
            rate = timed(run, REPETITIONS)
            yield f"`{arm}`", what, f"{rate['median']:,.0f}/s", f"{rate['best']:,.0f}/s"


def main() -> None:
    """Measure, and keep the record."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    # First, while the process is as others are.
    meshes = markdown_table(("arm", "what", "median", "best"), robots())
    command = f"python -m docs.measurements.speed {folder}"
    document = {"command": command, **measure(POLICY, REPETITIONS, ppo=True)}
    write_text(folder / "speed.json", json.dumps(document, indent=1) + "\n")
    ours = template("speed.md").render(document)
    title, made, table = ours.split("\n\n", 2)
    parts = [title, "", made, "", "## Peers\n", *peers.page(load_policy(POLICY), REPETITIONS)]
    parts += ["", "## Arms with meshes\n", meshes]
    parts += [*limits.page(POLICY, REPETITIONS), "## Everything\n", table]
    write_text(folder / "SPEED.md", "\n".join(parts))
    sys.stdout.write("\n".join(parts))


if __name__ == "__main__":
    main()
