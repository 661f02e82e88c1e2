"""``kinarm-bench``: how fast everything is on this machine."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._fields import Checked
from kinarm._files import check_folder, only_writer, write_text
from kinarm.evaluation.report.templating import markdown_table, template_environment


@dataclass(frozen=True, kw_only=True)
class BenchmarkRequest(Checked):
    """Measure how fast kinarm is on this machine.

    Parameters
    ----------
    repetitions : int
        How often each figure is measured.
    policy : str
        Trained policy to run, on the problem that it is for.
    ppo : bool
        Time a training with PPO as well, a minute or two.
    out : Path
        Output folder, for a document and a page.
    json : bool
        Print JSON on standard output.
    """

    repetitions: int = 7
    policy: str = field(default="ars-tuned-both", metadata={"metavar": "NAME_OR_FILE"})
    ppo: bool = False
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    json: bool = False

    GROUPS: ClassVar = {
        "what is measured": ("repetitions", "policy", "ppo"),
        "output": ("out", "json"),
    }
    DEFAULTS: ClassVar = {"out": "a table on standard output alone"}

    def run(self, command: str | None = None) -> dict[str, Any]:
        """Measure everything, and write ``speed.json`` and ``SPEED.md`` if there is a folder.

        ``command`` is recorded as what made the files; else it is this request.
        """
        from kinarm.evaluation.bench import measure

        if self.out is None:
            return measure(self.policy, self.repetitions, ppo=self.ppo)
        check_folder(self.out)
        with only_writer(self.out):
            measured = measure(self.policy, self.repetitions, ppo=self.ppo)
            document = {"command": command or repr(self), **measured}
            write_text(self.out / "speed.json", json.dumps(document, indent=1) + "\n")
            write_text(self.out / "SPEED.md", speed_page(document))
        return document


def _report(request: BenchmarkRequest, command: str) -> None:
    """Run a request, and print its figures."""
    from rich.table import Table

    document = request.run(command)
    if request.json:
        print(json.dumps(document))
        return
    table = Table(title=f"kinarm-bench, policy {document['policy']}", title_justify="left")
    for heading in HEADER:
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for row in rows(document):
        table.add_row(*row) if row else table.add_section()
    open_console().print(table)


HEADER = ("what", "median", "best", "judged by Coal")

Row = tuple[str, ...]


def speed_page(document: dict[str, Any]) -> str:
    """``SPEED.md``: everything that was measured, in one table."""
    table = ((*row, *[""] * (len(HEADER) - len(row))) for row in rows(document) if row)
    template = template_environment().get_template("speed.md")
    return template.render(document, table=markdown_table(HEADER, table))


def rows(document: dict[str, Any]) -> Iterator[Row]:
    """Measurements, as rows of text; an empty row ends a section."""
    for row in document["rollouts"]:
        plural = "s" if row["threads"] > 1 else ""
        what = f"{row['batch']} {row['actions']} episodes, {row['threads']} thread{plural}"
        judged = f"{100 * row['judged_share']:.3f} %"
        yield f"rollouts, {what}", *_rates(row["steps_per_second"]), judged
    yield ()
    yield "batch environment, 64 arms", *_rates(document["vector_environment"])
    yield "single environment", *_rates(document["single_environment"])
    yield "reference path (Pinocchio + Coal)", *_rates(document["reference"])
    speed_up = f"{document['speed_up_over_reference']:.0f} x"
    yield "speed-up over the reference (512 trained)", speed_up
    yield ()
    ars, oracle = document["table_1_training"], document["oracle"]
    seconds = (f"{ars['seconds'][name]:.2f} s" for name in ("median", "best"))
    yield f"training of Table 1 ({_millions(ars)})", *seconds
    if ppo := document.get("ppo_training"):
        yield f"training with PPO ({_millions(ppo)})", f"{ppo['seconds']:.1f} s"
        yield "share of it in the simulator", f"{ppo['simulator_share']:.1%}"
    rates = oracle["trials_per_second"]
    seconds = (f"{oracle['trials'] / rates[name]:.1f} s" for name in ("median", "best"))
    yield f"oracle, {oracle['trials']} trials", *seconds
    evaluation, what = document["evaluation"], "kinarm-eval --trials 200"
    memory = f"{evaluation['peak_memory_mb']:.0f} MB"
    yield f"{what}, nothing compiled", f"{evaluation['seconds_first']:.1f} s"
    yield f"{what}, bounds unknown", f"{evaluation['seconds_without_bounds']:.1f} s", memory
    yield f"{what}, bounds known", f"{evaluation['seconds']:.1f} s", memory


def _millions(training: dict[str, Any]) -> str:
    return f"{training['environment_steps'] / 1e6:.1f} million steps"


def _rates(timing: dict[str, float]) -> list[str]:
    return [f"{timing[name]:,.0f} steps/s" for name in ("median", "best")]


main = partial(run_request, "kinarm-bench", BenchmarkRequest, _report)
"""Run the command line."""

if __name__ == "__main__":
    main()
