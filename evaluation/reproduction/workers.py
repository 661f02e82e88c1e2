"""Carry out the trainings of a study in worker processes."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol as Interface

from kinarm.errors import WorkerError
from kinarm.evaluation.entrants import BASELINES
from kinarm.evaluation.reproduction.study import LITERAL, Protocol, Training
from kinarm.evaluation.reproduction.training_run import carry_out, final_trials
from kinarm.parallel import available_threads

REFRESH_SECONDS = 0.5


class Observer(Interface):
    """What is told of the trainings."""

    def began(self, training: Training) -> None:
        """Take note of a training that a worker took up."""

    def finished(self, training: Training) -> None:
        """Take note of a finished training."""

    def refresh(self) -> None:
        """Do what is to be done twice a second."""


def carry_out_all(
    trainings: Sequence[Training], protocol: Protocol, folder: Path, jobs: int, observer: Observer
) -> None:
    """Carry out trainings, the longest first, as many at a time as there are jobs.

    Interrupted, it leaves what is finished and drops what is not; workers end with this process,
    however that ends.

    Parameters
    ----------
    trainings : sequence of Training
        What is to be done.
    protocol : Protocol
        How policies are judged.
    folder : Path
        The output folder.
    jobs : int
        Number of worker processes.
    observer : Observer
        Is told of every training.

    Raises
    ------
    WorkerError
        If a worker ends unexpectedly.
    """
    waiting = sorted(trainings, key=lambda training: -training.cost)
    threads = max(1, available_threads() // jobs)
    running: dict[Future[None], Training] = {}
    with _pool(jobs) as pool:
        while waiting or running:
            while waiting and len(running) < jobs:
                training = waiting.pop(0)
                future = pool.submit(carry_out, training, protocol, folder, threads)
                running[future] = training
                observer.began(training)
            done, _ = wait(running, REFRESH_SECONDS, return_when=FIRST_COMPLETED)
            for future in done:
                training = running.pop(future)
                _see_that_it_succeeded(future, training)
                observer.finished(training)
            observer.refresh()


def _see_that_it_succeeded(future: Future[None], training: Training) -> None:
    try:
        future.result()
    except BrokenProcessPool as error:
        raise WorkerError(
            f"a worker ended unexpectedly, perhaps for want of memory, during {training.name!r} "
            "or beside it; the same command goes on with what is missing"
        ) from error


@contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes that are killed on any way out but the normal one."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_prepare_worker)
    try:
        yield pool
    except BaseException:
        workers = list(multiprocessing.active_children())
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.kill()
        raise
    pool.shutdown()


def _prepare_worker() -> None:
    """Leave Ctrl-C to the parent, end when it does, and load what is compiled."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    BASELINES["zero"].run(final_trials("left", LITERAL, Protocol(trials=1)))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
