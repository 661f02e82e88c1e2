"""What one recipe learns: ``python -m docs.measurements.skills FOLDER`` judges its trainings.

FOLDER is that of ``kinarm-study policies --out FOLDER``. Its policies face trials that nothing else
draws, bare and behind a shield; ``data/results/skills/skills.json`` keeps what they reach, beside
the rows of other problems, and `docs.tables` makes a table of it.
"""

import argparse
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.leaderboard import rows_of
from kinarm import ReachProblem, Simulator
from kinarm._files import write_text
from kinarm.evaluation import EvaluationRequest, Experiment, Study
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import Policy

RECORD = Path(__file__).parents[2] / "data" / "results" / "skills" / "skills.json"

JUDGED = ("ppo-best-disturbed", "ppo-best-arms", "ppo-best-poses", "ppo-best-unseen")
"""Entries of the experiment beyond the paper's world."""

TRIALS, SEED = 10_000, 3602
"""Trials of each problem: nothing else draws from this seed."""

TIMED = 1000
"""Trials of which the speed at the goal is taken."""


def judged(policies: Mapping[str, Policy]) -> list[dict[str, Any]]:
    """Rows of policies of one problem by file name: bare, and behind a shield."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in policies]
        for path, policy in zip(paths, policies.values(), strict=True):
            policy.save(path)
        request = EvaluationRequest(
            policies=tuple(map(str, paths)), trials=TRIALS, seed=SEED, shield=True
        )
        faced = request.evaluate()
    (oracle,) = (each for each in faced if each.contestant is ORACLE)
    rows = rows_of([each for each in faced if each is not oracle])
    shared = {
        "oracle": float(oracle.rollouts.success.mean()),
        "control": control_alone(oracle.problem),
        "speed": speed_at_goal([*policies.values()]),
    }
    for row in rows:
        del row["failures"]
        row |= shared
    return rows


def control_alone(problem: ReachProblem) -> float:
    """Share that resolved-rate control reaches behind a shield: what networks add to."""
    shown = (*problem.observation.names(problem.task.goal.kind), "resolved_rate")
    simulator = Simulator(problem.replace(observation=[*dict.fromkeys(shown)])).shielded()
    trials, layout = TrialSet.draw(simulator, TRIALS, SEED), simulator.world.layout

    def act(observations: NDArray[np.float64]) -> NDArray[np.float64]:
        actions = observations[:, layout.places["resolved_rate"]].copy()
        layout.turn_away(observations, actions)
        return actions

    return float(simulator.rollout(act, trials.starts, trials.goals).success.mean())


def speed_at_goal(policies: list[Policy]) -> float:
    """Median speed of the tool behind a shield in the last step of trials that succeed [m/s]."""
    simulator = Simulator(policies[0].problem, threads=1).shielded()
    trials, lengths = TrialSet.draw(simulator, TIMED, SEED), []
    for policy in policies:
        rollouts = simulator.rollout(policy, trials.starts, trials.goals, record=True)
        hits = np.flatnonzero(rollouts.success)
        last = [rollouts.paths[hits, rollouts.steps[hits] - back] for back in (0, 1)]
        end, before = (simulator.world.poses(each)[:, :3, 3] for each in last)
        lengths.append(np.linalg.norm(end - before, axis=1))
    seconds = simulator.problem.stepping.time_step
    return round(float(np.median(np.concatenate(lengths))) / seconds, 3)


def main() -> None:
    """Judge the finished trainings."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the study")
    study = Study.load(parser.parse_args().folder)
    entries = {entry.name: entry.problems for entry in Experiment.load("policies").entries}
    order = [name for key in JUDGED for name in entries[key]]
    rows = list[dict[str, Any]]()
    if RECORD.exists():
        rows = json.loads(RECORD.read_text(encoding="utf-8"))["rows"]
    for group in study.groups():
        name = group.config.problem.name
        if group.entry.name not in JUDGED:
            continue
        runs = [run for run in study.finished if run.config.problem.name == name]
        policies = {f"ppo-best-{name}-seed{run.config.seed}.npz": study.policy(run) for run in runs}
        found = judged(policies)
        spent = [each.clock.processor_seconds or np.nan for each in group.runs]
        for row in found:
            row["minutes"] = round(float(np.median(spent)) / 60, 2)
        rows = [*(row for row in rows if row["problem"] != name), *found]
        rows.sort(key=lambda row: order.index(row["problem"]))
        record = {"trials": TRIALS, "seed": SEED, "rows": rows}
        RECORD.parent.mkdir(parents=True, exist_ok=True)
        write_text(RECORD, json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
