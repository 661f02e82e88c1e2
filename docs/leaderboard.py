"""The leaderboard: ``python -m docs.leaderboard`` scores what ships for it or was submitted.

``python -m docs.leaderboard data/leaderboard/mine.toml`` scores this submission alone, and leaves
other rows as they are. The record lies beside the shipped policies; `docs.tables` makes pages of
it. The trials have their own seed, so that no policy is chosen by the trials that evaluations show.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import chdir
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kinarm._fields import Checked, from_plain, read_toml
from kinarm._files import first_line, write_text
from kinarm.errors import FROM_ZERO, InvalidInputError
from kinarm.evaluation import EvaluationRequest, find_contestants
from kinarm.evaluation.contestants import ORACLE, SHIELDED
from kinarm.evaluation.evaluation import Evaluation, outcomes_of
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import failure_causes
from kinarm.evaluation.statistics import share_over_seeds
from kinarm.evaluation.summary import pool
from kinarm.problem import PROBLEMS

DATA = Path(__file__).parent.parent / "data"
RECORD = DATA / "policies" / "leaderboard.json"
SUBMISSIONS = DATA / "leaderboard"

TRIALS, SEED = 10_000, 20_161
"""The held trials of each problem: nothing else draws from this seed."""

FIGURES = ("collision", "step_ratio", "replaced")
"""Figures of a row, beside success and its interval."""

MOST_CAUSES = 8
"""Causes of failure that a row lists."""


@dataclass(frozen=True, kw_only=True)
class Submission(Checked):
    """What a file of TOML submits; a policy file needs none.

    Parameters
    ----------
    policy : str
        As `kinarm-eval` takes it, from the file's folder: ``module:function``, ...
    problems : tuple of str
        Which of the paper's problems it faces.
    wrapper : str, optional
        ``module:function`` from an environment to the one that it acts in.
    parameters, training_steps : int, optional
        Its numbers, and environment steps of its training; policy files say both.
    """

    policy: str
    problems: tuple[str, ...] = tuple(PROBLEMS)
    wrapper: str | None = None
    parameters: int | None = field(default=None, metadata=FROM_ZERO)
    training_steps: int | None = field(default=None, metadata=FROM_ZERO)

    @classmethod
    def read(cls, file: Path) -> "Submission":
        """Read a file of TOML, or describe a policy file."""
        if file.suffix == ".toml":
            made = from_plain(cls, read_toml(file, "submission"), "submission")
        else:
            (contestant,) = find_contestants(file)
            served = (name for name, problem in PROBLEMS.items() if contestant.serves(problem))
            made = cls(policy=file.name, problems=tuple(served))
        if not made.problems or not PROBLEMS.keys() >= {*made.problems}:
            wanted = ", ".join(PROBLEMS)
            raise InvalidInputError(f"it faces none of the problems, or others than {wanted}")
        return made

    def rows(self, name: str, trials: int) -> list[dict[str, Any]]:
        """Its rows, bare and behind a shield, under a name."""
        request = EvaluationRequest(
            policies=(self.policy,),
            problems=self.problems,
            wrapper=self.wrapper,
            trials=trials,
            seed=SEED,
            shield=True,
        )
        faced = [each for each in request.evaluate() if each.contestant is not ORACLE]
        rows = rows_of(faced)
        for row in rows:
            row["policy"] = name + SHIELDED * (SHIELDED in row["policy"])
            for said in ("parameters", "training_steps"):
                row[said] = row[said] if getattr(self, said) is None else getattr(self, said)
        return rows


def rows_of(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """Rows of the leaderboard: training seeds of a recipe share one."""
    pooled = pool(evaluations)
    members = {member for group in pooled for member in group.members}
    alone = [each for each in evaluations if each not in members]
    return [_row(each.name, each.members) for each in (*pooled, *alone)]


def _row(name: str, members: Sequence[Evaluation]) -> dict[str, Any]:
    policy, outcomes = members[0].contestant.policy, outcomes_of(members)
    hits = np.array([each.rollouts.success for each in members])
    trained = [each.contestant.policy for each in members if each.contestant.policy]
    steps = [each.provenance.environment_steps for each in trained]
    return {
        "policy": name,
        "problem": members[0].problem.name,
        "success": [float(hits.mean()), *(share_over_seeds(hits).ci95 or ())],
        **{figure: METRICS[figure].formula(outcomes) for figure in FIGURES},
        "seeds": {
            each.contestant.name: [
                float(each.rollouts.success.mean()),
                METRICS["step_ratio"].formula(outcomes_of([each])),
            ]
            for each in members
        },
        "parameters": policy and sum(each.size for each in policy.networks().parameters),
        "training_steps": int(np.median(steps)) if steps else None,
        "failures": _failures(members),
    }


def _failures(members: Iterable[Evaluation]) -> list[list[Any]]:
    """Causes of failure: how many trials, and a policy and trial to watch."""
    counts: Counter[str] = Counter()
    first: dict[str, tuple[str, int]] = {}
    for each in members:
        ends = (each.rollouts.outcomes, each.rollouts.steps.tolist(), each.contacts)
        for trial, cause in failure_causes(*ends).items():
            counts[str(cause)] += 1
            first.setdefault(str(cause), (each.contestant.name, trial))
    return [[cause, n, *first[cause]] for cause, n in counts.most_common(MOST_CAUSES)]


def scored(files: Sequence[Path], trials: int = TRIALS) -> tuple[list[dict[str, Any]], bool]:
    """Rows of submissions, and whether all could be scored; why one cannot is told in one line.

    Parameters
    ----------
    files, trials : sequence of Path, int
        Files of `SUBMISSIONS`, and how many trials each faces on a problem.
    """
    rows, whole = [], True
    for file in files:
        try:
            with chdir(file.parent):
                rows += Submission.read(Path(file.name)).rows(file.stem, trials)
        except Exception as error:  # a policy may raise anything
            sys.stderr.write(f"{file.name}: {first_line(error)}\n")
            whole = False
    return rows, whole


def main(files: Sequence[Path]) -> None:
    """Score, and write the record; submissions alone if some are named."""
    submitted = sorted(each for each in SUBMISSIONS.iterdir() if each.suffix in (".toml", ".npz"))
    rows, whole = scored(files or submitted)
    if files:
        record = json.loads(RECORD.read_text("utf-8"))
        again = {(row["policy"], row["problem"]) for row in rows}
        kept = [row for row in record["rows"] if (row["policy"], row["problem"]) not in again]
        record["rows"] = [*kept, *rows]
    else:
        shipped = EvaluationRequest(trials=TRIALS, seed=SEED, shield=True).evaluate()
        record = {"trials": TRIALS, "seed": SEED, "rows": [*rows_of(shipped), *rows]}
    write_text(RECORD, json.dumps(record, indent=1) + "\n")
    sys.exit(not whole)


if __name__ == "__main__":
    main([Path(each).resolve() for each in sys.argv[1:]])
