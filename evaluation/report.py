"""An evaluation as a whole: JSON document and table."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from kinarm.evaluation.evaluate import Evaluation, pool
from kinarm.evaluation.statistics import BOOTSTRAP_SEED, RESAMPLES
from kinarm.policies.provenance import package_versions, source_commit

if TYPE_CHECKING:
    from rich.table import Table

FORMAT_VERSION = 1


def evaluation_document(evaluations: Sequence[Evaluation], command: str) -> dict[str, Any]:
    """Everything about an evaluation, as a dictionary that JSON can hold.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Made with one trial set per task.
    command : str
        The command that made them.

    Returns
    -------
    dict
        ``protocol`` (trials per task with their hash, arm, versions, commit, command),
        ``results`` (one per policy and task, with the outcome of every trial) and ``pooled``
        (one per recipe and task with several training seeds).
    """
    trial_sets = {evaluation.task: evaluation.trials for evaluation in evaluations}
    any_set = evaluations[0].trials
    arm = any_set.simulator.arm
    return {
        "protocol": {
            "format_version": FORMAT_VERSION,
            "command": command,
            "trials": len(any_set),
            "seed": any_set.seed,
            "arm": arm.name,
            "arm_digest": arm.digest,
            "intervals": {
                "level": 0.95,
                "shares": "Wilson",
                "distances": "percentile bootstrap over trials",
                "resamples": RESAMPLES,
                "bootstrap_seed": BOOTSTRAP_SEED,
            },
            "tasks": {
                task: {
                    "trial_set_hash": trials.digest,
                    "tolerance": trials.simulator.task.tolerance,
                    "horizon": trials.simulator.task.horizon,
                    "starts": trials.starts.tolist(),
                    "goals": trials.goals.tolist(),
                }
                for task, trials in trial_sets.items()
            },
            "versions": package_versions(),
            "commit": source_commit(),
        },
        "results": [evaluation.to_json() for evaluation in evaluations],
        "pooled": [pooled.to_json() for pooled in pool(evaluations)],
    }


def evaluation_table(document: dict[str, Any]) -> "Table":
    """The figures of a document as a table; several training seeds share a row."""
    from rich.table import Table

    protocol = document["protocol"]
    table = Table(
        title=f"{protocol['trials']} trials a task, seed {protocol['seed']}, "
        f"arm {protocol['arm']}; 95 % intervals in brackets",
        title_justify="left",
        header_style="bold",
    )
    table.add_column("policy", no_wrap=True)
    for heading in ("success %", "over seeds", "<= 0.1 m", "<= 0.2 m", "median m"):
        table.add_column(heading, justify="right", no_wrap=True)
    for heading in ("mean m", "p95 m", "collision %", "steps"):
        table.add_column(heading, justify="right", no_wrap=True)
    pooled = {(row["policy"], row["task"]): row for row in document["pooled"]}
    members = {
        (result["algorithm"], result["recipe"], result["trained_on"], result["task"])
        for result in pooled.values()
    }
    for task in protocol["tasks"]:
        rows = [row for row in pooled.values() if row["task"] == task]
        rows += [
            row
            for row in document["results"]
            if row["task"] == task
            and (row["algorithm"], row["recipe"], row["trained_on"], task) not in members
        ]
        table.add_section()
        table.add_row(f"[bold]task {task}[/bold]")
        for row in sorted(rows, key=lambda row: -row["success"]["rate"]):
            table.add_row(*_cells(row))
    return table


def _cells(row: dict[str, Any]) -> list[str]:
    distance, spread = row["final_distance"], row.get("spread")
    name = row["policy"] + (f" x{len(row['training_seeds'])}" if spread else "")
    return [
        f"  {name}",
        _percent(row["success"]),
        "{:.1f}..{:.1f}".format(*(100 * spread["success"][end] for end in ("min", "max")))
        if spread
        else "",
        f"{100 * row['within']['0.1']['rate']:.1f}",
        f"{100 * row['within']['0.2']['rate']:.1f}",
        "{:.3f} [{:.3f}, {:.3f}]".format(distance["median"], *distance["ci95"]["median"]),
        f"{distance['mean']:.3f}",
        f"{distance['p95']:.3f}",
        f"{100 * row['collision']['rate']:.1f}",
        f"{row['steps']['median']:.0f}",
    ]


def _percent(share: dict[str, Any]) -> str:
    low, high = share["ci95"]
    return f"{100 * share['rate']:.1f} [{100 * low:.1f}, {100 * high:.1f}]"
