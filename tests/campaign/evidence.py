"""Evidence at scale, on every shipped arm.

``python -m tests.campaign.evidence --out data/results/evidence`` takes 10^9 steps of the kernels,
compares 10^7 verdicts of contact with Coal and MuJoCo, and puts the shipped policies to 10^6
trials whose bounds are proven. What is done lies in one file a part, and is not done again; it
ends with 1 if a claim did not hold.
"""

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from kinarm._files import write_text
from kinarm.arm_specification import arm_names
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names
from tests.campaign.checks.floors import check_floors
from tests.campaign.checks.steps import check_steps
from tests.campaign.checks.tally import Tally
from tests.campaign.checks.verdicts import check_verdicts
from tests.campaign.evidence_page import evidence_page

WHOLE = {"steps": 1_000_000_000, "contact": 10_000_000, "floors": 1_000_000}
"""How many steps, configurations and trials there are in all, by kind."""

SEED = 14

SHIPPED = ("paper", "paper_flange", "lrmate200ic_5l")
"""Arms of capsules, whose files ship with kinarm: they take three fifths of the steps. Those of the
others come with the extra robots."""

FACED = ("left", "right", "both", "post-paper", "table-paper")
"""Problems of the arm that the policies were trained for: three quarters of the trials."""

FITTING = ("benches-ur5", "ring-ur5", "lrmate200ic_5l", "paper_flange", "ur3", "ur10", "z1")
"""Problems and arms with the same joints and observations: the other quarter."""


class Part(NamedTuple):
    """A part of the evidence.

    Attributes
    ----------
    kind : str
        ``"steps"``, ``"contact"`` or ``"floors"``.
    name : str
        The arm, among the paper's benches or on a desk; or the problem.
    size : int
        How many steps, configurations or trials.
    """

    kind: str
    name: str
    size: int

    @property
    def problem(self) -> ReachProblem:
        """What is looked at."""
        if self.name in problem_names():
            return ReachProblem.load(self.name)
        if self.name in SHIPPED:
            return PROBLEMS["both"].replace(arm=self.name)
        scene = "desk" if self.name.startswith("so") else "benches"
        return PROBLEMS["both"].replace(arm=self.name, scene=scene, time_step=0.04)

    def file(self, folder: Path) -> Path:
        """Where it is recorded."""
        return folder / f"{self.kind}-{self.name}.json"


CHECKS: dict[str, Callable[[ReachProblem, int, int], Tally]] = {
    "steps": check_steps,
    "contact": check_verdicts,
    "floors": check_floors,
}


def parts(share: float) -> list[Part]:
    """All parts of some share of the evidence."""
    arms = arm_names()
    scenes = [*arms, *(name for name in problem_names() if name not in PROBLEMS)]
    sizes = {
        "steps": dict.fromkeys(arms, 0.4 * WHOLE["steps"] / (len(arms) - len(SHIPPED)))
        | dict.fromkeys(SHIPPED, 0.6 * WHOLE["steps"] / len(SHIPPED)),
        "contact": dict.fromkeys(scenes, WHOLE["contact"] / len(scenes)),
        "floors": dict.fromkeys(FACED, 0.75 * WHOLE["floors"] / len(FACED))
        | dict.fromkeys(FITTING, 0.25 * WHOLE["floors"] / len(FITTING)),
    }
    return [
        Part(kind, name, -int(-share * size // 1))
        for kind, names in sizes.items()
        for name, size in names.items()
    ]


def gather(part: Part, folder: Path, command: str) -> dict[str, Any]:
    """Do a part, unless it is done; return what is recorded of it."""
    path, problem = part.file(folder), part.problem
    asked = {**part._asdict(), "seed": SEED, "problem": problem.digest}
    if path.exists():
        known: dict[str, Any] = json.loads(path.read_text())
        if {key: known.get(key) for key in asked} == asked:
            return known
    began, worked = time.monotonic(), time.process_time()
    tally = CHECKS[part.kind](problem, part.size, SEED)
    document = {
        **asked,
        "command": command,
        "counts": tally.counts,
        "measures": tally.measures,
        "checked": tally.checked,
        "failed": tally.failed,
        "examples": tally.examples,
        "seconds": round(time.monotonic() - began, 1),
        "processor_seconds": round(time.process_time() - worked, 1),
        "machine": {"system": platform.platform(), "processors": os.cpu_count()},
        "versions": package_versions(),
        "commit": source_commit(),
    }
    write_text(path, json.dumps(document, indent=1) + "\n")
    return document


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; 1 if a claim did not hold."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where to record")
    parser.add_argument("--share", type=float, default=1.0, help="part of the whole (1)")
    parser.add_argument("--kind", choices=tuple(CHECKS), action="append", help="only this kind")
    parser.add_argument("--name", action="append", help="only this arm or problem")
    options = parser.parse_args(arguments)
    command = "python -m tests.campaign.evidence --out FOLDER"
    command += "" if options.share == 1 else f" --share {options.share:g}"
    options.out.mkdir(parents=True, exist_ok=True)
    wanted = [
        part
        for part in parts(options.share)
        if part.kind in (options.kind or CHECKS) and part.name in (options.name or [part.name])
    ]
    failures = 0
    for number, part in enumerate(wanted, start=1):
        document = gather(part, options.out, command)
        failed = {claim: count for claim, count in document["failed"].items() if count}
        failures += sum(failed.values())
        state = f"failed: {failed}" if failed else "holds"
        seconds = document["seconds"]
        line = f"{number}/{len(wanted)} {part.kind} {part.name}: {state}, {seconds:.0f} s\n"
        sys.stderr.write(line)
        documents = [json.loads(path.read_text()) for path in sorted(options.out.glob("*-*.json"))]
        page = evidence_page(documents, WHOLE)
        write_text(options.out / "EVIDENCE.md", page)
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
