"""The document of an evaluation: everything about it, to keep and to face the same trials again."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.evaluation import Evaluation, pool
from kinarm.evaluation.statistics import BOOTSTRAP_SEED, LEVEL, RESAMPLES
from kinarm.evaluation.trials import TrialSet
from kinarm.files import first_line
from kinarm.policies.library import group_of
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.recording import Recording
from kinarm.simulator import Simulator
from kinarm.task import load_task
from kinarm.validation import finite_array

FORMAT_VERSION = 2

ENDS = ("outcome", "steps", "final_distance")
"""What has to be the same again."""


def evaluation_document(evaluations: Sequence[Evaluation], command: str) -> dict[str, Any]:
    """Everything about an evaluation, as a dictionary that JSON can hold.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Made with one trial set per task.
    command : str
        The command that made them.

    Returns
    -------
    dict
        ``protocol`` (trials per task with their hash and bounds, arm, versions, commit, command),
        ``results`` (one per policy and task, with the outcome of every trial) and ``pooled``
        (one per recipe and task with several training seeds).
    """
    trial_sets = {e.task: e.trials for e in evaluations}
    bounds = {e.task: bounds_document(e.bounds) for e in evaluations if e.bounds is not None}
    any_set = evaluations[0].trials
    arm = any_set.simulator.arm
    return {
        "protocol": {
            "format_version": FORMAT_VERSION,
            "command": command,
            "trials": len(any_set),
            "seed": any_set.seed,
            "arm": arm.name,
            "arm_digest": arm.digest,
            "intervals": {
                "level": LEVEL,
                "shares": "Wilson",
                "distances": "percentile bootstrap over trials",
                "resamples": RESAMPLES,
                "bootstrap_seed": BOOTSTRAP_SEED,
            },
            "tasks": {
                task: {
                    "trial_set_hash": trials.digest,
                    "tolerance": trials.simulator.task.tolerance,
                    "horizon": trials.simulator.task.horizon,
                    "starts": trials.starts.tolist(),
                    "goals": trials.goals.tolist(),
                    "oracle": bounds.get(task),
                }
                for task, trials in trial_sets.items()
            },
            "versions": package_versions(),
            "commit": source_commit(),
        },
        "results": [evaluation.to_json() for evaluation in evaluations],
        "pooled": [pooled.to_json() for pooled in pool(evaluations)],
    }


@dataclass(frozen=True)
class EvaluationDocument:
    """What a file ``evaluation.json`` holds.

    Attributes
    ----------
    name : str
        Name of the file.
    protocol : dict
        Arm and trials.
    results : list of dict
        One for each policy and task.
    """

    name: str
    protocol: dict[str, Any]
    results: list[dict[str, Any]]

    @classmethod
    def load(cls, path: str | Path) -> "EvaluationDocument":
        """Read a document.

        Raises
        ------
        InvalidInputError
            If the file is missing, damaged, something else, or written by a later version.
        """
        name = str(path)
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            check_fields("it", content, {"protocol": dict, "results": list})
            check_fields("protocol", content["protocol"], {"format_version": int})
            version = content["protocol"]["format_version"]
            if version == FORMAT_VERSION:
                check_document(content)
        except OSError as error:
            raise InvalidInputError(f"cannot read {name!r}: {error.strerror}") from error
        except ValueError as error:
            raise InvalidInputError(
                f"{name!r} is not an evaluation of kinarm-eval: {first_line(error)}"
            ) from error
        if version != FORMAT_VERSION:
            raise InvalidInputError(
                f"{name!r} has format version {version}; this kinarm reads {FORMAT_VERSION}"
            )
        return cls(name, content["protocol"], content["results"])

    def result(self, policy: str | None, task: str | None) -> dict[str, Any]:
        """Find the result of a policy, or of a group's first seed, on a task.

        Raises
        ------
        InvalidInputError
            If there is none, or several that fit.
        """
        fitting = [row for row in self.results if task in (None, row["task"])]
        if policy is None:
            named = [row for row in fitting if row["trained_on"] is not None] or fitting
            if len(named) != 1:
                choices = ", ".join(f"{row['policy']} on {row['task']}" for row in named)
                raise InvalidInputError(
                    f"{self.name!r} holds several results, choose with --policy and --task: "
                    f"{choices or 'none on this task'}"
                )
            return named[0]
        for same in (
            lambda row: row["policy"] == policy,
            lambda row: group_of(row["policy"]) == policy,
        ):
            for row in fitting:
                if same(row):
                    return row
        raise UnknownNameError("policy", policy, dict.fromkeys(row["policy"] for row in fitting))

    def trials(self, task: str, arm: Arm) -> TrialSet:
        """The trials of a task, as they were faced.

        Raises
        ------
        InvalidInputError
            If the arm is another one, or starts and goals do not match their hash.
        """
        protocol, entry = self.protocol, self.protocol["tasks"][task]
        if protocol["arm_digest"] != arm.digest:
            raise InvalidInputError(
                f"{self.name!r} is of arm {protocol['arm']!r} ({protocol['arm_digest']}), "
                f"not of {arm.name!r} ({arm.digest})"
            )
        rules = load_task(task, tolerance=entry["tolerance"], horizon=entry["horizon"])
        starts, goals = np.array(entry["starts"]), np.array(entry["goals"])
        trials = TrialSet(Simulator(arm, rules), protocol["seed"], starts, goals)
        if trials.digest != entry["trial_set_hash"]:
            raise InvalidInputError(
                f"the trials of {task} in {self.name!r} do not match their hash"
            )
        return trials

    def floors(self, task: str) -> list[int] | None:
        """Proven numbers of steps of a task's trials, if the evaluation had them."""
        oracle = self.protocol["tasks"][task]["oracle"]
        return oracle["trials"]["steps_lower_bound"] if oracle else None

    def check_same(self, row: dict[str, Any], recordings: list[Recording]) -> None:
        """See that recordings end as the evaluation says.

        Raises
        ------
        InvalidInputError
            If one does not: policy or simulator have changed since.
        """
        ends = list(zip(*(row["outcomes"][part] for part in ENDS), strict=True))
        for recording in recordings:
            end = (recording.outcome, recording.steps, recording.final_distance)
            if len(ends) != len(recordings) or end != ends[recording.trial]:
                raise InvalidInputError(
                    f"trial {recording.trial} of {recording.policy!r} ends otherwise than in "
                    f"{self.name!r}: the policy or kinarm has changed, evaluate again"
                )


