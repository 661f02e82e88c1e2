"""What was done and checked, how often, and what did not hold; its record and its table."""

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

EXAMPLES = 5
"""Failures of each kind that are described."""


@dataclass
class Tally:
    """Counts of one part of the campaign.

    Attributes
    ----------
    counts : dict of int
        Sizes, such as how many steps were taken, by their name.
    failed : dict of int
        How often something was wrong, by what it was.
    examples : list of dict
        Some failures, with what it takes to repeat them.
    """

    counts: dict[str, int] = field(default_factory=dict)
    failed: dict[str, int] = field(default_factory=dict)
    examples: list[dict[str, Any]] = field(default_factory=list)

    def count(self, what: str) -> None:
        """Count one more."""
        self.counts[what] = self.counts.get(what, 0) + 1

    def find(self, what: str, **example: Any) -> None:
        """Note something that is wrong."""
        self.failed[what] = self.failed.get(what, 0) + 1
        if self.failed[what] <= EXAMPLES:
            self.examples.append({"finding": what, **example})


def table(rows: Mapping[str, Mapping[str, int]]) -> str:
    """Numbers of some parts in Markdown, one row a part, and their sums."""
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    cells = {name: [row.get(column, 0) for column in columns] for name, row in rows.items()}
    if len(rows) > 1:
        cells["**all**"] = [sum(column) for column in zip(*cells.values(), strict=True)]
    lines = [["", *columns], ["---"] * (1 + len(columns))]
    lines += [[name, *(f"{number:,}" for number in row)] for name, row in cells.items()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


Run = Callable[[int, int, Tally], None]
"""Does so much, with a seed, and keeps a tally."""


def main(module: str, subjects: Mapping[str, Run], count: int) -> None:
    """Run one module of the campaign, record it after each subject, and exit with 1 if it failed.

    Parameters
    ----------
    module : str
        Its name.
    subjects : mapping
        What is done, by name.
    count : int
        How often by default, for each.
    """
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("--count", type=int, default=count, help="of each subject")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[*subjects], choices=subjects, metavar="NAME")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.json")
    given = parser.parse_args()
    command = shlex.join(["python", "-m", f"tests.campaign.{module}", *sys.argv[1:]])
    tallies: dict[str, Tally] = {}
    given.out.parent.mkdir(parents=True, exist_ok=True)
    for name in given.only:
        tallies[name] = Tally()
        subjects[name](given.count, given.seed, tallies[name])
        sys.stderr.write(f"{name}: {tallies[name].counts}, failed: {tallies[name].failed}\n")
        document = {"command": command, "subjects": {k: asdict(v) for k, v in tallies.items()}}
        given.out.write_text(json.dumps(document, indent=1) + "\n")
        rows = {k: {**v.counts, "findings": sum(v.failed.values())} for k, v in tallies.items()}
        given.out.with_suffix(".md").write_text(table(rows))
    sys.exit(any(sum(each.failed.values()) for each in tallies.values()))
