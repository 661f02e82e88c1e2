"""``kinarm-bench``: how fast everything is on this machine."""

import json
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._fields import Checked
from kinarm._files import check_folder, only_writer, write_text
from kinarm.evaluation.report.templating import template_environment


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
    policy: str = field(
        default="ars-tuned-both", metadata={"metavar": "NAME_OR_FILE", "bare": True}
    )
    ppo: bool = False
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    json: bool = False

    GROUPS: ClassVar = {"what is measured": "repetitions policy ppo", "output": "out json"}
    DEFAULTS: ClassVar = {"out": "a table on standard output alone"}

    def run(self, command: str | None = None) -> dict[str, Any]:
        """Measure everything, and write ``speed.json`` and ``SPEED.md`` to a folder, if any.

        ``command`` is recorded, by default this request.
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


def speed_page(document: dict[str, Any]) -> str:
    """``SPEED.md``: everything that was measured, in one table."""
    return template_environment().get_template("speed.md").render({"ppo_training": {}, **document})


def _report(request: BenchmarkRequest, command: str) -> None:
    """Run a request, and print its figures."""
    from rich.markdown import Markdown

    document = request.run(command)
    if request.json:
        print(json.dumps(document))
        return
    _, _, page = speed_page({"command": command, **document}).partition("\n\n")
    open_console().print(Markdown(page))


main = partial(run_request, "kinarm-bench", BenchmarkRequest, _report)
"""Run the command line."""
