"""``kinarm-bench``: how fast everything is on this machine."""

import json
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._fields import Checked
from kinarm.evaluation.report.templating import template


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
    json : bool
        Print JSON on standard output.
    """

    repetitions: int = 7
    policy: str = field(
        default="ars-tuned-both", metadata={"metavar": "NAME_OR_FILE", "bare": True}
    )
    ppo: bool = False
    json: bool = False

    GROUPS: ClassVar = {"what is measured": "repetitions policy ppo", "output": "json"}

    def run(self) -> dict[str, Any]:
        """Measure everything."""
        from kinarm.evaluation.bench import measure

        return measure(self.policy, self.repetitions, ppo=self.ppo)


def _report(request: BenchmarkRequest, command: str) -> None:
    """Run a request, and print its figures in one table."""
    from rich.markdown import Markdown

    document = {"command": command, **request.run()}
    if request.json:
        print(json.dumps(document))
        return
    page = template("speed.md").render({"ppo_training": {}, **document})
    _, _, table = page.partition("\n\n")
    open_console().print(Markdown(table))


main = partial(run_request, "kinarm-bench", BenchmarkRequest, _report)
"""Run the command line."""
