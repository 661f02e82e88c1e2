"""Sum up evaluations: training seeds to pool, differences, and the document of all."""

from collections.abc import Hashable, Iterator, Sequence

from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.document import (
    Difference,
    EvaluationDocument,
    FacedProblem,
    Intervals,
    Protocol,
)
from kinarm.evaluation.evaluation import Evaluation, Faced, PooledEvaluation
from kinarm.evaluation.finding import is_called
from kinarm.evaluation.selection import check_names, group_names, training_of
from kinarm.policies.provenance import package_versions, source_commit


def pool(evaluations: Sequence[Evaluation]) -> tuple[PooledEvaluation, ...]:
    """Pool the training seeds of each recipe that faced the same trials.

    Groups are those of ``kinarm.evaluation.selection.group_names``.
    """
    names = group_names(evaluation.contestant for evaluation in evaluations)
    groups: dict[Hashable, list[Evaluation]] = {}
    for each in evaluations:
        training = names[each.name], training_of(each.contestant)
        groups.setdefault((*training, each.problem.digest, each.trials.digest), []).append(each)
    several = (members for members in groups.values() if len(members) > 1)
    return tuple(PooledEvaluation(names[each[0].name], tuple(each)) for each in several)


def _differences(rows: Sequence[Faced], reference: str) -> Iterator[Difference]:
    """What policies have less the first of their problem that a name stands for."""
    references: dict[str, Faced] = {}
    for row in rows:
        if any(is_called(member.contestant, reference) for member in row.members):
            references.setdefault(row.problem.digest, row)
    for row in sorted(rows, key=lambda row: -(row.metrics["success"].value or 0.0)):
        other = references.get(row.problem.digest, row)
        if other is not row and row.members[0].contestant is not ORACLE:
            yield Difference(
                policy=row.name,
                reference=other.name,
                problem=row.problem.name,
                metrics=row.difference(other),
            )


def evaluation_document(
    evaluations: Sequence[Evaluation], command: str, reference: str = ""
) -> EvaluationDocument:
    """Everything about an evaluation, to write and read again.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        One trial set per problem; policies and problems have distinct names.
    command : str
        The command that made them.
    reference : str
        Name or file of what others are compared with, if any.
    """
    check_names((each.contestant, each.problem) for each in evaluations)
    any_set = evaluations[0].trials
    facing: dict[str, Evaluation] = {}
    for each in evaluations:
        facing.setdefault(each.problem.name, each)
    protocol = Protocol(
        command=command,
        trials=len(any_set),
        seed=any_set.seed,
        hold=any(each.holding is not None for each in evaluations),
        intervals=Intervals(),
        problems={n: FacedProblem.of(each.trials, each.bounds) for n, each in facing.items()},
        versions=package_versions(),
        commit=source_commit(),
    )
    pooled = pool(evaluations)
    members = {member for group in pooled for member in group.members}
    rows: list[Faced] = [*pooled, *(each for each in evaluations if each not in members)]
    return EvaluationDocument(
        protocol=protocol,
        results=[each.result for each in evaluations],
        pooled=[each.result for each in pooled],
        differences=list(_differences(rows, reference)) if reference else [],
    )
