"""The document of an evaluation: everything about it, to keep and to face the same trials again."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kinarm._archive import load_json
from kinarm._files import first_line
from kinarm._validation import finite_array
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.contestants import check_names
from kinarm.evaluation.evaluation import Evaluation, pool
from kinarm.evaluation.statistics import BOOTSTRAP_SEED, LEVEL, RESAMPLES
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

KIND, FORMAT_VERSION = "evaluation", 4
"""Kind and version of the files."""

READABLE = (2, 3, FORMAT_VERSION)
"""Versions that can be read: 2 lacks failures, trials that go on, and bounds of a part; 2 and 3
call complete proofs tight."""

ENDS = ("outcome", "steps", "final_distance")
"""What has to be the same again."""


def evaluation_document(evaluations: Sequence[Evaluation], command: str) -> dict[str, Any]:
    """Everything about an evaluation, as a dictionary that JSON can hold.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Made with one trial set per problem.
    command : str
        The command that made them.

    Returns
    -------
    dict
        ``protocol`` (problems, their trials with hash and bounds, versions, commit, command),
        ``results`` (one per policy and problem, with the outcome of every trial) and ``pooled``
        (one per recipe and problem with several training seeds).

    Raises
    ------
    InvalidInputError
        If two policies on a problem, or two problems, have the same name.
    """
    check_names((each.contestant, each.problem) for each in evaluations)
    any_set = evaluations[0].trials
    facing = {each.problem.name: each for each in reversed(evaluations)}
    return {
        "protocol": {
            "format_version": FORMAT_VERSION,
            "command": command,
            "trials": len(any_set),
            "seed": any_set.seed,
            "hold": any(each.holding is not None for each in evaluations),
            "intervals": {
                "level": LEVEL,
                "shares": "Wilson",
                "distances": "percentile bootstrap over trials",
                "pooled": "Student, over training seeds and trials",
                "resamples": RESAMPLES,
                "bootstrap_seed": BOOTSTRAP_SEED,
            },
            "problems": {name: _problem_entry(facing[name]) for name in reversed(facing)},
            "versions": package_versions(),
            "commit": source_commit(),
        },
        "results": [evaluation.to_json() for evaluation in evaluations],
        "pooled": [pooled.to_json() for pooled in pool(evaluations)],
    }


def document_text(value: Any, indent: str = "\n") -> str:
    """A document as JSON: objects over several lines, but lists of numbers or words on one."""
    if isinstance(value, list) and any(isinstance(each, Mapping) for each in value):
        entries, ends = [document_text(each, indent + " ") for each in value], "[]"
    elif isinstance(value, Mapping):
        entries = [f"{json.dumps(key)}: {document_text(value[key], indent + ' ')}" for key in value]
        ends = "{}"
    else:
        return json.dumps(value)
    return f"{ends[0]}{indent} {f',{indent} '.join(entries)}{indent}{ends[1]}"


def _problem_entry(evaluation: Evaluation) -> dict[str, Any]:
    """What was faced, and what any policy could do there."""
    trials, bounds = evaluation.trials, evaluation.bounds
    return {
        "arm": trials.simulator.arm.name,
        "problem": trials.problem.pinned.to_json(),
        "digest": trials.problem.digest,
        "trial_set_hash": trials.digest,
        "starts": trials.starts.tolist(),
        "goals": trials.goals.tolist(),
        "oracle": bounds_document(bounds) if bounds is not None else None,
    }


@dataclass(frozen=True)
class EvaluationDocument:
    """What a file ``evaluation.json`` holds.

    Attributes
    ----------
    name : str
        Name of the file.
    protocol : dict
        Problems and trials.
    results : list of dict
        One for each policy and problem.
    members : dict
        Names of the policies of each group of training seeds, by its name and problem.
    """

    name: str
    protocol: dict[str, Any]
    results: list[dict[str, Any]]
    members: dict[tuple[str, str], list[str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"EvaluationDocument({self.name!r}, {len(self.results)} results)"

    @classmethod
    def load(cls, path: str | Path) -> "EvaluationDocument":
        """Read a document.

        Raises
        ------
        InvalidInputError
            If the file is missing, damaged, something else, or of another version.
        """
        name = str(path)
        content = load_json(path, KIND, InvalidInputError)
        try:
            check_shape(content, {"protocol": {"format_version": int}, "results": list}, "it")
            version = content["protocol"]["format_version"]
            if version in READABLE:
                check_document(content)
        except (ValueError, RecursionError) as error:
            raise InvalidInputError(
                f"{name!r} is not a complete kinarm evaluation: {first_line(error)}"
            ) from error
        if version not in READABLE:
            readable = " and ".join(map(str, READABLE))
            raise InvalidInputError(
                f"{name!r} has format version {version}; this kinarm reads {readable}"
            )
        members = {(row["policy"], row["problem"]): row["members"] for row in content["pooled"]}
        return cls(name, content["protocol"], content["results"], members)

    def result(self, policy: str | None, problem: str | None) -> dict[str, Any]:
        """Find the result of a policy, or of a group's first seed, on a problem.

        Raises
        ------
        InvalidInputError
            If there is none, or several that fit.
        """
        fitting = [row for row in self.results if problem in (None, row["problem"])]
        if policy is None:
            named = [row for row in fitting if row["trained_on"] is not None] or fitting
            if len(named) != 1:
                choices = ", ".join(f"{row['policy']} on {row['problem']}" for row in named)
                raise InvalidInputError(
                    f"{self.name!r} holds several results, choose with --policy and --problem: "
                    f"{choices or 'none on this problem'}"
                )
            return named[0]
        for row in fitting:
            first, *_ = self.members.get((policy, row["problem"]), [policy])
            if row["policy"] == first:
                return row
        raise UnknownNameError("policy", policy, dict.fromkeys(row["policy"] for row in fitting))

    def problem(self, name: str) -> ReachProblem:
        """One of the problems that were faced.

        Raises
        ------
        InvalidInputError
            If it cannot be read.
        """
        entry = self.protocol["problems"][name]
        return ReachProblem.from_json(entry["problem"], f"{self.name}: problem {name}")

    def trials(self, problem: str) -> TrialSet:
        """The trials of a problem, as they were faced.

        Raises
        ------
        InvalidInputError
            If problem, starts and goals do not match their hash.
        KinarmError
            If the arm is missing or another one by now.
        """
        entry = self.protocol["problems"][problem]
        simulator = Simulator(self.problem(problem))
        starts, goals = np.array(entry["starts"]), np.array(entry["goals"])
        trials = TrialSet(simulator, self.protocol["seed"], starts, goals)
        if trials.digest != entry["trial_set_hash"]:
            raise InvalidInputError(
                f"the trials of {problem} in {self.name!r} do not match their hash"
            )
        return trials

    def floors(self, problem: str) -> list[int] | None:
        """Proven numbers of steps of a problem's first trials, if the evaluation had them."""
        oracle = self.protocol["problems"][problem]["oracle"]
        return oracle["trials"]["steps_lower_bound"] if oracle else None

    def check_same(self, row: dict[str, Any], ends: Sequence[tuple[str, int, float]]) -> None:
        """See that trials end as the evaluation says.

        Parameters
        ----------
        row : dict
            The result of a policy.
        ends : sequence of (str, int, float)
            Outcomes, steps and final distances [m], of all its trials.

        Raises
        ------
        InvalidInputError
            If one does not: policy or simulator have changed since.
        """
        said = list(zip(*(row["outcomes"][part] for part in ENDS), strict=True))
        for trial, end in enumerate(ends):
            if len(ends) != len(said) or end != said[trial]:
                raise InvalidInputError(
                    f"trial {trial} of {row['policy']!r} ends otherwise than in "
                    f"{self.name!r}: the policy or kinarm has changed, evaluate again"
                )


