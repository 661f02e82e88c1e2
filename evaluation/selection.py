"""Who faces which problem: what is named, or what each policy was trained for."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import BASELINES, ORACLE, Contestant, find_contestants
from kinarm.evaluation.training_seeds import named_apart
from kinarm.policies.library import BEST, group_of, policy_names
from kinarm.problem import PROBLEMS, ReachProblem

if TYPE_CHECKING:
    from kinarm.evaluation.request import EvaluationRequest

Pair = tuple[Contestant, ReachProblem]
"""Who faces what."""


class Chosen(NamedTuple):
    """A contestant, and the problems that it is the best for if it was chosen as that."""

    contestant: Contestant
    best_for: tuple[ReachProblem, ...] = ()


class Selection:
    """Contestants and problems of an evaluation.

    Parameters
    ----------
    request : EvaluationRequest
        What is asked for.

    Raises
    ------
    KinarmError
        If a name or file cannot be used.
    """

    def __init__(self, request: "EvaluationRequest") -> None:
        self._request = request
        self._chosen = self._named_contestants() if request.policies else self._shipped()

    def pairs(self) -> list[Pair]:
        """Decide who faces which problem; the oracle joins on every one.

        Raises
        ------
        InvalidInputError
            If two policies or problems have one name.
        """
        pairs = [
            (contestant, problem)
            for problem in self._named_problems or self._problems()
            for contestant, best_for in self._chosen
            if self._request.matrix or self._faces(contestant, best_for, problem)
        ]
        if self._request.oracle and all(each.contestant is not ORACLE for each in self._chosen):
            faced = {problem.digest: problem for _, problem in pairs}
            pairs += [(ORACLE, problem) for problem in faced.values()]
        check_names(pairs)
        return pairs

    def _faces(
        self, contestant: Contestant, best_for: Sequence[ReachProblem], problem: ReachProblem
    ) -> bool:
        """Whether a contestant faces a problem, where not all face all."""
        if best_for:
            return problem.digest in {each.digest for each in best_for}
        named = bool(self._request.policies and self._named_problems)
        return named or contestant.serves(problem, self._changed)

    @cached_property
    def _named_problems(self) -> list[ReachProblem]:
        request = self._request
        names = (request.problem, *request.problems) if request.problem else request.problems
        if not names and request.task is not None:
            return [request.resolve()]
        problems = (replace(request, problem=name).resolve() for name in names)
        return list({problem.digest: problem for problem in problems}.values())

    def _changed(self, problem: ReachProblem) -> ReachProblem:
        """A problem with the changes that the options make of any."""
        return replace(self._request, problem=None, task=None).resolve(problem)

    def _shipped(self) -> list[Chosen]:
        """Shipped policies for the arm, and for the problems that are named; then the baselines.

        Their names say what they were trained for: others are not opened.
        """
        serving = {
            name
            for name, problem in PROBLEMS.items()
            if (changed := self._changed(problem)).arm_digest == problem.arm_digest
            and (not self._named_problems or any(map(changed.covers, self._named_problems)))
        }
        shipped = [
            contestant
            for name in policy_names()
            if group_of(name).rpartition("-")[2] in serving
            for contestant in find_contestants(name)
        ]
        return [Chosen(each) for each in (*shipped, *BASELINES.values())]

    def _named_contestants(self) -> list[Chosen]:
        """Contestants that are named, without repetition."""
        named = self._named_problems
        only = named[0] if len(named) == 1 else None
        found: dict[tuple[str, Path | None], Chosen] = {}
        for name in self._request.policies:
            if name != BEST:
                for each in find_contestants(name, only):
                    found[each.name, each.source] = Chosen(each)
                continue
            for problem in named or map(self._changed, PROBLEMS.values()):
                (best,) = find_contestants(BEST, problem)
                before = found.get((best.name, best.source), Chosen(best))
                found[best.name, best.source] = Chosen(best, (*before.best_for, problem))
        contestants = named_apart([each.contestant for each in found.values()])
        best_for = (each.best_for for each in found.values())
        return [Chosen(*each) for each in zip(contestants, best_for, strict=True)]

    def _problems(self) -> list[ReachProblem]:
        """Problems that contestants were trained or chosen for, or all; the paper's come first."""
        trained = [
            self._changed(contestant.problem)
            for contestant, best_for in self._chosen
            if contestant.problem is not None and not best_for
        ]
        best = [problem for each in self._chosen for problem in each.best_for]
        own = {problem.digest: problem for problem in (*trained, *best)}
        shipped = {problem.digest: problem for problem in map(self._changed, PROBLEMS.values())}
        if self._request.matrix or not own:
            return list((shipped | own).values())
        return [own.pop(digest) for digest in shipped if digest in own] + list(own.values())


def check_names(pairs: Iterable[Pair]) -> None:
    """Check that contestants, and the problems that they face, have distinct names.

    Raises
    ------
    InvalidInputError
        If two of them have not.
    """
    contestants: dict[str, Contestant] = {}
    problems: dict[str, ReachProblem] = {}
    faced = set()
    for contestant, problem in pairs:
        difference = problems.setdefault(problem.name, problem).first_difference(problem)
        if difference is not None:
            raise InvalidInputError(
                f"two problems are called {problem.name!r}: in the second, {difference}"
            )
        first = contestants.setdefault(contestant.name, contestant)
        if first.source != contestant.source or (contestant.name, problem.name) in faced:
            sources = (each.source or "the one that needs no file" for each in (first, contestant))
            raise InvalidInputError(
                f"two policies are called {contestant.name!r}: {' and '.join(map(str, sources))}; "
                "rename a file"
            )
        faced.add((contestant.name, problem.name))
