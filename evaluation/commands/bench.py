"""``kinarm-bench``: how fast everything is on this machine."""

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

from kinarm.command_line import Parser, run_command, whole_number
from kinarm.evaluation.measurements import VECTOR_ENVS, measure

PROG = "kinarm-bench"


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(prog=PROG, description="Measure how fast kinarm is on this machine.")
    parser.add_argument(
        "--repetitions", type=whole_number(1), default=7, metavar="N", help="per figure (7)"
    )
    parser.add_argument(
        "--policy",
        default="ars-tuned-right",
        metavar="NAME_OR_FILE",
        help="trained policy to run (ars-tuned-right)",
    )
    parser.add_argument(
        "--ppo", action="store_true", help="time a training with PPO as well (a minute or two)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON on standard output")
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _bench(build_parser().parse_args(arguments)))


def _bench(options: argparse.Namespace) -> None:
    """From options to figures."""
    document = measure(options.policy, options.repetitions, ppo=options.ppo)
    if options.json:
        json.dump(document, sys.stdout)
        sys.stdout.write("\n")
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
    console.print(_table(document))


def _table(document: dict[str, Any]) -> Any:
    """The figures as a table."""
    from rich.table import Table

    table = Table(title=f"kinarm-bench, policy {document['policy']}", title_justify="left")
    table.add_column("what")
    table.add_column("median", justify="right")
    table.add_column("best", justify="right")
    table.add_column("judged by Coal", justify="right")
    for row in document["rollouts"]:
        plural = "s" if row["threads"] > 1 else ""
        table.add_row(
            f"rollouts, {row['batch']} {row['actions']} episodes, {row['threads']} thread{plural}",
            *_rates(row["steps_per_second"]),
            f"{100 * row['judged_share']:.3f} %",
        )
    table.add_section()
    table.add_row(f"batch environment, {VECTOR_ENVS} arms", *_rates(document["vector_environment"]))
    table.add_row("single environment", *_rates(document["single_environment"]))
    table.add_row("reference path (Pinocchio + Coal)", *_rates(document["reference"]))
    table.add_row(
        "speed-up over the reference (512 trained)", f"{document['speed_up_over_reference']:.0f} x"
    )
    training = document["table_1_training"]
    table.add_section()
    table.add_row(
        f"training of Table 1 ({training['environment_steps'] / 1e6:.1f} million steps)",
        *(f"{training['seconds'][name]:.2f} s" for name in ("median", "best")),
    )
    if "ppo_training" in document:
        for row in _ppo_rows(document["ppo_training"]):
            table.add_row(*row)
    table.add_row(
        f"oracle, {document['oracle']['trials']} trials of a task",
        *(
            f"{document['oracle']['trials'] / document['oracle']['trials_per_second'][name]:.1f} s"
            for name in ("median", "best")
        ),
    )
    evaluation = document["evaluation"]
    memory = f"{evaluation['peak_memory_mb']:.0f} MB"
    table.add_row(
        "kinarm-eval --trials 200, bounds unknown",
        f"{evaluation['seconds_without_bounds']:.1f} s",
        memory,
    )
    table.add_row(
        "kinarm-eval --trials 200, bounds known", f"{evaluation['seconds']:.1f} s", memory
    )
    return table


def _ppo_rows(training: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the training with PPO, which is timed once."""
    if "skipped" in training:
        return [("training with PPO", "skipped"), (training["skipped"],)]
    steps = training["environment_steps"] / 1e6
    return [
        (f"training with PPO ({steps:.1f} million steps)", f"{training['seconds']:.1f} s"),
        ("share of it in the simulator", f"{training['simulator_share']:.1%}"),
    ]


def _rates(timing: dict[str, float]) -> list[str]:
    return [f"{timing[name]:,.0f} steps/s" for name in ("median", "best")]


if __name__ == "__main__":
    main()