EACH, ENTRY, NULL = "*", "[]", type(None)
"""Keys that stand for every key of an object and every entry of a list, and the type of null."""

SHAPE = {
    "protocol": {
        "seed": int,
        "problems": {
            EACH: {
                "problem": dict,
                "trial_set_hash": str,
                "starts": list,
                "goals": list,
                "oracle": (dict, NULL),
            }
        },
    },
    "results": {
        ENTRY: {
            "policy": str,
            "problem": str,
            "trained_on": (str, NULL),
            "outcomes": dict.fromkeys(ENDS, list),
        }
    },
    "pooled": {ENTRY: {"policy": str, "problem": str, "members": list}},
}
"""What is needed of a document to face its trials again: types, by nested keys."""


def check_document(content: dict[str, Any]) -> None:
    """Check that a document holds what is needed to run its trials again.

    Raises
    ------
    InvalidInputError
        If something is missing or of another kind, with the place where that is.
    """
    check_shape(content, SHAPE, "it")
    for name, entry in content["protocol"]["problems"].items():
        for part in ("starts", "goals"):
            finite_array(f"{part} of {name!r}", entry[part], (None, None))
        if entry["oracle"]:
            bounds = {"trials": {"steps_lower_bound": list}}
            check_shape(entry["oracle"], bounds, f"oracle of {name!r}")
    for number, row in enumerate(content["results"]):
        if row["problem"] not in content["protocol"]["problems"]:
            raise InvalidInputError(f"results.{number} is of no known problem: {row['problem']!r}")
        if len({len(row["outcomes"][part]) for part in ENDS}) > 1:
            raise InvalidInputError(f"results.{number} has outcomes of different lengths")


def check_shape(value: Any, shape: Any, where: str) -> None:
    """See that part of a document is of a type, or an object with some keys; see `SHAPE`.

    Raises
    ------
    InvalidInputError
        If it is not; names the first place that is wrong.
    """
    if not isinstance(shape, Mapping):
        if not isinstance(value, shape):
            raise InvalidInputError(f"{where} is of the wrong kind")
        return
    if ENTRY in shape:
        if not isinstance(value, list):
            raise InvalidInputError(f"{where} is no list")
        for number, entry in enumerate(value):
            check_shape(entry, shape[ENTRY], f"{where}.{number}")
        return
    if not isinstance(value, Mapping):
        raise InvalidInputError(f"{where} is no object")
    for key in value if EACH in shape else shape:
        if key not in value:
            raise InvalidInputError(f"{where} lacks {key!r}")
        inner = key if where == "it" else f"{where}.{key}"
        check_shape(value[key], shape.get(EACH) or shape[key], inner)
