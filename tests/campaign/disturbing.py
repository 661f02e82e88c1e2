"""Commands that are disturbed in turn: options, turns and records of such a campaign."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .processes import own_cache, write
from .record_page import write_page


@dataclass
class Tally:
    """What came of the disturbances of one command.

    Attributes
    ----------
    findings : dict of str to int
        How often something was wrong, by what it was.
    examples : dict of str to dict
        The first of each.
    """

    findings: dict[str, int] = field(default_factory=dict)
    examples: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def disturbances(self) -> int:
        """How many there were."""
        raise NotImplementedError

    def find(self, what: str, **example: Any) -> None:
        """Take note of something that is wrong."""
        self.findings[what] = self.findings.get(what, 0) + 1
        self.examples.setdefault(what, example)


TallyT = TypeVar("TallyT", bound=Tally)
Tell = Callable[[Mapping[str, Tally]], None]
"""Is told of the tallies after every turn."""


def tell_nobody(_: Mapping[str, Tally]) -> None:
    """Keep it."""


def take_turns(
    turns: int,
    seed: int,
    tallies: dict[str, TallyT],
    disturb: Callable[[str, np.random.Generator, TallyT], None],
    tell: Tell,
) -> dict[str, TallyT]:
    """Disturb commands in turn, so many times in all, with a cache of the campaign's own."""
    rng = np.random.default_rng(seed)
    names = [*tallies]
    with own_cache():
        for number in range(turns):
            name = names[number % len(names)]
            disturb(name, rng, tallies[name])
            tell(tallies)
    return tallies


def main(
    module: str,
    count: int,
    names: Sequence[str],
    campaign: Callable[[int, int, Sequence[str], Tell], Mapping[str, Tally]],
) -> None:
    """Run the command line of a campaign, which is recorded after every turn; then exit.

    Parameters
    ----------
    module : str
        Its name, which is that of what it counts, too.
    count : int
        How many disturbances there are by default.
    names : sequence of str
        The commands.
    campaign : callable
        Carries it out, of a count, a seed, names and what is told.
    """
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[*names], choices=names, metavar="NAME")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.json")
    given = parser.parse_args()

    def tell(tallies: Mapping[str, Tally]) -> None:
        counts = {module: sum(tally.disturbances for tally in tallies.values())}
        parts = {name: asdict(tally) for name, tally in tallies.items()}
        write(given.out, module, counts, findings_of(tallies), parts)
        write_page(given.out, parts)
        sys.stderr.write(f"{counts[module]} {module}, {findings_of(tallies)} findings\n")

    sys.exit(findings_of(campaign(given.count, given.seed, given.only, tell)) > 0)


def findings_of(tallies: Mapping[str, Tally]) -> int:
    """How many there are."""
    return sum(sum(tally.findings.values()) for tally in tallies.values())
