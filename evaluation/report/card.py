"""The card of a policy, to publish beside its file."""

from collections.abc import Sequence
from pathlib import Path

from kinarm._files import check_output, write_text
from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.report.templating import template_environment
from kinarm.problem import ReachProblem
from kinarm.viewer import replay_page

FIRST, WORST = 3, 3
"""Trials of the replay: the first, and the worst."""


def check_card(
    path: Path, pairs: Sequence[tuple[Contestant, ReachProblem]], *, overwrite: bool = False
) -> None:
    """Check that there is one policy for a card, and that its files can be written.

    Parameters
    ----------
    path : Path
        The card.
    pairs : sequence of (Contestant, ReachProblem)
        Who faces what.
    overwrite : bool
        Whether files may be replaced.
    """
    faced = [(contestant, problem) for contestant, problem in pairs if contestant is not ORACLE]
    if len(faced) != 1 or faced[0][0].policy is None:
        named = [f"{contestant.name} on {problem.name}" for contestant, problem in faced]
        more = f" and {len(named) - 3} more" if len(named) > 3 else ""
        raise InvalidInputError(
            "a card is of one trained policy on one problem: choose it with --policy and "
            f"--problem, got {', '.join(named[:3]) or ORACLE.name}{more}"
        )
    check_output(path, overwrite=overwrite, suffix=".md")
    check_output(path.with_suffix(".html"), overwrite=overwrite)
    own = path.with_suffix(".npz")
    if faced[0][0].source != own.resolve():
        check_output(own, overwrite=overwrite)


def write_card(path: Path, document: EvaluationDocument, evaluations: Sequence[Evaluation]) -> None:
    """Write a card, with the policy and a replay beside it.

    Parameters
    ----------
    path : Path
        The card, in Markdown; its name ends in .md.
    document : EvaluationDocument
        The document of the evaluations.
    evaluations : sequence of Evaluation
        Those of the policy, and of the oracle if it took part.
    """
    (evaluation,) = (each for each in evaluations if each.contestant is not ORACLE)
    write_text(path, policy_card(path.stem, document, evaluation))
    contestant, own = evaluation.contestant, path.with_suffix(".npz")
    if contestant.policy and contestant.source != own.resolve():
        contestant.policy.save(own)
    bounds, trials = evaluation.bounds, shown_trials(evaluation)
    shown = record(contestant, evaluation.trials, trials, bounds=bounds, allow_other_arm=True)
    replay_page(shown).save(path.with_suffix(".html"))


def policy_card(name: str, document: EvaluationDocument, evaluation: Evaluation) -> str:
    """The card of a policy, in Markdown; equal input gives equal text.

    Parameters
    ----------
    name : str
        Name of its files, without the suffix.
    document : EvaluationDocument
        The document of the evaluation.
    evaluation : Evaluation
        That of the policy.
    """
    contestant, policy = evaluation.contestant, evaluation.contestant.policy
    if policy is None:
        raise InvalidInputError(f"a card is of a trained policy, got {contestant.name!r}")
    rows = {row.policy: row for row in document.results}
    template = template_environment(keep_trailing_newline=True).get_template("card.md")
    return template.render(
        name=name,
        policy=policy,
        made=policy.provenance,
        problem=evaluation.problem.pinned,
        metrics=METRICS,
        row=rows[contestant.name],
        oracle=rows.get(ORACLE.name),
        entry=document.faced(evaluation.problem.name),
        protocol=document.protocol,
        shown=shown_trials(evaluation),
        first=min(FIRST, len(evaluation.trials)),
    )


def shown_trials(evaluation: Evaluation) -> list[int]:
    """The first trials, then the worst others, failures first."""
    rollouts, count = evaluation.rollouts, len(evaluation.trials)
    others = range(min(FIRST, count), count)
    ranked = sorted(others, key=lambda n: (bool(rollouts.success[n]), -rollouts.distance[n]))
    return [*range(min(FIRST, count)), *ranked[:WORST]]
