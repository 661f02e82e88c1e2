"""An evaluation, from the request to the files."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._files import absolute, check_output, only_writer, write_text
from kinarm._tables import TableOptions
from kinarm.errors import FROM_ZERO, TRIALS, InvalidInputError
from kinarm.problem_files import problem_names
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.evaluation.document import EvaluationDocument
    from kinarm.evaluation.evaluation import Evaluation
    from kinarm.evaluation.selection import Pair

DOCUMENT, REPORT = "evaluation.json", "index.html"
"""Files that are written."""

Tell = Callable[[str], object]
"""Called with what is being done."""


@dataclass(frozen=True, kw_only=True)
class EvaluationRequest(ProblemOptions, TableOptions):
    """Evaluate policies on random reaching trials, beside an oracle.

    By default a trained policy faces the problem that it was trained for,
    changed as the options say, a symmetric one also those with a part of its
    goals, and a baseline all problems in play. Problems that are named restrict
    the default selection; together with named policies, or ``matrix``, they say
    what those face. The oracle joins on every problem that is faced.

    Parameters
    ----------
    policies : tuple of str
        Shipped policy, recipe (all its seeds), random, zero, oracle, .npz file,
        folder of them, Stable-Baselines3's model.zip (runs its code: only if you
        trust it), or module:function; several, and repeatable. The others are
        compared with the first, in the same trials.
    problems : tuple of str
        A problem by name, or a problem file; several, and repeatable.
        ``problem`` is for a single one.
    trials : int
        Trials a problem.
    seed : int
        Seed of the trials.
    vec_normalize : Path
        Statistics of VecNormalize for models of Stable-Baselines3 (runs code),
        or none.
    wrapper : str
        module:function from an environment to a wrapped one, in which policies
        face the trials.
    allow_other_arm : bool
        Allow an arm that a policy was not trained for.
    shield : bool
        Evaluate each policy also behind a shield, which replaces steps that would
        touch something.
    matrix : bool
        Every policy on every problem, not only on its own.
    oracle : bool
        Ask the oracle what any policy could reach: in the first 2000 trials at
        most, unless the oracle is a named policy.
    hold : bool
        Run the trials once more, without ending them at success: how close
        policies come to the goal, and whether they stay there.
    out : Path
        Folder for evaluation.json.
    report : Path
        Folder for the report: index.html, one page.
    json : bool
        Print the JSON document alone on standard output.
    markdown : bool
        Print the table as Markdown.
    overwrite : bool
        Replace earlier results.

    Raises
    ------
    InvalidInputError
        If there is no trial or the seed is negative.
    """

    policies: tuple[str, ...] = field(
        default=(),
        metadata={"flag": "--policy", "bare": True, "metavar": "NAME_OR_FILE"},
    )
    problems: tuple[str, ...] = field(
        default=(),
        metadata={"flag": "--problem", "metavar": "NAME_OR_FILE", "names": problem_names},
    )
    trials: int = field(default=200, metadata=TRIALS)
    seed: int = field(default=0, metadata=FROM_ZERO)
    vec_normalize: Path | None = field(default=None, metadata={"metavar": "FILE|none"})
    wrapper: str | None = field(default=None, metadata={"metavar": "MODULE:FUNCTION"})
    allow_other_arm: bool = False
    matrix: bool = False
    shield: bool = False
    oracle: bool = True
    hold: bool = False
    out: Path | None = field(default=None, metadata={"metavar": "FOLDER"})
    report: Path | None = field(default=None, metadata={"metavar": "FOLDER"})
    json: bool = False
    markdown: bool = False
    overwrite: bool = False

    GROUPS: ClassVar = {
        "what is evaluated": (
            "policies problems vec_normalize wrapper shield matrix allow_other_arm"
        ),
        "trials": "trials seed oracle hold",
        "table": "columns markdown json",
        "output": "out report overwrite",
        "changes to the problems": ProblemOptions.CHANGES.replace("shield ", ""),
    }
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "policies": "those that ship for the paper's tasks and for named problems, random and zero",
        "problems": "what each policy was trained for",
        "columns": "all that fit",
    }
    SHIELDS_POLICIES: ClassVar = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.json and self.markdown:
            raise InvalidInputError("--json and --markdown exclude each other")
        if self.json and self.columns:
            raise InvalidInputError("--columns is for tables, and --json prints the whole document")

    @property
    def files(self) -> list[Path]:
        """Files that are written."""
        places = ((self.out, DOCUMENT), (self.report, REPORT))
        return [folder / name for folder, name in places if folder is not None]

    def run(self, command: str | None = None, tell: Tell = lambda _: None) -> "EvaluationDocument":
        """Evaluate, and write the outputs.

        ``command`` is recorded, by default this request; ``tell`` hears what is being done.
        """
        from kinarm.evaluation.summary import evaluation_document

        pairs = self._checked_pairs()
        with ExitStack() as locks:
            for folder in {absolute(path.parent) for path in self.files}:
                locks.enter_context(only_writer(folder))
            evaluations = self._face(pairs, tell)
            document = evaluation_document(
                evaluations, command or repr(self), next(iter(self.policies), "")
            )
            if self.out is not None:
                write_text(self.out / DOCUMENT, json.dumps(document.to_json(), indent=1) + "\n")
            if self.report is not None:
                from kinarm.evaluation.report.page import write_report

                tell("writing the report")
                write_report(self.report, document, evaluations)
        return document

    def evaluate(self, tell: Tell = lambda _: None) -> "list[Evaluation]":
        """Let every chosen policy face its trials; as `run`, without the files."""
        return self._face(self._checked_pairs(), tell)

    def _face(self, pairs: "list[Pair]", tell: Tell) -> "list[Evaluation]":
        """Run all policies on their trials, problem by problem."""
        from kinarm.evaluation.bounds import MOST_BOUNDED, oracle_bounds
        from kinarm.evaluation.contestants import ORACLE
        from kinarm.evaluation.evaluation import run_trials
        from kinarm.evaluation.trials import TrialSet

        named = ORACLE.name in self.policies
        problems = {problem.name: problem for _, problem in pairs}
        evaluations: list[Evaluation] = []
        say_choices(problems.values())
        for name, problem in problems.items():
            trials = TrialSet.draw(problem, self.trials, self.seed)
            bounded = trials if named else trials.first(MOST_BOUNDED)
            solving = f"what could any policy reach on {name}? {{}} of {{}} trials solved"
            bounds = None
            if self.oracle or named:
                bounds = oracle_bounds(
                    bounded, lambda *counts, text=solving: tell(text.format(*counts))
                )
            tell(f"evaluating on {name}")
            evaluations += [
                run_trials(
                    contestant,
                    bounded if contestant is ORACLE else trials,
                    bounds=bounds if self.oracle else None,
                    hold=self.hold,
                )
                for contestant, faced in pairs
                if faced.name == name
            ]
        return evaluations

    def _checked_pairs(self) -> "list[Pair]":
        """Who faces which problem, after checks of policies and files."""
        from kinarm.evaluation.selection import select_pairs

        if self.columns:
            from kinarm.evaluation.table import all_columns

            self.chosen(all_columns())
        pairs = select_pairs(self)
        arms = {problem: problem.load_arm() for problem in {faced for _, faced in pairs}}
        for contestant, problem in pairs:
            contestant.check(problem, arms[problem], allow_other_arm=self.allow_other_arm)
        for path in self.files:
            check_output(path, overwrite=self.overwrite)
        return pairs
