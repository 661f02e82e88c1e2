"""Where trainings run: the options that commands share."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError

if TYPE_CHECKING:
    from kinarm.evaluation.running.executor import Executor


@dataclass(frozen=True, kw_only=True)
class RunningOptions:
    """Where trainings run.

    Parameters
    ----------
    jobs : int
        Trainings at a time on this machine; one a processor.
    ray : str
        Run on Ray: auto, the address of a cluster, or local.
    slurm : bool
        Run as array jobs of Slurm.
    bundle : int
        Trainings of one element of a Slurm array.
    minutes : int
        Time limit of an element of a Slurm array.
    partition : str
        Partition of Slurm.
    """

    jobs: int | None = None
    ray: str | None = field(default=None, metadata={"metavar": "ADDRESS"})
    slurm: bool = False
    bundle: int = 1
    minutes: int = 240
    partition: str | None = None

    def __post_init__(self) -> None:
        for name in ("bundle", "minutes"):
            whole_number(name, getattr(self, name), 1)
        if self.jobs is not None:
            whole_number("jobs", self.jobs, 1)
        if self.slurm and self.ray is not None:
            raise InvalidInputError("--ray and --slurm exclude each other")

    @property
    def at_once(self) -> int:
        """Trainings at a time on this machine."""
        return self.jobs or available_threads()

    def elsewhere(self, folder: Path, threads: int = 1) -> "Executor | None":
        """The executor that the options name; None for worker processes of this machine.

        Parameters
        ----------
        folder : Path
            Output folder, where Slurm keeps its jobs.
        threads : int
            Threads of a training.
        """
        if self.ray is not None:
            from kinarm.evaluation.running.ray_cluster import RayExecutor

            return RayExecutor(self.ray, self.jobs, threads)
        if self.slurm:
            from kinarm.evaluation.running.slurm import SlurmExecutor

            return SlurmExecutor(
                folder / "slurm", self.bundle, self.minutes, threads, self.partition
            )
        return None
