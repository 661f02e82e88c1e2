"""``kinarm-bench``: how fast everything is on this machine."""

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from kinarm._command_line import run_request
from kinarm._validation import whole_number


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
            Figures that JSON can hold: rates [1/s], shares, and times [s].

        Raises
        ------
        KinarmError
            If the policy cannot be used.
        """
        from kinarm.evaluation.measurements import measure

        return measure(self.policy, self.repetitions, ppo=self.ppo)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-bench", BenchmarkRequest, _report, arguments)


def _report(request: BenchmarkRequest, _: str) -> None:
    """Run a request, and print its figures."""
    from rich.console import Console
    from rich.table import Table

    document = request.run()
    if request.json:
        print(json.dumps(document))
        return
    table = Table(title=f"kinarm-bench, policy {document['policy']}", title_justify="left")
    table.add_column("what")
    for heading in ("median", "best", "judged by Coal"):
        table.add_column(heading, justify="right")
    for row in _rows(document):
        table.add_row(*row) if row else table.add_section()
    Console(width=None if sys.stdout.isatty() else 110, highlight=False).print(table)


def _rows(document: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Rows of the table; an empty one ends a section."""
    from kinarm.evaluation.measurements import VECTOR_ENVS

    for row in document["rollouts"]:
        plural = "s" if row["threads"] > 1 else ""
        what = f"{row['batch']} {row['actions']} episodes, {row['threads']} thread{plural}"
        judged = f"{100 * row['judged_share']:.3f} %"
        yield f"rollouts, {what}", *_rates(row["steps_per_second"]), judged
    yield ()
    yield f"batch environment, {VECTOR_ENVS} arms", *_rates(document["vector_environment"])
    yield "single environment", *_rates(document["single_environment"])
    yield from _sb3_rows(document["stable_baselines3"])
    yield "reference path (Pinocchio + Coal)", *_rates(document["reference"])
    pictures = (f"{document['pictures'][name]:,.0f} pictures/s" for name in RATES)
    yield "pictures, 480 x 360, one thread", *pictures
    speed_up = f"{document['speed_up_over_reference']:.0f} x"
    yield "speed-up over the reference (512 trained)", speed_up
    yield ()
    training, oracle = document["table_1_training"], document["oracle"]
    steps = f"{training['environment_steps'] / 1e6:.1f} million steps"
    seconds = (f"{training['seconds'][name]:.2f} s" for name in RATES)
    yield f"training of Table 1 ({steps})", *seconds
    yield from _ppo_rows(document.get("ppo_training"))
    seconds = (f"{oracle['trials'] / oracle['trials_per_second'][name]:.1f} s" for name in RATES)
    yield f"oracle, {oracle['trials']} trials", *seconds
    evaluation = document["evaluation"]
    memory = f"{evaluation['peak_memory_mb']:.0f} MB"
    for known, name in (("unknown", "seconds_without_bounds"), ("known", "seconds")):
        what = f"kinarm-eval --trials 200, bounds {known}"
        yield what, f"{evaluation[name]:.1f} s", memory


def _sb3_rows(rates: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the environments for Stable-Baselines3."""
    from kinarm.evaluation.measurements import VECTOR_ENVS

    if "skipped" in rates:
        return [("for Stable-Baselines3", "skipped"), (rates["skipped"],)]
    return [
        (f"for Stable-Baselines3, {VECTOR_ENVS} arms", *_rates(rates["native"])),
        (f"its DummyVecEnv, {VECTOR_ENVS} single environments", *_rates(rates["dummy"])),
        ("speed-up over its DummyVecEnv", f"{rates['speed_up']:.0f} x"),
    ]


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
