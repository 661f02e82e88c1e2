"""What a study of transfer came to, as one document."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.transfer.reflection import reflection_of, with_mirror
from docs.transfer.study import SOURCE, Training, TransferRun, TransferStudy, targets
from kinarm._fields import to_plain
from kinarm.evaluation.statistics import (
    Estimate,
    share_difference,
    share_over_seeds,
    squared_reach,
    superiority,
)
from kinarm.evaluation.trials import TrialSet, trial_set
from kinarm.policies.mirror import find_mirror, missing_mirror
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import ReachProblem
from kinarm.problem_files import problem_names

LEVELS = (0.5, 0.8, 0.9)
"""Shares of success by which the speed of learning is told."""

Runs = Mapping[Training, TransferRun]


def transfer_document(study: TransferStudy, runs: Runs, command: str) -> dict[str, Any]:
    """Settings and results, as a dictionary that JSON can hold.

    Parameters
    ----------
    study : TransferStudy
        What was planned.
    runs : mapping of Training to TransferRun
        What all of its trainings came to.
    command : str
        What made it, for the record.

    Returns
    -------
    dict
        ``zero_shot``: policies of the first task on the others, as they are and reflected;
        ``warm_start``: trainings that begin with them, beside those from scratch; ``reflection``:
        mirrored trials; ``curves``: success in the course of the trainings.
    """
    results = TransferResults(study, runs)
    return {
        "command": command,
        "source": SOURCE.name,
        "learners": list(study.learners),
        "seeds": study.seeds,
        "lengths": list(study.lengths),
        "settings": to_plain(study.settings),
        "protocol": asdict(study.protocol),
        "trainings": len(runs),
        "environment_steps": sum(run.looks[-1].environment_steps for run in runs.values()),
        "zero_shot": list(results.zero_shot()),
        "warm_start": list(results.warm_start()),
        "reflection": list(results.reflection()),
        "curves": list(results.curves()),
        "commit": source_commit(),
        "versions": package_versions(),
    }


class TransferResults:
    """Finished trainings of a study, and what their policies do.

    Parameters
    ----------
    study : TransferStudy
        What was planned.
    runs : mapping of Training to TransferRun
        What all of its trainings came to.
    """

    def __init__(self, study: TransferStudy, runs: Runs) -> None:
        self._study, self._runs, self._protocol = study, runs, study.protocol

    def group(
        self, learner: str, role: str, problem: ReachProblem, length: float
    ) -> list[TransferRun]:
        """The training seeds of one kind."""
        return [
            run
            for training, run in self._runs.items()
            if (training.learner, training.role) == (learner, role)
            and (training.problem, training.length) == (problem, length)
        ]

    def zero_shot(self) -> Iterator[dict[str, Any]]:
        """Policies of the first task on every task, as they are and with a mirror.

        Differences are those to policies that were trained for the task from scratch, in trainings
        of the greatest length.
        """
        longest = max(self._study.lengths)
        for learner in self._study.learners:
            source = [run.policy for run in self.group(learner, "source", SOURCE, 1.0)]
            for problem in (SOURCE, *targets()):
                scratch = self.group(learner, "scratch", problem, longest)
                own = self._outcomes(problem, [run.policy for run in scratch]) if scratch else None
                for way in ("as it is", "reflected"):
                    policies = source
                    if way == "reflected":
                        mirror = find_mirror(self._trials(problem).simulator.world)
                        policies = [with_mirror(policy, mirror) for policy in source]
                    success, collision = self._outcomes(problem, policies)
                    yield {
                        "learner": learner,
                        "problem": problem.name,
                        "way": way,
                        "success": share_over_seeds(success).to_json(),
                        "success_each": success.mean(axis=1).tolist(),
                        "collision": share_over_seeds(collision).to_json(),
                        "from_scratch": own and share_over_seeds(own[0]).to_json(),
                        "difference": own and share_difference(success, own[0]).to_json(),
                    }

    def warm_start(self) -> Iterator[dict[str, Any]]:
        """Trainings that begin with a policy of the first task, beside those from scratch."""
        for learner in self._study.learners:
            for problem in targets():
                for length in self._study.lengths:
                    warm = self.group(learner, "warm", problem, length)
                    scratch = self.group(learner, "scratch", problem, length)
                    ends = [
                        self._outcomes(problem, [run.policy for run in runs])[0]
                        for runs in (warm, scratch)
                    ]
                    yield {
                        "learner": learner,
                        "problem": problem.name,
                        "length": length,
                        "iterations": warm[0].looks[-1].iteration,
                        "warm": share_over_seeds(ends[0]).to_json(),
                        "scratch": share_over_seeds(ends[1]).to_json(),
                        "difference": share_difference(*ends).to_json(),
                        "until": [self._until(level, warm, scratch) for level in LEVELS],
                    }

    def _until(
        self, level: float, warm: Sequence[TransferRun], scratch: Sequence[TransferRun]
    ) -> dict[str, Any]:
        """How long trainings take until a share of trials first succeeds."""
        looks = [[run.first_look(level) for run in runs] for runs in (warm, scratch)]
        steps = [
            np.array([look.environment_steps if look else math.inf for look in each])
            for each in looks
        ]
        return {
            "success": level,
            **{
                role: {
                    quantity: [look and getattr(look, quantity) for look in each]
                    for quantity in ("iteration", "environment_steps")
                }
                for role, each in zip(("warm", "scratch"), looks, strict=True)
            },
            "ratio": ratio_of_means(*steps).to_json(),
            "warm_is_faster": superiority([(steps[0][None], steps[1][None])]).to_json(),
        }

    def reflection(self) -> Iterator[dict[str, Any]]:
        """Mirrored trials of all shipped problems of the arm that have a mirror, and another's."""
        problems = [ReachProblem.load(name) for name in problem_names()]
        shipped = [
            problem
            for problem in problems
            if problem.arm.name == SOURCE.arm.name
            and problem.observation == SOURCE.observation
            and not missing_mirror(problem)
        ]
        for learner in self._study.learners:
            for problem in (*shipped, targets()[-1]):
                trials = trial_set(problem, self._protocol.look_trials, self._protocol.look_seed)
                rows = [
                    reflection_of(run.policy, trials)
                    for run in self.group(learner, "source", SOURCE, 1.0)
                ]
                yield {
                    "learner": learner,
                    "problem": problem.name,
                    "trials": sum(row["trials"] for row in rows),
                    "deviation": max(row["deviation"] for row in rows),
                    "differing": sum(row["differing"] for row in rows),
                }

    def curves(self) -> Iterator[dict[str, Any]]:
        """Success in the course of each training."""
        for training, run in self._runs.items():
            yield {
                "learner": training.learner,
                "role": training.role,
                "problem": training.problem.name,
                "length": training.length,
                "seed": training.seed,
                "iteration": [look.iteration for look in run.looks],
                "environment_steps": [look.environment_steps for look in run.looks],
                "success": [look.success for look in run.looks],
            }

    def _trials(self, problem: ReachProblem) -> TrialSet:
        """What trained policies face."""
        return trial_set(problem, self._protocol.trials, self._protocol.seed)

    def _outcomes(
        self, problem: ReachProblem, policies: Sequence[Policy]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Trials with success, and with contact, shape (n_policies, n_trials) each."""
        trials = self._trials(problem)
        done = [trials.simulator.rollout(each, trials.starts, trials.goals) for each in policies]
        return np.array([each.success for each in done]), np.array(
            [each.collision for each in done]
        )


def ratio_of_means(first: NDArray[np.float64], second: NDArray[np.float64]) -> Estimate:
    """Ratio of geometric means of independent numbers, and its 95 % interval.

    The interval is Student's for the difference of mean logarithms, with the degrees of freedom
    of Welch and Satterthwaite. There is no ratio where a number is zero or infinite.
    """
    logarithms = [np.log(each) for each in (first, second) if (each > 0).all()]
    if len(logarithms) < 2 or not all(np.isfinite(each).all() for each in logarithms):
        return Estimate(None)
    value = float(logarithms[0].mean() - logarithms[1].mean())
    if min(map(len, logarithms)) < 2:
        return Estimate(math.exp(value))
    reach = math.sqrt(squared_reach(*logarithms))
    return Estimate(math.exp(value), (math.exp(value - reach), math.exp(value + reach)))
