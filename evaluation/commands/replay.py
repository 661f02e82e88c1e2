"""``kinarm-replay``: watch trials in a browser, from one file."""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kinarm._command_line import option_name, run_request
from kinarm._console import open_console
from kinarm._files import check_output
from kinarm.errors import FROM_ZERO, InvalidInputError
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.recording import Recording
    from kinarm.viewer.html_page import HtmlPage

NOT_PLAYED = "source policy wrapper compare trial worst failures oracle record"
"""Fields without meaning for a playground."""

ALTERNATIVES = ("policy compare", "trial worst failures")
"""Fields that exclude each other."""

NOT_RECORDED = (
    f"policy compare problem {ProblemOptions.CHANGES.removeprefix('arm ')} "
    "seed trials vec_normalize wrapper"
)
"""Fields without meaning for a file of recordings."""

PAGE, PLAYGROUND = "replay.html", "play.html"
"""Default pages."""

GENERATOR = b'<meta name="generator" content="kinarm">'
"""What pages of kinarm begin with."""


@dataclass(frozen=True, kw_only=True)
class ReplayRequest(ProblemOptions):
    """Write a page that replays trials offline, or plays policies.

    Parameters
    ----------
    source : Path
        File of recordings (.npz); or a policy, as for --policy.
    policy : str
        Shipped policy or recipe (its first seed), random, zero, oracle, .npz
        file, folder of them (the first), Stable-Baselines3's model.zip (runs
        its code: only if you trust it), or module:function.
    vec_normalize : Path
        Statistics of VecNormalize for a model of Stable-Baselines3 (runs code),
        or none.
    wrapper : str
        module:function from an environment to a wrapped one, in which policies
        face the trials.
    compare : tuple of str
        Two policies on the same trials, the second as a ghost.
    trial : tuple of int
        Play this trial; repeatable.
    worst : int
        Play the trials that ended farthest from their goals, this many; each
        trial once.
    failures : bool
        Play all trials that failed, in groups by cause, beside the oracle.
    trials : int
        Trials that are run.
    seed : int
        Seed of the trials.
    play : tuple of str
        Make a page in which these policies run instead, whose goal and
        obstacles one moves.
    allow_other_arm : bool
        Allow an arm that a policy was not trained for.
    oracle : bool
        Show the number of steps proven necessary.
    out : Path
        The page to write.
    record : Path
        Write the recordings as well (.npz).
    overwrite : bool
        Replace files that exist; a page of kinarm with the default name always
        is.

    Raises
    ------
    InvalidInputError
        If a number is out of range, or two fields do not go together.
    """

    source: Path | None = field(default=None, metadata={"flag": "source", "metavar": "FILE"})
    policy: str | None = field(default=None, metadata={"metavar": "NAME_OR_FILE"})
    vec_normalize: Path | None = field(default=None, metadata={"metavar": "FILE|none"})
    wrapper: str | None = field(default=None, metadata={"metavar": "MODULE:FUNCTION"})
    compare: tuple[str, str] | None = field(default=None, metadata={"metavar": ("A", "B")})
    trial: tuple[int, ...] = field(default=(), metadata={"repeat": True, **FROM_ZERO})
    worst: int | None = None
    failures: bool = False
    trials: int | None = None
    seed: int | None = field(default=None, metadata=FROM_ZERO)
    play: tuple[str, ...] | None = field(default=None, metadata={"metavar": "POLICY", "nargs": "*"})
    allow_other_arm: bool = False
    oracle: bool = True
    out: Path | None = None
    record: Path | None = None
    overwrite: bool = False

    SHIELDS_POLICIES: ClassVar = True

    GROUPS: ClassVar = {
        "what is replayed": "source policy vec_normalize wrapper compare play allow_other_arm",
        "which trials": "trials seed trial worst failures oracle",
        "output": "out record overwrite",
        **ProblemOptions.GROUPS,
    }
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "problem": "what the policy was trained for",
        "trials": "5; 200 to choose from, 10000 for --failures, 20 for --play",
        "play": "without names, four that ship",
        "seed": "0",
        "out": f"{PAGE}, or {PLAYGROUND} for --play",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.source and not (self.policy or self.compare) and is_policy(self.source):
            object.__setattr__(self, "policy", str(self.source))
            object.__setattr__(self, "source", None)
        for names in ALTERNATIVES:
            given = self._given(names)
            if len(given) > 1:
                raise InvalidInputError(f"{given[0]} and {given[1]} exclude each other")
        self._refuse("--play", NOT_PLAYED if self.play is not None else "")
        self._refuse("a file of recordings", NOT_RECORDED if self.source else "")

    def _refuse(self, mode: str, names: str) -> None:
        for option in self._given(names):
            raise InvalidInputError(f"{option} does not go with {mode}")

    def _given(self, names: str) -> list[str]:
        """Options of the fields that are given."""
        items = {item.name: item for item in fields(self)}
        given = (
            items[name] for name in names.split() if getattr(self, name) != items[name].default
        )
        return ["a file" if item.name == "source" else option_name(item) for item in given]

    def run(self, report: Callable[[str], object] = lambda _: None) -> "HtmlPage":
        """Write the page, and the recordings if asked for, and return it.

        Parameters
        ----------
        report : callable
            Called with lines about what is shown.

        Raises
        ------
        KinarmError
            If a file, name or number cannot be used, or a file cannot be
            written.
        """
        usual, acts = (PAGE, "plays") if self.play is None else (PLAYGROUND, "runs")
        out = self.out or Path(usual)
        own = self.out is None and out.is_file() and GENERATOR in out.read_bytes()[:2000]
        check_output(out, overwrite=self.overwrite or own)
        if self.play is None:
            page = self._replay(report)
        else:
            from kinarm.evaluation.replay import playground

            with open_console(stderr=True).status("making the page"):
                page = playground(self)
        page.save(out)
        report(f"written: {out}, {len(page.html) / 1e6:.1f} MB, {acts} offline in any browser")
        return page

    def recordings(self) -> "list[list[Recording]]":
        """Make or read the recordings to play, a list for each policy.

        Raises
        ------
        KinarmError
            If a file, name or number cannot be used.
        """
        from kinarm.evaluation.replay import chosen_recordings

        return chosen_recordings(self).runs

    def _replay(self, report: Callable[[str], object]) -> "HtmlPage":
        from kinarm.evaluation.replay import chosen_recordings
        from kinarm.recording import save_recordings
        from kinarm.viewer import replay_page

        if self.record is not None:
            check_output(self.record, overwrite=self.overwrite, suffix=".npz")
        with open_console(stderr=True).status("recording"):
            runs, groups, heading = chosen_recordings(self)
            if self.source is None:
                say_choices([runs[0][0].problem])
            ghosts = runs[1] if len(runs) > 1 else ()
            page = replay_page(runs[0], ghosts=ghosts, groups=groups, heading=heading)
        if self.record is not None:
            save_recordings(self.record, [recording for run in runs for recording in run])
        for note in dict.fromkeys(run[0].provenance.get("note") for run in runs):
            if note:
                report(note)
        if groups:
            report(heading)
            for group, count in Counter(groups).items():
                report(f"{count:5d}  {group}")
        for trial in zip(*runs, strict=True) if not groups else ():
            for recording in trial:
                report(described(recording))
        return page


def is_policy(source: Path) -> bool:
    """Whether it is no file of recordings: a policy file, or what else names a policy."""
    if source.suffix != ".npz":
        return True
    with suppress(Exception), np.load(source, allow_pickle=False) as content:
        return str(content["format"]) == "kinarm-policy"
    return False


def described(recording: "Recording") -> str:
    """One line about a recording."""
    ending = {
        "success": "reached the goal",
        "collision": " touches ".join(recording.contact or ("something",)),
        "truncated": "truncated",
    }[recording.outcome]
    floor = recording.steps_lower_bound
    necessary = f" ({floor} proven necessary)" if floor is not None else ""
    shielded = f", {n} replaced by the shield" if (n := len(recording.replaced)) else ""
    return (
        f"{recording.problem.name} {recording.trial}, {recording.policy}: {ending} after "
        f"{recording.steps} steps{necessary}{shielded}, {recording.final_distance:.3f} m "
        "from the goal"
    )


def _report(request: ReplayRequest, _: str) -> None:
    request.run(lambda line: print(line, flush=True))


main = partial(run_request, "kinarm-replay", ReplayRequest, _report)
"""Run the command line."""
