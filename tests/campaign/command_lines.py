"""Every command with arguments of every kind: ``python -m tests.campaign.command_lines``.

Words are drawn from the options that the commands have, from values that fit and from values that
nobody means. What is started ends with status 0, 1, 2 or 130; bad input with one line. What a
command would do once its arguments are accepted is left out, but for what prepares it.
"""

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

from hypothesis import strategies as st

from kinarm._options import add_options
from kinarm._parser import Parser
from kinarm.evaluation.commands import (
    arms,
    bench,
    compare,
    evaluate,
    problem,
    replay,
    reproduce,
    study,
)
from kinarm.evaluation.replay.request import ReplayRequest
from kinarm.policies import train

from .judging import Judge, Verdict, unfit
from .mutations import Rng, pick
from .processes import STUDY
from .running import Try, campaign, generator, options

LARGE = 20_000

STATUSES = (0, 1, 2, 130)

WORDS = (
    *("", " ", "-", "--", "-1", "0", "1", "2", "3", "1e30", "-1e30", "1e308", "1e-320", "nan"),
    *("inf", "100000000", "99999999999999999999", "1" * 5000, "0x10", "1_000", "2.5", "\u0663"),
    *("é\u2028\udcff", "x" * 5000, "a/" * 600 + "b", "[/o]", "x/[red]", "~", "../..", "/", "."),
    *("/dev/null", "/dev/full", "/dev/stdin", "/proc/self/mem", "/proc/self/status", "@file"),
    *("right", "left", "both", "paper", "tuned", "zero", "random", "oracle", "ars-tuned-both"),
    *("os:getcwd", "antigravity:x", "math:sin", "no.such:thing", "ppo", "ars", "list", "show"),
    *("out", "out.npz", "out.md", "out.html", "out.png", "out.json", "damaged.npz", "damaged.toml"),
    *("damaged.json", "damaged.urdf", "damaged.zip", "folder", "folder/deep/out", "check"),
)
"""What is typed: names, numbers, paths, and what is none of these."""

DAMAGED = {
    "damaged.npz": b"PK\x03\x04junk",
    "damaged.toml": b"base = [",
    "damaged.json": b'{"protocol": []}',
    "damaged.urdf": b"<robot><link/></robot>",
    "damaged.zip": b"PK\x05\x06" + bytes(18),
}


@dataclass(frozen=True)
class Program:
    """A command.

    Parameters
    ----------
    main : callable
        Runs it.
    flags : callable
        Its options.
    sets : tuple of list of str
        Arguments to start from, which are accepted.
    unused : tuple of str
        What is left out: long work that accepted arguments lead to.
    """

    main: Callable[[Sequence[str]], None]
    flags: Callable[[], list[str]]
    sets: tuple[list[str], ...]
    unused: tuple[str, ...] = ()


def _flags(*kinds: type) -> list[str]:
    """Names of options that dataclasses make."""
    parser = Parser(prog="any")
    for kind in kinds:
        with contextlib.suppress(argparse.ArgumentError):
            add_options(parser, kind)
    return [flag for action in parser._actions for flag in action.option_strings]


def _train_flags() -> list[str]:
    found: dict[str, None] = {}
    for action in train.build_parser()._subparsers._group_actions:  # type: ignore[union-attr]
        for parser in action.choices.values():  # type: ignore[union-attr]
            found |= dict.fromkeys(f for a in parser._actions for f in a.option_strings)
    return list(found)


PROGRAMS: dict[str, Program] = {
    "kinarm-arms": Program(
        arms.main,
        lambda: _flags(arms.ShowRequest),
        (["list"], ["show", "paper"], ["show", "damaged.urdf"]),
        ("kinarm.evaluation.commands.arms.ListRequest.rows",),
    ),
    "kinarm-bench": Program(
        bench.main,
        lambda: _flags(bench.BenchmarkRequest),
        ([], ["--repetitions", "1"], ["--out", "out"]),
        ("kinarm.evaluation.measurements.benchmark.measure",),
    ),
    "kinarm-compare": Program(
        compare.main,
        lambda: _flags(compare.ComparisonRequest),
        (["--no-train"], ["--learners", "ars-paper", "--out", "out"], ["--settings", "mine.toml"]),
        ("kinarm.evaluation.commands.compare.ComparisonRequest._carry_out",),
    ),
    "kinarm-eval": Program(
        evaluate.main,
        lambda: _flags(evaluate.EvaluationRequest),
        (["--policy", "zero"], ["--trials", "2"], ["--policy", "ars-tuned-both", "--out", "out"]),
        ("kinarm.evaluation.request.EvaluationRequest._face",),
    ),
    "kinarm-problem": Program(
        problem.main,
        lambda: _flags(problem.CheckRequest),
        (["list"], ["show", "right"], ["check", "right", "--trials", "2"]),
        ("kinarm.evaluation.problem_check.ProblemCheck.of",),
    ),
    "kinarm-replay": Program(
        replay.main,
        lambda: _flags(ReplayRequest),
        (["--policy", "zero", "--problem", "left"], ["damaged.npz"], ["--compare", "zero", "zero"]),
        (
            "kinarm.evaluation.trials.TrialSet.draw",
            "kinarm.viewer.live_server.LiveServer.__init__",
        ),
    ),
    "kinarm-reproduce": Program(
        reproduce.main,
        lambda: _flags(reproduce.ReproductionRequest),
        (["--quick"], ["--no-ppo"], ["--out", "out"]),
        ("kinarm.evaluation.commands.reproduce.ReproductionRequest._carry_out",),
    ),
    "kinarm-study": Program(
        study.main,
        lambda: _flags(study.StudyRequest),
        ([STUDY], [STUDY, "--out", "out"], [STUDY, "--no-train"], ["status", "out"]),
        ("kinarm.evaluation.experiments.study.Study.run",),
    ),
    "kinarm-train": Program(
        train.main,
        _train_flags,
        (["ars", "--out", "out.npz"], ["ppo", "--out", "out.npz"], ["ars", "--resume"]),
        (
            "kinarm.policies.training_files.run_training",
            "kinarm.policies.seeds.SeedsRequest._carry_out",
        ),
    ),
}


