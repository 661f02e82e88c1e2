"""An evaluation as a whole: JSON document and table."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.evaluations import Evaluation, pool
from kinarm.evaluation.statistics import BOOTSTRAP_SEED, RESAMPLES
from kinarm.policies.provenance import package_versions, source_commit

if TYPE_CHECKING:
    from rich.console import Console
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
        ``protocol`` (trials per task with their hash and bounds, arm, versions, commit, command),
        ``results`` (one per policy and task, with the outcome of every trial) and ``pooled``
        (one per recipe and task with several training seeds).
    """
    trial_sets = {e.task: e.trials for e in evaluations}
    bounds = {e.task: bounds_document(e.bounds) for e in evaluations if e.bounds is not None}
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
                    "oracle": bounds.get(task),
                }
                for task, trials in trial_sets.items()
            },
            "versions": package_versions(),
            "commit": source_commit(),
        },
        "results": [evaluation.to_json() for evaluation in evaluations],
        "pooled": [pooled.to_json() for pooled in pool(evaluations)],
    }


def print_table(document: dict[str, Any], console: "Console", *, markdown: bool = False) -> None:
    """Print the figures of a document, without the less important columns if space is scarce.

    Parameters
    ----------
    document : dict
        What `evaluation_document` returned.
    console : rich.console.Console
        Where to print.
    markdown : bool
        Whether to print Markdown, always with all columns.
    """
    if markdown:
        from rich.console import Console

        text = io.StringIO()
        Console(file=text, width=1000).print(evaluation_table(document, markdown=True))
        console.out(text.getvalue().strip(), highlight=False)
        return
    unbounded = console.options.update(width=1000)
    for dropped in range(len(EXPENDABLE) + 1):
        table = evaluation_table(document, without=EXPENDABLE[:dropped])
        if console.measure(table, options=unbounded).maximum <= console.width:
            break
    console.print(table)
    if dropped:
        left_out = ", ".join(EXPENDABLE[:dropped])
        console.print(f"left out for want of width: {left_out}; --markdown prints all", style="dim")


def evaluation_table(
    document: dict[str, Any], *, without: Sequence[str] = (), markdown: bool = False
) -> "Table":
    """The figures of a document as a table; several training seeds share a row.

    Parameters
    ----------
    document : dict
        What `evaluation_document` returned.
    without : sequence of str
        Columns to leave out.
    markdown : bool
        Whether the table is to be printed as Markdown.
    """
    from rich import box
    from rich.table import Table

    table = Table(box=box.MARKDOWN if markdown else box.HEAVY_HEAD, header_style="bold")
    kept = [heading for heading in COLUMNS if heading not in without]
    for heading in kept:
        side: Literal["left", "right"] = "left" if heading in ("task", "policy") else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    for task in document["protocol"]["tasks"]:
        if not markdown:
            table.add_section()
        for row in table_rows(document, task):
            cells = table_cells(row)
            table.add_row(*(cells[heading] for heading in kept))
    return table


COLUMNS = (
    "task",
    "policy",
    "success %",
    "of oracle %",
    "seeds: range %",
    "<= 0.1 m",
    "<= 0.2 m",
    "median m",
    "mean m",
    "p95 m",
    "contact %",
    "steps",
    "step ratio",
)


EXPENDABLE = (
    "<= 0.1 m",
    "mean m",
    "p95 m",
    "steps",
    "seeds: range %",
    "<= 0.2 m",
    "contact %",
    "of oracle %",
    "step ratio",
)


def table_rows(document: dict[str, Any], task: str) -> list[dict[str, Any]]:
    """Pooled results of a task and the results that are not part of them, best first.

    Parameters
    ----------
    document : dict
        What `evaluation_document` returned.
    task : str
        Name of one of its tasks.
    """
    pooled = [row for row in document["pooled"] if row["task"] == task]
    members = {name for row in pooled for name in row["members"]}
    single = [row for row in document["results"] if row["task"] == task]
    rows = pooled + [row for row in single if row["policy"] not in members]
    return sorted(rows, key=lambda row: -row["success"]["rate"])


def table_cells(row: dict[str, Any]) -> dict[str, str]:
    """The figures of a row as text, by heading.

    Parameters
    ----------
    row : dict
        One of `table_rows`.
    """
    distance, spread = row["final_distance"], row.get("spread")
    over_seeds = ""
    if spread:
        low, high = (100 * spread["success"][end] for end in ("min", "max"))
        over_seeds = f"{len(row['members'])}: {low:.1f}..{high:.1f}"
    figures = (
        row["task"],
        row["policy"],
        _percent(row["success"]),
        _relative(row["oracle"]),
        over_seeds,
        f"{100 * row['within']['0.1']['rate']:.1f}",
        f"{100 * row['within']['0.2']['rate']:.1f}",
        _metres(distance["median"], distance["ci95"]["median"]),
        f"{distance['mean']:.3f}",
        f"{distance['p95']:.3f}",
        f"{100 * row['collision']['rate']:.1f}",
        f"{row['steps']['median']:.0f}",
        _ratio(row["oracle"]),
    )
    return dict(zip(COLUMNS, figures, strict=True))


def _relative(beside: dict[str, Any] | None) -> str:
    """Success in per cent of the oracle's."""
    share = beside["relative_success"] if beside else None
    return "" if share is None else f"{100 * share:.1f}"


def _ratio(beside: dict[str, Any] | None) -> str:
    """Median and 95th percentile of the step ratio."""
    if not beside or beside["step_ratio"]["median"] is None:
        return ""
    return "{median:.2f} (p95 {p95:.2f})".format(**beside["step_ratio"])


def _metres(value: float, interval: list[float] | None) -> str:
    return f"{value:.3f}" + (" ({:.3f}..{:.3f})".format(*interval) if interval else "")


def _percent(share: dict[str, Any]) -> str:
    low, high = share["ci95"]
    return f"{100 * share['rate']:.1f} ({100 * low:.1f}..{100 * high:.1f})"
