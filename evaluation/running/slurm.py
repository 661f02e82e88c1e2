"""Array jobs of a Slurm cluster as executor."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from kinarm.errors import InvalidInputError, MissingExtraError, WorkerError
from kinarm.evaluation.running.identity import Guarded, identity
from kinarm.workers import Finished

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")

LOOK_SECONDS = 0.5
"""How often the driver looks for jobs that ended."""


@dataclass(frozen=True)
class SlurmExecutor:
    """Array jobs of a Slurm cluster, whose machines share the folder with this one.

    Parameters
    ----------
    folder : Path
        Where jobs, their logs and their results lie.
    bundle : int
        Tasks that one element of the array carries out, one after the other.
    minutes : int
        Time limit of an element; one that is preempted or runs out of time goes on where it was.
    threads : int
        Processors of an element.
    partition : str, optional
        Partition of the cluster.
    at_once : int
        Elements that run at the same time, at most.
    cluster : {"slurm", "local"}
        ``"local"`` runs the same jobs as processes of this machine, to try things.
    """

    folder: Path
    bundle: int = 1
    minutes: int = 240
    threads: int = 1
    partition: str | None = None
    at_once: int = 256
    cluster: str = "slurm"

    def carry_out(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Do the work for every task; yield what finishes, bundle by bundle.

        Abandoned or interrupted, what is not finished is cancelled.

        Raises
        ------
        MissingExtraError
            If submitit is not installed.
        InvalidInputError
            If there is no Slurm on this machine, or it refuses the jobs.
        WorkerError
            If a job ends without a result, or a worker has other versions than this process.
        """
        try:
            import submitit
        except ImportError as error:
            raise MissingExtraError("submitit", "slurm") from error
        guarded = Guarded(work, identity())
        numbered = list(enumerate(tasks))
        bundles = [
            Bundle(guarded, numbered[first : first + self.bundle])
            for first in range(0, len(numbered), self.bundle)
        ]
        if not bundles:
            return
        jobs = self._submit(submitit, bundles)
        try:
            while jobs:
                ended = [job for job in jobs if job.done()]
                for job in ended:
                    jobs.remove(job)
                    for number, result in self._results(submitit, job):
                        yield Finished(number, result)
                if jobs and not ended:
                    time.sleep(LOOK_SECONDS)
        finally:
            for job in jobs:
                with suppress(Exception):
                    job.cancel(check=False)
                    if self.cluster == "local":
                        job.wait()

    def _submit(self, submitit: Any, bundles: "Sequence[Bundle]") -> list[Any]:
        """Hand an array of bundles to the cluster."""
        try:
            executor = submitit.AutoExecutor(folder=self.folder, cluster=self.cluster)
            settings = {"slurm_partition": self.partition} if self.partition else {}
            executor.update_parameters(
                name="kinarm",
                timeout_min=self.minutes,
                cpus_per_task=self.threads,
                slurm_array_parallelism=self.at_once,
                **settings,
            )
            with executor.batch():
                return [executor.submit(bundle) for bundle in bundles]
        except (OSError, RuntimeError, submitit.core.utils.FailedJobError) as error:
            raise InvalidInputError(f"Slurm takes no jobs: {error}") from error

    def _results(self, submitit: Any, job: Any) -> list[tuple[int, Any]]:
        """What a bundle came to, or what went wrong."""
        try:
            return list(job.result())
        except submitit.core.utils.FailedJobError as error:
            raise WorkerError(
                f"job {job.job_id} failed: {_reason(str(error))}; its log is "
                f"{str(job.paths.stderr)!r}, and the same command goes on with what is missing"
            ) from error


def _reason(said: str) -> str:
    """What submitit says of a failed job, in a line: the last one of the traceback, if any."""
    _, _, traced = said.partition("Traceback (most recent call last):\n")
    lines = [line for line in (traced or said).splitlines() if line and not line.startswith(" ")]
    return next((line for line in lines if not line.startswith("-")), "no result")


@dataclass
class Bundle:
    """Tasks of one element of an array, and their results so far.

    Attributes
    ----------
    work : callable
        What to do.
    tasks : list of (int, object)
        Tasks with their numbers.
    results : list of (int, object)
        What those that are finished came to, with their numbers.
    """

    work: Callable[[Any], Any]
    tasks: list[tuple[int, Any]]
    results: list[tuple[int, Any]] = field(default_factory=list)

    def __call__(self) -> list[tuple[int, Any]]:
        """Run the unfinished tasks."""
        for number, task in self.tasks[len(self.results) :]:
            self.results.append((number, self.work(task)))
        return self.results

    def checkpoint(self) -> Any:
        """What Slurm is to run when it takes the machine away: the rest."""
        import submitit

        return submitit.helpers.DelayedSubmission(self)
