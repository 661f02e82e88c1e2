"""``kinarm-bench``: how fast everything is on this machine."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from kinarm._command_line import Parser, add_options, request_of, run_command
from kinarm._validation import whole_number

PROG = "kinarm-bench"


@dataclass(frozen=True, kw_only=True)
class BenchmarkRequest:
    """Measure how fast kinarm is on this machine.

    Parameters
    ----------
    repetitions : int
        How often each figure is measured.
    policy : str
        Trained policy to run, on the problem that it is for.
    ppo : bool
        Time a training with PPO as well, a minute or two.
    json : bool
        Print JSON on standard output.

    Raises
    ------
    InvalidInputError
        If there are no repetitions.
    """

    repetitions: int = 7
    policy: str = field(default="ars-tuned-right", metadata={"metavar": "NAME_OR_FILE"})
    ppo: bool = False
    json: bool = False

    def __post_init__(self) -> None:
        whole_number("repetitions", self.repetitions, 1)

    def run(self) -> dict[str, Any]:
        """Measure everything.

        Returns
        -------
        dict
            Figures that JSON can hold: rates [steps/s], shares, and times [s].

        Raises
        ------
        KinarmError
            If the policy cannot be used.
        """
        from kinarm.evaluation.measurements import measure

        return measure(self.policy, self.repetitions, ppo=self.ppo)


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(prog=PROG, description="Measure how fast kinarm is on this machine.")
    add_options(parser, BenchmarkRequest)
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _bench(build_parser().parse_args(arguments)))


def _bench(options: argparse.Namespace) -> None:
    """Run a request, and print its figures."""
    request = request_of(options, BenchmarkRequest)
    document = request.run()
    if request.json:
        json.dump(document, sys.stdout)
        sys.stdout.write("\n")
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
    console.print(_table(document))


def _table(document: dict[str, Any]) -> Any:
    """The figures as a table."""
    from rich.table import Table

    from kinarm.evaluation.measurements import VECTOR_ENVS

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
        *(f"{training['seconds'][name]:.2f} s" for name in RATES),
    )
    for row in _ppo_rows(document.get("ppo_training")):
        table.add_row(*row)
    oracle = document["oracle"]
    table.add_row(
        f"oracle, {oracle['trials']} trials",
        *(f"{oracle['trials'] / oracle['trials_per_second'][name]:.1f} s" for name in RATES),
    )
    evaluation = document["evaluation"]
    for known, name in (("unknown", "seconds_without_bounds"), ("known", "seconds")):
        table.add_row(
            f"kinarm-eval --trials 200, bounds {known}",
            f"{evaluation[name]:.1f} s",
            f"{evaluation['peak_memory_mb']:.0f} MB",
        )
    return table


def _ppo_rows(training: dict[str, Any] | None) -> list[tuple[str, ...]]:
    """Rows of the training with PPO, which is timed once if at all."""
    if training is None:
        return []
    if "skipped" in training:
        return [("training with PPO", "skipped"), (training["skipped"],)]
    steps = training["environment_steps"] / 1e6
    return [
        (f"training with PPO ({steps:.1f} million steps)", f"{training['seconds']:.1f} s"),
        ("share of it in the simulator", f"{training['simulator_share']:.1%}"),
    ]


RATES = ("median", "best")


def _rates(timing: dict[str, float]) -> list[str]:
    return [f"{timing[name]:,.0f} steps/s" for name in RATES]


if __name__ == "__main__":
    main()
