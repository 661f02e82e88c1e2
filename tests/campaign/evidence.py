"""Evidence at scale, on every shipped arm.

``python -m tests.campaign.evidence --out data/results/evidence`` takes 10^9 steps of the kernels,
compares 10^7 verdicts of contact with Coal and MuJoCo, and puts the shipped policies to 10^6
trials whose bounds are proven. What is done lies in one file a part, and is not done again; it
ends with 1 if a claim did not hold.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from kinarm.arm_specification import arm_names
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names

from .steps import check_policies, check_steps
from .tally import Tally, table
from .verdicts import check_verdicts

WHOLE = {"steps": 1_000_000_000, "contact": 10_000_000, "floors": 1_000_000}
"""How many steps, configurations and trials there are in all, by kind."""
TITLES = {
    "steps": "Steps of the kernels",
    "contact": "Verdicts of contact",
    "floors": "Policies and proven bounds",
}
CHECKS: dict[str, Callable[[ReachProblem, int, int], Tally]] = {
    "steps": check_steps,
    "contact": check_verdicts,
    "floors": check_policies,
}
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
        """The problem whose episodes are looked at, tested at four configurations a step."""
        discrete = PROBLEMS["both"].replace(tested_configurations=4)
        if self.name in problem_names():
            return ReachProblem.load(self.name).tested_as(discrete)
        if self.name in SHIPPED:
            return discrete.replace(arm=self.name)
        scene = "desk" if self.name.startswith("so") else "benches"
        return discrete.replace(arm=self.name, scene=scene, time_step=0.04)


def parts(share: float) -> list[Part]:
    """All parts of some share of the evidence."""
    arms = arm_names()
    scenes = [*arms, *(name for name in problem_names() if name not in PROBLEMS)]
    others = tuple(name for name in arms if name not in SHIPPED)
    split: tuple[tuple[str, Sequence[str], float], ...] = (
        *(("steps", SHIPPED, 0.6), ("steps", others, 0.4), ("contact", scenes, 1.0)),
        *(("floors", FACED, 0.75), ("floors", FITTING, 0.25)),
    )
    return [
        Part(kind, name, -int(-share * weight * WHOLE[kind] / len(names) // 1))
        for kind, names, weight in split
        for name in names
    ]


def gather(part: Part, folder: Path, command: str) -> dict[str, Any]:
    """Do a part, unless it is done; return what is recorded of it."""
    path, problem = folder / f"{part.kind}-{part.name}.json", part.problem
    asked = {**part._asdict(), "seed": SEED, "problem": problem.digest}
    if path.exists():
        known: dict[str, Any] = json.loads(path.read_text())
        if {key: known.get(key) for key in asked} == asked:
            return known
    tally = asdict(CHECKS[part.kind](problem, part.size, SEED))
    made = {"command": command, "versions": package_versions(), "commit": source_commit()}
    path.write_text(json.dumps({**asked, **made, **tally}, indent=1) + "\n")
    return {**asked, **made, **tally}


def page(documents: Sequence[dict[str, Any]]) -> str:
    """The tables of everything that is recorded, in Markdown."""
    text = "# Evidence\n\nOne file a part lies beside this page.\n"
    for kind, title in TITLES.items():
        found = [document for document in documents if document["kind"] == kind]
        whole = Tally()
        for document in found:
            for claim, number in document["checked"].items():
                whole.checked[claim] = whole.checked.get(claim, 0) + number
                failed = document["failed"].get(claim, 0)
                whole.failed[claim] = whole.failed.get(claim, 0) + failed
            for name, value in document["measures"].items():
                whole.largest(name, value)
        if found:
            claims = {
                claim: {"checked": number, "did not hold": whole.failed[claim]}
                for claim, number in whole.checked.items()
            }
            counts = {document["name"]: document["counts"] for document in found}
            text += f"\n## {title}\n\n{table(counts)}\n{table(claims, 'claim')}"
            text += "".join(f"\nLargest {name}: {v:.2g}\n" for name, v in whole.measures.items())
    return text


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; 1 if a claim did not hold."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where to record")
    parser.add_argument("--share", type=float, default=1.0, help="part of the whole (1)")
    parser.add_argument("--kind", choices=tuple(CHECKS), action="append", help="only this kind")
    parser.add_argument("--name", action="append", help="only this arm or problem")
    given = parser.parse_args(arguments)
    command = f"python -m tests.campaign.evidence --out FOLDER --share {given.share:g}"
    given.out.mkdir(parents=True, exist_ok=True)
    failures = 0
    for part in parts(given.share):
        if part.kind in (given.kind or CHECKS) and part.name in (given.name or [part.name]):
            failed = sum(gather(part, given.out, command)["failed"].values())
            failures += failed
            sys.stderr.write(f"{part.kind} {part.name}: {failed} failures\n")
            done = [json.loads(path.read_text()) for path in sorted(given.out.glob("*-*.json"))]
            (given.out / "EVIDENCE.md").write_text(page(done))
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
