"""What a training of a study of transfer came to, and the files in which that is kept."""

import json
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from kinarm._archive import load_json, reading
from kinarm._files import write_text
from kinarm.errors import KinarmError
from kinarm.evaluation.studies.transfer.planning import PlannedTraining
from kinarm.policies.policy import Policy


class Look(NamedTuple):
    """How the policy did at one point of a training.

    Attributes
    ----------
    iteration : int
        Finished iterations.
    environment_steps : int
        Steps taken so far.
    successes, collisions : int
        Trials that ended so.
    """

    iteration: int
    environment_steps: int
    successes: int
    collisions: int


class TransferRun(NamedTuple):
    """A finished training.

    Attributes
    ----------
    policy : Policy
        The trained policy.
    looks : tuple of Look
        How it did in the course of the training, before the first iteration included.
    """

    policy: Policy
    looks: tuple[Look, ...]

    def first_look(self, successes: float) -> Look | None:
        """The first one with so many successes; None if there is none."""
        return next((look for look in self.looks if look.successes >= successes), None)


def policy_path(folder: Path, training: PlannedTraining) -> Path:
    """Where the policy of a training lies."""
    return folder / f"{training.name}.npz"


def save_run(folder: Path, training: PlannedTraining, run: TransferRun) -> None:
    """Write a finished training: first its policy, and then its looks.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    run.policy.save(policy_path(folder, training))
    entries = {"settings": training.settings, "looks": [look._asdict() for look in run.looks]}
    write_text(folder / f"{training.name}.json", json.dumps(entries) + "\n")


def load_run(folder: Path, training: PlannedTraining) -> TransferRun | None:
    """Read a finished training; None if it is not finished, or a file is damaged."""
    path = folder / f"{training.name}.json"
    with suppress(KinarmError), reading(repr(str(path)), "run", KinarmError):
        looks = tuple(Look(**look) for look in load_json(path, "run", KinarmError)["looks"])
        if looks and all(type(count) is int and count >= 0 for look in looks for count in look):
            return TransferRun(Policy.load(policy_path(folder, training)), looks)
    return None