NUMBER, NULL = (int, float), type(None)

PROTOCOL_FIELDS = {"arm": str, "arm_digest": str, "seed": int, "tasks": dict}

TASK_FIELDS = {
    "trial_set_hash": str,
    "tolerance": NUMBER,
    "horizon": int,
    "starts": list,
    "goals": list,
    "oracle": (dict, NULL),
}

RESULT_FIELDS = {"policy": str, "task": str, "trained_on": (str, NULL), "outcomes": dict}


def check_document(content: dict[str, Any]) -> None:
    """See that a document holds what is needed to face its trials again.

    Parameters
    ----------
    content : dict
        ``protocol`` and ``results``, of this version.

    Raises
    ------
    InvalidInputError
        If something is missing or of another kind, with the place where that is.
    """
    protocol = content["protocol"]
    check_fields("protocol", protocol, PROTOCOL_FIELDS)
    for task, entry in protocol["tasks"].items():
        check_fields(f"task {task!r}", entry, TASK_FIELDS)
        for part in ("starts", "goals"):
            finite_array(f"{part} of {task!r}", entry[part], (None, None))
    for number, row in enumerate(content["results"]):
        where = f"result {number}"
        check_fields(where, row, RESULT_FIELDS)
        check_fields(where, row["outcomes"], dict.fromkeys(ENDS, list))
        if row["task"] not in protocol["tasks"]:
            raise InvalidInputError(f"{where} is of the unknown task {row['task']!r}")
        if len({len(row["outcomes"][part]) for part in ENDS}) > 1:
            raise InvalidInputError(f"{where} has outcomes of different lengths")


def check_fields(where: str, entries: Any, fields: Mapping[str, Any]) -> None:
    """See that an object of a document has some fields, each of a type.

    Raises
    ------
    InvalidInputError
        If it has not, with its name.
    """
    if not isinstance(entries, dict):
        raise InvalidInputError(f"{where} is no object")
    for field, kind in fields.items():
        if field not in entries:
            raise InvalidInputError(f"{where} lacks {field!r}")
        if not isinstance(entries[field], kind):
            raise InvalidInputError(f"{where} has no such {field!r} as it should")
