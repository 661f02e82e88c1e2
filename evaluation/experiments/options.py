"""Where trainings run: the options that commands share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.executors import Executor


@dataclass(frozen=True, kw_only=True)
class RunningOptions:
    """Where trainings run.

    Parameters
    ----------
    jobs : int
        Trainings at a time on this machine.
    ray : str
        Run on Ray: auto, the address of a cluster, or local.
    slurm : bool
        Run as array jobs of Slurm.
    bundle : int
        Trainings of one element of a Slurm array.
    minutes : int
        Time limit of an element of a Slurm array [min].
    partition : str
        Partition of Slurm.
    """

    jobs: int | None = None
    ray: str | None = field(default=None, metadata={"metavar": "ADDRESS"})
    slurm: bool = False
    bundle: int | None = None
    minutes: int | None = None
    partition: str | None = None

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {
        "where trainings run": ("jobs", "ray", "slurm", "bundle", "minutes", "partition")
    }
    DEFAULTS: ClassVar[Mapping[str, str]] = {
        "jobs": "one a processor",
        "ray": "this machine without Ray",
        "bundle": "1",
        "minutes": "240",
        "partition": "the cluster's",
    }

    def __post_init__(self) -> None:
        for name in ("jobs", "bundle", "minutes"):
            if getattr(self, name) is not None:
                whole_number(name, getattr(self, name), 1)
        if self.slurm and self.ray is not None:
            raise InvalidInputError("--ray and --slurm exclude each other")
        if self.slurm and self.jobs is not None:
            raise InvalidInputError("--jobs is for this machine: it does not go with --slurm")
        for name in ("bundle", "minutes", "partition"):
            if getattr(self, name) is not None and not self.slurm:
                raise InvalidInputError(f"--{name} goes with --slurm")

    def refuse_without_training(self) -> None:
        """Refuse options of where trainings run if nothing is trained.

        Raises
        ------
        InvalidInputError
            If an option says so.
        """
        for name in RunningOptions.GROUPS["where trainings run"]:
            if getattr(self, name):
                raise InvalidInputError(f"--{name} does not go with --no-train")

    def executor(self, folder: Path, threads: int = 1) -> "Executor":
        """Where trainings run, as the options say.

        Parameters
        ----------
        folder : Path
            Output folder, where Slurm keeps its jobs.
        threads : int
            Threads of a training.
        """
        if self.ray is not None:
            from kinarm.evaluation.experiments.clusters import RayExecutor

            return RayExecutor(self.ray, self.jobs, threads)
        if self.slurm:
            from kinarm.evaluation.experiments.clusters import SlurmExecutor

            return SlurmExecutor(
                folder / "slurm", self.bundle or 1, self.minutes or 240, threads, self.partition
            )
        from kinarm.evaluation.experiments.executors import LocalExecutor

        return LocalExecutor(self.jobs or available_threads(), threads)
