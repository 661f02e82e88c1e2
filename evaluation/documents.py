"""Reading back what ``kinarm-eval --out`` wrote, to face the same trials again."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.report import FORMAT_VERSION
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.library import group_of
from kinarm.recording import Recording
from kinarm.simulator import Simulator
from kinarm.task import load_task

ENDS = ("outcome", "steps", "final_distance")
"""What has to be the same again."""


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
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            version = content["protocol"]["format_version"]
            document = cls(str(path), content["protocol"], content["results"])
            if version == FORMAT_VERSION:
                document._look_through()
        except OSError as error:
            raise InvalidInputError(f"cannot read {str(path)!r}: {error.strerror}") from error
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise InvalidInputError(f"{str(path)!r} is not an evaluation of kinarm-eval") from error
        if version != FORMAT_VERSION:
            raise InvalidInputError(
                f"{str(path)!r} has format version {version}; this kinarm reads {FORMAT_VERSION}"
            )
        return document

    def _look_through(self) -> None:
        """Touch everything that will be needed; whatever is missing raises."""
        for row in self.results:
            said = row["outcomes"]
            _ = (row["policy"], row["trained_on"], self.protocol["tasks"][row["task"]])
            _ = list(zip(*(said[part] for part in ENDS), strict=True))
        for entry in self.protocol["tasks"].values():
            _ = [entry[part] for part in ("tolerance", "horizon", "trial_set_hash", "oracle")]
            np.hstack([np.array(entry[part], dtype=float) for part in ("starts", "goals")])
        _ = [self.protocol[part] for part in ("arm", "arm_digest", "seed")]

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
        for same in (lambda row: row["policy"] == policy, lambda row: _group(row) == policy):
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


def _group(row: dict[str, Any]) -> str:
    return group_of(str(row["policy"]))
