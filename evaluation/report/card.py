"""The card of a policy: what one publishes beside its file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from kinarm._files import check_output, write_text
from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.document import EvaluationDocument, Result
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.metrics import METRICS, Metric
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.statistics import Estimate
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import Provenance
from kinarm.problem import ReachProblem
from kinarm.viewer import replay_page

FIRST, WORST = 3, 3
"""Trials of the replay: the first ones, and those that ended worst."""


class FigureRow(NamedTuple):
    """A figure of merit: its meaning, the policy's, and the oracle's if it is known."""

    meaning: str
    policy: str
    oracle: str


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

    Raises
    ------
    InvalidInputError
        If there are several, it faces several problems, or it has no file.
    OutputError
        If a file exists, or cannot be written.
    """
    faced = [(contestant, problem) for contestant, problem in pairs if contestant is not ORACLE]
    if len(faced) != 1 or faced[0][0].policy is None:
        named = [f"{contestant.name} on {problem.name}" for contestant, problem in faced] or [
            "oracle"
        ]
        more = f" and {len(named) - 3} more" if len(named) > 3 else ""
        raise InvalidInputError(
            "a card is of one trained policy on one problem: choose it with --policy and "
            f"--problem, got {', '.join(named[:3])}{more}"
        )
    check_output(path, overwrite=overwrite, suffix=".md")
    check_output(path.with_suffix(".html"), overwrite=overwrite)
    own = path.with_suffix(".npz")
    if faced[0][0].source != own.resolve():
        check_output(own, overwrite=overwrite)


def write_card(path: Path, document: EvaluationDocument, evaluations: Sequence[Evaluation]) -> None:
    """Write a card, and the policy and a replay beside it, with the same name.

    Parameters
    ----------
    path : Path
        The card, in Markdown; its name ends in .md.
    document : EvaluationDocument
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        Those of the policy, and of the oracle if it took part.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    (evaluation,) = (each for each in evaluations if each.contestant is not ORACLE)
    write_text(path, policy_card(path.stem, document, evaluation))
    own = path.with_suffix(".npz")
    if evaluation.contestant.source != own.resolve():
        _policy_of(evaluation).save(own)
    options: dict[str, Any] = {"bounds": evaluation.bounds, "allow_other_arm": True}
    shown = record(evaluation.contestant, evaluation.trials, shown_trials(evaluation), **options)
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

    Raises
    ------
    InvalidInputError
        If what was evaluated is no trained policy.
    """
    policy = _policy_of(evaluation)
    rows = {row.policy: row for row in document.results}
    oracle = rows.get(ORACLE.name)
    template = template_environment(keep_trailing_newline=True).get_template("card.md")
    return template.render(
        name=name,
        policy=policy,
        origin=_origin(policy.provenance),
        network=_network(policy),
        settings=_settings(policy.provenance.config),
        problem=evaluation.problem.pinned,
        rows=figure_rows(rows[evaluation.contestant.name], oracle),
        has_oracle=oracle is not None,
        entry=document.faced(evaluation.problem.name),
        protocol=document.protocol,
        shown=shown_trials(evaluation),
        first=min(FIRST, len(evaluation.trials)),
    )


def figure_rows(row: Result, oracle: Result | None) -> list[FigureRow]:
    """Figures of merit that tables show, with their intervals."""
    return [
        FigureRow(metric.meaning, _figure(name, metric, row), _figure(name, metric, oracle))
        for name, metric in METRICS.items()
        if metric.heading and row.metrics[name].value is not None
    ]


def shown_trials(evaluation: Evaluation) -> list[int]:
    """Trials of the replay: the first, then the worst of the others, failures first."""
    rollouts, count = evaluation.rollouts, len(evaluation.trials)
    others = range(min(FIRST, count), count)
    ranked = sorted(others, key=lambda n: (bool(rollouts.success[n]), -rollouts.distance[n]))
    return [*range(min(FIRST, count)), *ranked[:WORST]]


def _policy_of(evaluation: Evaluation) -> Policy:
    """The trained policy that was evaluated."""
    contestant = evaluation.contestant
    if contestant.policy is None:
        raise InvalidInputError(f"a card is of a trained policy, got {contestant.name!r}")
    return contestant.policy


def _settings(config: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Settings of a training, those within others by both names."""
    lines: list[tuple[str, str]] = []
    for name, value in config.items():
        if isinstance(value, Mapping):
            lines += _settings(value, f"{prefix}{name}.")
        else:
            shown = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
            lines.append((f"{prefix}{name}", shown))
    return lines


def _figure(name: str, metric: Metric, row: Result | None) -> str:
    """A figure with its unit and, in brackets, its interval; empty if there is none."""
    estimate = row.metrics[name] if row else Estimate(None)
    if estimate.value is None:
        return ""
    unit = f" {metric.unit}" if metric.unit else ""
    interval = f" ({metric.write_range(*estimate.ci95)})" if estimate.ci95 else ""
    return f"{metric.write(estimate.value)}{unit}{interval}"


def _origin(made: Provenance) -> list[tuple[str, str]]:
    """Where a policy comes from, line by line."""
    lines = [("algorithm", made.algorithm), ("recipe", made.recipe)]
    if made.seed is not None:
        lines.append(("seed", str(made.seed)))
    if made.environment_steps:
        lines.append(("environment steps", f"{made.environment_steps:,}"))
    if made.commit:
        lines.append(("commit of kinarm", made.commit))
    if made.semantics is not None:
        lines.append(("semantics of kinarm", made.semantics))
    versions = ", ".join(f"{package} {version}" for package, version in made.versions.items())
    return [*lines, ("versions", versions)] if versions else lines


def _network(policy: Policy) -> str:
    """Widths of a policy's layers and the functions after them."""
    widths = [policy.n_observations, *(len(layer.bias) for layer in policy.layers)]
    return f"layers {'-'.join(map(str, widths))}, functions {', '.join(policy.activations)}"
