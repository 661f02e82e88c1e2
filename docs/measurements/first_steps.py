"""Do what a newcomer does: from a clone to an own policy that runs on an arm, with a log.

``python -m docs.measurements.first_steps data/results/first_steps`` clones what is committed, and
types the commands of the README and then those of the tutorial *First policy*, as they are written,
in their order. It records what was typed, how long each command took and what it printed, and opens
the playground in a browser. Needs the network, Chromium and the extra ``test``. It fails if a
command does, or if the policy reaches less than `ENOUGH`.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from docs.browser import open_page
from kinarm.evaluation.report.templating import markdown_table
from tests.helpers.pages import DOCS, ROOT, blocks

ENOUGH = 0.85
"""Success of the newcomer's policy."""

SHOWN = 12
"""Last lines of a command's output in the log."""

INSTALL, ACTIVATE = "make eval", ". .venv/bin/activate"
"""What the README says first, and what it says before the other commands."""

PAGES = (ROOT / "README.md", DOCS / "tutorials" / "first_policy.md")


class Step(NamedTuple):
    """Something that was typed.

    Attributes
    ----------
    typed : str
        A command.
    seconds : float
        How long it took [s].
    said : str
        What it printed.
    """

    typed: str
    seconds: float
    said: str


def typed() -> Iterator[str]:
    """What a newcomer types in the clone, if the README says the first two commands."""
    readme, tutorial = PAGES
    said = readme.read_text(encoding="utf-8")
    if missing := [command for command in (INSTALL, ACTIVATE) if command not in said]:
        raise SystemExit(f"{readme.name} does not say: {', '.join(missing)}")
    yield INSTALL
    for block in blocks(tutorial):
        if block.language == "sh":
            yield from block.code.splitlines()


def carry_out(command: str, clone: Path, environment: dict[str, str]) -> Step:
    """Type something in the clone."""
    prepared = command if command == INSTALL else f"{ACTIVATE}\n{command}"
    began = time.monotonic()
    done = subprocess.run(
        ["bash", "-e", "-c", prepared],
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    step = Step(command, time.monotonic() - began, done.stdout)
    if done.returncode:
        raise SystemExit(f"{command}: status {done.returncode}\n{done.stdout}")
    return step


def success(clone: Path, environment: dict[str, str]) -> float:
    """Share of 4000 fresh trials that the policy reaches."""
    command = "kinarm-eval --policy mine.npz --trials 4000 --seed 161 --json"
    said = carry_out(f"{command} 2>/dev/null", clone, environment).said
    (row,) = (row for row in json.loads(said)["results"] if row["policy"] == "mine")
    return float(row["metrics"]["success"]["value"])


def table(steps: list[Step], reached: float) -> str:
    """What was typed and how long it took, for the documentation."""
    rows = [(f"`{step.typed}`", f"{step.seconds:.0f}") for step in steps]
    total = ("**all**", f"{sum(step.seconds for step in steps):.0f}")
    return (
        markdown_table(("typed", "seconds"), [*rows, total])
        + f"\nThe policy reached {100 * reached:.1f} % of 4000 fresh trials "
        "(`kinarm-eval --policy mine.npz --trials 4000 --seed 161`).\n"
    )


def log(steps: list[Step]) -> str:
    """What was typed, and the last lines of what was printed."""
    terminal, parts = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]"), []
    for step in steps:
        said = terminal.sub("", step.said).replace("\r", "\n").splitlines()
        last = "\n".join(line.rstrip() for line in said[-SHOWN:])
        parts.append(f"$ {step.typed}\n{last}\n({step.seconds:.1f} s)\n")
    return "\n".join(parts)


def main(out: Path) -> None:
    """Walk, and record it below a path without ending."""
    with tempfile.TemporaryDirectory() as name:
        clone = Path(name) / "kinarm"
        environment = {
            **{key: value for key, value in os.environ.items() if key != "VIRTUAL_ENV"},
            "KINARM_CACHE": f"{name}/cache",
            "COLUMNS": "80",
            "PIP_QUIET": "1",  # or it names folders of this machine
        }
        subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
        steps = []
        for command in typed():
            steps.append(carry_out(command, clone, environment))
            sys.stderr.write(f"{steps[-1].seconds:6.1f} s  {command}\n")
        reached = success(clone, environment)
        with open_page(clone / "play.html", 1000, 640) as opened:
            opened.wait_for_selector("body[data-ready]")
            opened.screenshot(path=out.with_suffix(".png"))
    out.with_suffix(".md").write_text(table(steps, reached), encoding="utf-8")
    out.with_suffix(".log").write_text(log(steps), encoding="utf-8")
    sys.exit(reached < ENOUGH)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
