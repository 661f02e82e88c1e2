"""What an evaluation is asked for."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from kinarm._files import absolute, check_output, only_writer, write_text
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.errors import InvalidInputError
from kinarm.evaluation.choices import policy_choices
from kinarm.problem_files import problem_names
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.evaluation.contestants import Contestant
    from kinarm.evaluation.evaluation import Evaluation
    from kinarm.problem import ReachProblem

DOCUMENT, HISTOGRAMS, REPORT = "evaluation.json", "final_distance", "index.html"
"""Files that are written; the histograms as PNG and as SVG."""

Pair = tuple["Contestant", "ReachProblem"]
"""Who faces what."""

Chosen = tuple["Contestant", tuple["ReachProblem", ...]]
"""Who takes part, and the problems that it is the best for if it was chosen as that."""

Tell = Callable[[str], object]
"""Is told what is being done."""


@dataclass(frozen=True, kw_only=True)
class EvaluationRequest(ProblemOptions):
    """Evaluate policies on random reaching trials, beside an oracle.

    By default a trained policy faces the problem that it was trained for, changed as the options
    say, a symmetric one also those with a part of its goals, and a baseline all problems in play.
    Problems that are named restrict the default selection; together with named policies, or
    ``matrix``, they say what those face. The oracle joins on every problem that is faced.

    Parameters
    ----------
    policies : tuple of str
        Shipped policy, recipe (all its seeds), best, random, zero, oracle, .npz file, folder of
        them, Stable-Baselines3's model.zip (runs its code: only if you trust it), or
        module:function; several, and repeatable.
    problems : tuple of str
        A problem by name, or a problem file; several, and repeatable. ``problem`` is for a single
        one.
    trials : int
        Trials a problem.
    seed : int
        Seed of the trials.
    allow_other_arm : bool
        Allow an arm that a policy was not trained for.
    matrix : bool
        Every policy on every problem, not only on its own.
    oracle : bool
        Ask the oracle what any policy could reach: in the first 2000 trials at most, unless the
        oracle is a named policy.
    hold : bool
        Run the trials once more, without ending them at success: how close policies come to the
        goal, and whether they stay there.
    out : Path
        Folder for evaluation.json and histograms.
    report : Path
        Folder for the report: index.html, one page.
    card : Path
        Card of the one policy that is named (.md), with the policy (.npz) and a replay (.html).
    overwrite : bool
        Replace earlier results.
    json : bool
        Print the JSON document alone on standard output.
    markdown : bool
        Print the table as Markdown.

    Raises
    ------
    InvalidInputError
        If there is no trial or the seed is negative.
    """

    policies: tuple[str, ...] = field(
        default=(),
        metadata={
            "flag": "--policy",
            "metavar": "NAME_OR_FILE",
            "several": True,
            "completes": policy_choices,
        },
    )
    problems: tuple[str, ...] = field(
        default=(),
        metadata={
            "flag": "--problem",
            "metavar": "NAME_OR_FILE",
            "several": True,
            "names": problem_names,
        },
    )
    trials: int = 200
    seed: int = 0
    allow_other_arm: bool = False
    matrix: bool = False
    oracle: bool = True
    hold: bool = False
    out: Path | None = field(default=None, metadata={"metavar": "FOLDER"})
    report: Path | None = field(default=None, metadata={"metavar": "FOLDER"})
    card: Path | None = None
    overwrite: bool = False
    json: bool = False
    markdown: bool = False

    GROUPS: ClassVar = {
        "what is evaluated": ("policies", "problems", "matrix", "allow_other_arm"),
        "trials": ("trials", "seed", "oracle", "hold"),
        "output": ("out", "report", "card", "overwrite", "json", "markdown"),
        "changes to the problems": ProblemOptions.GROUPS["problem"][1:],
    }
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "policies": "all shipped policies, random and zero",
        "problems": "what each policy was trained for",
    }

    def __post_init__(self) -> None:
        whole_number("trials", self.trials, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)
        if self.json and self.markdown:
            raise InvalidInputError("--json and --markdown exclude each other")

    def run(self, command: str | None = None, tell: Tell = lambda _: None) -> dict[str, Any]:
        """Evaluate, and write the outputs.

        Parameters
        ----------
        command : str, optional
            What to record as the command that did it; this request if it is left out.
        tell : callable
            Called with what is being done.

        Returns
        -------
        dict
            The document; see `kinarm.evaluation.evaluation_document`.

        Raises
        ------
        KinarmError
            If a name, file or number cannot be used, or a file cannot be written.
        """
        from kinarm.evaluation.document import evaluation_document

        pairs = self._checked_pairs()
        with ExitStack() as locks:
            for folder in {absolute(each) for each in (self.out, self.report) if each}:
                locks.enter_context(only_writer(folder))
            evaluations = self._face(pairs, tell)
            document = evaluation_document(evaluations, repr(self) if command is None else command)
            self._write(document, evaluations, tell)
        return document

    def _write(self, document: dict[str, Any], evaluations: "list[Evaluation]", tell: Tell) -> None:
        """Write the outputs."""
        if self.report is not None:
            from kinarm.evaluation.report.page import write_report

            tell("writing the report")
            write_report(self.report, document, evaluations)
        if self.card is not None:
            from kinarm.evaluation.report.card import write_card

            tell("writing the card")
            write_card(self.card, document, evaluations)
        if self.out is not None:
            from kinarm.evaluation.document import document_text
            from kinarm.evaluation.figures import distance_histograms, save_figure

            write_text(self.out / DOCUMENT, document_text(document))
            shown = [e for e in evaluations if e.contestant.algorithm != "oracle"] or evaluations
            save_figure(distance_histograms(shown), self.out, HISTOGRAMS)

    def evaluate(self, tell: Tell = lambda _: None) -> "list[Evaluation]":
        """Let every chosen policy face its trials; as `run`, but for the files."""
        return self._face(self._checked_pairs(), tell)

    def _checked_pairs(self) -> list[Pair]:
        """Who faces which problem, if all of them can and the files can be written."""
        pairs = self.pairs()
        problems = {problem.name: problem for _, problem in pairs}
        arms = {name: problem.load_arm() for name, problem in problems.items()}
        for contestant, problem in pairs:
            contestant.check(arms[problem.name], allow_other_arm=self.allow_other_arm)
        self._check_outputs(pairs)
        return pairs

    def _face(self, pairs: list[Pair], tell: Tell) -> "list[Evaluation]":
        """Run all policies on their trials, problem by problem."""
        from kinarm.evaluation.bounds import bounded_trials, oracle_bounds
        from kinarm.evaluation.contestants import ORACLE
        from kinarm.evaluation.evaluation import run_trials
        from kinarm.evaluation.trials import TrialSet

        problems = {problem.name: problem for _, problem in pairs}
        evaluations: list[Evaluation] = []
        say_choices(problems.values())
        for name, problem in problems.items():
            trials = TrialSet.draw(problem, self.trials, self.seed)
            bounded = trials if ORACLE.name in self.policies else bounded_trials(trials)
            if self.oracle or ORACLE.name in self.policies:
                oracle_bounds(bounded, partial(_tell_bounds, tell, name))
            tell(f"evaluating on {name}")
            evaluations += [
                run_trials(
                    contestant,
                    bounded if contestant is ORACLE else trials,
                    self.allow_other_arm,
                    oracle=self.oracle,
                    hold=self.hold,
                )
                for contestant, faced in pairs
                if faced.name == name
            ]
        return evaluations

    def pairs(self) -> list[Pair]:
        """Decide who faces which problem.

        Raises
        ------
        KinarmError
            If a name or file cannot be used, there is nothing to do, or two policies or problems
            have one name.
        """
        from kinarm.evaluation.contestants import ORACLE, check_names

        chosen, named = self._chosen(), self._named_problems()
        contestants = [contestant for contestant, _ in chosen]
        pairs = [
            (contestant, problem)
            for problem in named or self._problems_of(chosen)
            for contestant, best_for in chosen
            if self.matrix or self._faces(contestant, best_for, problem, named)
        ]
        if self.oracle and ORACLE not in contestants:
            faced = {problem.digest: problem for _, problem in pairs}
            pairs += [(ORACLE, problem) for problem in faced.values()]
        check_names(pairs)
        return pairs

    def _faces(
        self,
        contestant: "Contestant",
        best_for: "Sequence[ReachProblem]",
        problem: "ReachProblem",
        named: "Sequence[ReachProblem]",
    ) -> bool:
        """Whether an contestant faces a problem, where not all face all."""
        if best_for:
            return problem.digest in {each.digest for each in best_for}
        return bool(self.policies and named) or contestant.serves(problem, self._changed)

    def _chosen(self) -> list[Chosen]:
        """Contestants that are named, without repetition; or all whose arm stays the same."""
        from kinarm.evaluation.contestants import find_contestants, shipped_contestants
        from kinarm.evaluation.training_seeds import named_apart
        from kinarm.policies.library import BEST
        from kinarm.problem import PROBLEMS

        if not self.policies:
            return [
                (contestant, ())
                for contestant in shipped_contestants()
                if contestant.problem is None
                or self._changed(contestant.problem).arm_digest == contestant.problem.arm_digest
            ]
        problems = self._named_problems()
        only = problems[0] if len(problems) == 1 else None
        found: dict[tuple[str, Path | None], Chosen] = {}
        for name in self.policies:
            if name != BEST:
                for contestant in find_contestants(name, only):
                    found[contestant.name, contestant.source] = (contestant, ())
                continue
            for best_for in problems or map(self._changed, PROBLEMS.values()):
                (contestant,) = find_contestants(BEST, best_for)
                key = (contestant.name, contestant.source)
                _, others = found.get(key, (contestant, ()))
                found[key] = (contestant, (*others, best_for))
        contestants = named_apart([contestant for contestant, _ in found.values()])
        return list(zip(contestants, (best_for for _, best_for in found.values()), strict=True))

    def _named_problems(self) -> "list[ReachProblem]":
        names = (self.problem, *self.problems) if self.problem else self.problems
        if not names and self.task is not None:
            return [self.resolve()]
        problems = (replace(self, problem=name).resolve() for name in names)
        return list({problem.digest: problem for problem in problems}.values())

    def _problems_of(self, chosen: Sequence[Chosen]) -> "list[ReachProblem]":
        """Problems that contestants were trained or chosen for, or all; the paper's come first."""
        from kinarm.problem import PROBLEMS

        trained = [
            self._changed(contestant.problem)
            for contestant, best_for in chosen
            if contestant.problem is not None and not best_for
        ]
        best = [problem for _, best_for in chosen for problem in best_for]
        own = {problem.digest: problem for problem in (*trained, *best)}
        shipped = {problem.digest: problem for problem in map(self._changed, PROBLEMS.values())}
        if self.matrix or not own:
            return list((shipped | own).values())
        return [own.pop(digest) for digest in shipped if digest in own] + list(own.values())

    def _changed(self, problem: "ReachProblem") -> "ReachProblem":
        """A problem with the changes that the options make of any."""
        return replace(self, problem=None, task=None).resolve(problem)

    def _check_outputs(self, pairs: Sequence[Pair]) -> None:
        """Check that the files can be written, and that there is one policy for a card."""
        if self.card is not None:
            from kinarm.evaluation.report.card import check_card

            check_card(self.card, pairs, overwrite=self.overwrite)
        if self.report is not None:
            check_output(self.report / REPORT, overwrite=self.overwrite)
        if self.out is not None:
            for name in (DOCUMENT, f"{HISTOGRAMS}.png", f"{HISTOGRAMS}.svg"):
                check_output(self.out / name, overwrite=self.overwrite)


def _tell_bounds(tell: Tell, problem: str, done: int, total: int) -> None:
    """Say how far the oracle is."""
    tell(f"what could any policy reach on {problem}? {done} of {total} trials solved")