class PreparedError(Exception):
    """Arguments are accepted, and the work could begin."""


@cache
def flags_of(name: str) -> list[str]:
    """Options of a command."""
    return PROGRAMS[name].flags()


def command_lines(name: str) -> st.SearchStrategy[list[str]]:
    """Command lines of a program, as Hypothesis makes them."""
    word = st.one_of(
        st.sampled_from(flags_of(name)),
        st.sampled_from(WORDS),
        st.text(st.characters(exclude_characters="\x00"), max_size=8),
        st.integers().map(str),
        st.floats().map(str),
    )
    begin = st.sampled_from((*PROGRAMS[name].sets, []))
    return st.tuples(begin, st.lists(word, max_size=6)).map(lambda parts: [*parts[0], *parts[1]])


def drawn_line(name: str, rng: Rng) -> list[str]:
    """A command line: one that is accepted, with a few options, values and stray words."""
    line = list(pick(rng, (*PROGRAMS[name].sets, [])))
    for _ in range(int(rng.integers(4))):
        kind = int(rng.integers(6))
        if kind <= 3:
            line.append(pick(rng, flags_of(name)))
            if kind:
                line += [str(pick(rng, WORDS)) for _ in range(int(rng.integers(1, 3)))]
        elif kind == 4 and line:
            line[int(rng.integers(len(line)))] = pick(rng, WORDS)
        else:
            line.insert(int(rng.integers(len(line) + 1)), pick(rng, WORDS))
    return line


class CommandJudge:
    """Runs command lines in this process, and says what is wrong with how they end.

    To be used as a context, in a folder of its own.
    """

    def __init__(self, name: str) -> None:
        self._program = PROGRAMS[name]

    def __enter__(self) -> "CommandJudge":
        self._stack = contextlib.ExitStack()
        for unused in self._program.unused:
            self._stack.enter_context(mock.patch(unused, side_effect=PreparedError))
        self._judge = self._stack.enter_context(Judge(traced=0))
        for name, content in DAMAGED.items():
            Path(name).write_bytes(content)
        Path("folder").mkdir(exist_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def __call__(self, line: Sequence[str]) -> Verdict:
        """Run a command line."""
        answer: dict[str, Any] = {}
        verdict = self._judge(partial(self._run, line, answer), Path("damaged.npz"))
        finding = "" if verdict.finding.startswith("takes") else verdict.finding
        if not finding and "status" in answer:
            finding = _unfit_end(answer)
        return Verdict(answer.get("status", 0) == 0, finding, verdict.memory)

    def _run(self, line: Sequence[str], answer: dict[str, Any], _: Path) -> None:
        """Run a command line and keep how it ends."""
        out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                self._program.main(list(line))
            except PreparedError:
                pass
            except SystemExit as end:
                answer["status"] = end.code or 0
                err.seek(0)
                answer["err"] = err.read()


def _unfit_end(answer: dict[str, Any]) -> str:
    """What is wrong with the end of a command; empty if nothing is."""
    status, err = answer["status"], answer["err"]
    if status not in STATUSES:
        return f"status {status!r}"
    if status == 2:
        return unfit(err) or ("" if err.startswith("kinarm-") else f"says {err[:60]!r}")
    return "a traceback" if "Traceback" in err else ""


@contextlib.contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Work in a folder, whose own modules are those that count."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def make_try(name: str, seed: int, folder: Path) -> Try:
    """Prepare this process for a program; returns what judges the command line of a number."""
    os.chdir(folder)
    judge = CommandJudge(name).__enter__()

    def try_line(number: int) -> Verdict:
        line = drawn_line(name, generator(seed, name, number))
        return judge(line)

    return try_line


def main() -> int:
    """Run the campaign."""
    given = options("Every command with arguments of every kind.", LARGE).parse_args()
    subjects = {name: partial(make_try, name, given.seed) for name in PROGRAMS}
    return campaign(subjects, given, "command_lines")


if __name__ == "__main__":
    sys.exit(main() > 0)
