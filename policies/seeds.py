"""Several training seeds at once, each in its own process."""

import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kinarm._files import absolute, check_folder, check_output, only_writer
from kinarm._interrupts import asking, telling
from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError, PolicyFileError, WorkerError
from kinarm.policies.learners import learner_of
from kinarm.policies.training import (
    TrainingStopped,
    TrainRequest,
    checkpoint_path,
    curve_path,
    refuse_unfinished,
    say_findings,
    train_to_file,
)

if TYPE_CHECKING:
    from kinarm.policies.config import TrainingConfig
    from kinarm.policies.learners import CurvePoint
    from kinarm.policies.progress_board import ProgressBoard
    from kinarm.problem import ReachProblem

MOST_SEEDS = 1000
LOOK_SECONDS = 0.2
"""How often the shown progress is renewed."""


def seeds_of(text: str) -> tuple[int, ...]:
    """Seeds of a text: ``"5"`` is 0 to 4, ``"5-9"`` is 5 to 9.

    Raises
    ------
    InvalidInputError
        If it is neither a number nor a rising range, or there are too many.
    """
    found = re.fullmatch(r"(?:([0-9]{1,9})-)?([0-9]{1,9})", text)
    if found is not None:
        first, last = int(found[1] or 0), int(found[2]) - (found[1] is None)
        if first <= last < first + MOST_SEEDS:
            return tuple(range(first, last + 1))
    raise InvalidInputError(
        f"must be a number (5) or a rising range (5-9), 1 to {MOST_SEEDS} seeds, got {text!r}"
    )


class SeedTask(NamedTuple):
    """The training of one seed.

    Attributes
    ----------
    config : TrainingConfig
        Its settings.
    out : Path
        File of its policy.
    """

    config: "TrainingConfig"
    out: Path


class TrainedSeed(NamedTuple):
    """What the training of one seed came to.

    Attributes
    ----------
    seed : int
        The seed.
    out : Path
        File of its policy.
    last : CurvePoint or None
        Its last iteration; None if it was finished earlier.
    """

    seed: int
    out: Path
    last: "CurvePoint | None"


@dataclass(frozen=True, kw_only=True)
class SeedsRequest:
    """Train a policy with each of several seeds, as many at a time as there are processors.

    Each policy equals that of a training with this seed alone, bit for bit.

    Parameters
    ----------
    training : TrainRequest
        What is trained; ``out`` is the folder of the policies, and there is no ``seed``.
    seeds : tuple of int
        Train several seeds in parallel: a number (5 is 0 to 4) or a range (5-9). One policy for
        each goes into the folder --out.
    jobs : int, optional
        Seeds at a time.

    Raises
    ------
    InvalidInputError
        If two settings do not go together, or a number is out of range.
    """

    training: TrainRequest
    seeds: tuple[int, ...] = field(metadata={"parse": seeds_of, "metavar": "N"})
    jobs: int | None = None

    GROUPS: ClassVar = {"training": ("seeds", "jobs")}
    DEFAULTS: ClassVar = {"seeds": "one training", "jobs": "one a processor"}

    def __post_init__(self) -> None:
        if self.training.seed is not None:
            raise InvalidInputError("--seed and --seeds exclude each other")
        if not self.seeds:
            raise InvalidInputError("there is no seed to train")
        for seed in self.seeds:
            whole_number("seed", seed, 0)
        if self.jobs is not None:
            whole_number("jobs", self.jobs, 1)
        if Path(self.training.out).suffix == ".npz":
            folder = Path(self.training.out).with_suffix("")
            raise InvalidInputError(f"with --seeds, --out is a folder: --out {folder}")

    @property
    def folder(self) -> Path:
        """Folder of the policies."""
        return Path(self.training.out)

    def run(self) -> tuple[TrainedSeed, ...]:
        """Train, and write a policy and a learning curve for each seed.

        Names are those of the shipped policies, such as ``ars-tuned-both-seed0.npz``. With
        ``resume``, finished seeds are left as they are, and the others go on or begin.

        Returns
        -------
        tuple of TrainedSeed
            In the order of the seeds.

        Raises
        ------
        KinarmError
            If settings cannot be used, or a file cannot be written.
        WorkerError
            If workers end unexpectedly again and again; the message says how to go on.
        KeyboardInterrupt
            If it is interrupted; checkpoints are then complete, and the message says so.
        """
        tasks = self._tasks()
        check_folder(self.folder)
        with only_writer(self.folder):
            waiting = self._waiting(tasks)
            if waiting:
                say_findings(waiting[0].config)
            with telling(partial(_what_is_left, tasks, "interrupted")):
                try:
                    last = self._carry_out(waiting)
                except WorkerError as error:
                    from kinarm.workers import LOST_WORKERS

                    raise WorkerError(_what_is_left(tasks, LOST_WORKERS)) from error
        return tuple(TrainedSeed(task.config.seed, task.out, last.get(task.out)) for task in tasks)

    def _tasks(self) -> list[SeedTask]:
        """The trainings, whether finished or not."""
        tasks = []
        first = self.training.config()
        learner = learner_of(first)
        learner.check_installed()
        for seed in self.seeds:
            config = replace(first, seed=seed)
            parts = (learner.name, config.recipe, config.problem.name)
            name = re.sub(r"[^\w.-]+", "", "-".join(parts))
            tasks.append(SeedTask(config, self.folder / f"{name}-seed{seed}.npz"))
        return tasks

    def _waiting(self, tasks: list[SeedTask]) -> list[SeedTask]:
        """The unfinished trainings; refuses files that are in the way."""
        if self.training.resume:
            return self._resumed(tasks)
        for task in tasks:
            refuse_unfinished(task.out)
            check_output(task.out, overwrite=self.training.overwrite, suffix=".npz")
        return tasks

    def _resumed(self, tasks: list[SeedTask]) -> list[SeedTask]:
        """The unfinished trainings; refuses files of other settings."""
        if not any(checkpoint_path(task.out).exists() or task.out.exists() for task in tasks):
            raise PolicyFileError(
                f"nothing to resume: there is no {str(checkpoint_path(tasks[0].out))!r}"
            )
        return [task for task in tasks if not self._is_finished(task)]

    def _is_finished(self, task: SeedTask) -> bool:
        """Whether there is the policy of a training, and no checkpoint beside it.

        With ``overwrite``, a policy with other settings is one that was to be replaced.
        """
        from kinarm.policies.checkpoint import load_checkpoint
        from kinarm.policies.policy import Policy
        from kinarm.policies.provenance import plain_settings

        path = checkpoint_path(task.out)
        if path.exists():
            config = load_checkpoint(path).config
            change = _change(plain_settings(config), config.problem, task.config)
        elif task.out.exists():
            path, made = task.out, Policy.load(task.out).provenance
            change = _change(made.config, made.problem, task.config)
            if self.training.overwrite:
                return change is None
        else:
            return False
        if change is not None:
            raise InvalidInputError(
                f"{str(path)!r} is of another training ({change}): give the same options again, "
                "or another --out"
            )
        return path == task.out

    def _carry_out(self, tasks: list[SeedTask]) -> "dict[Path, CurvePoint | None]":
        """Train in worker processes, and show how far they are; last iterations by file."""
        from kinarm.policies.progress_board import ProgressBoard
        from kinarm.workers import LocalExecutor

        if not tasks:
            return {}
        last: dict[Path, CurvePoint | None] = {}
        jobs = min(self.jobs or available_threads(), len(tasks))
        threads = max(1, available_threads() // jobs)
        with tempfile.TemporaryDirectory(prefix="kinarm-") as folder:
            board = ProgressBoard(Path(folder), len(tasks))
            board.clear()
            logs = self.training.tensorboard and absolute(self.training.tensorboard)
            work = partial(_train, board=board, threads=threads, logs=logs)
            # Workers that are there already may be in another folder.
            placed = [(k, task._replace(out=absolute(task.out))) for k, task in enumerate(tasks)]
            with asking(board.ask_to_stop), _shown(board, tasks):
                done = LocalExecutor(jobs, threads).carry_out(work, placed)
                for number, point in done:
                    last[tasks[number].out] = point
        return last


def _change(
    settings: dict[str, Any], problem: "ReachProblem", config: "TrainingConfig"
) -> str | None:
    """How a training that was begun differs from one that is asked for."""
    from kinarm.policies.provenance import plain_settings

    wanted = plain_settings(config)
    changed = [name for name in wanted | settings if wanted.get(name) != settings.get(name)]
    return ", ".join(changed) or problem.first_difference(config.problem)


def _train(
    numbered: tuple[int, SeedTask], board: "ProgressBoard", threads: int, logs: str | Path | None
) -> "CurvePoint | None":
    """Carry out a training, in a worker; its last iteration, if it was not asked to stop."""
    from kinarm.policies.checkpoint import load_checkpoint
    from kinarm.policies.progress_board import BoardWatcher

    number, (config, out) = numbered
    if board.asked_to_stop():
        return None
    options: dict[str, Any] = {}
    if "threads" in learner_of(config).options:
        options["threads"] = threads
    if logs is not None:
        options["tensorboard"] = Path(logs) / out.stem
    path, watcher = checkpoint_path(out), BoardWatcher(board, number)
    with suppress(TrainingStopped), only_writer(out):
        state = load_checkpoint(path).state if path.exists() else None
        return train_to_file(config, state, out, watcher, board.asked_to_stop, **options).curve[-1]
    return None


@contextmanager
def _shown(board: "ProgressBoard", tasks: list[SeedTask]) -> Iterator[None]:
    """Show how far all trainings are, in one line."""
    from kinarm._console import ProgressLine

    config = tasks[0].config
    title = f"{learner_of(config).name} {config.recipe} {config.problem.name} {len(tasks)} seeds"
    total = sum(task.config.iterations for task in tasks)
    over = threading.Event()

    def look(line: ProgressLine) -> None:
        while not over.wait(LOOK_SECONDS):
            line.update(board.iterations, board.words())

    with ProgressLine(title, total, "iterations") as line:
        thread = threading.Thread(target=look, args=(line,), daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()
            line.update(board.iterations, board.words())


def _what_is_left(tasks: list[SeedTask], why: str) -> str:
    """Why trainings end early, what that leaves, and how to go on."""
    begun = [task for task in tasks if checkpoint_path(task.out).exists()]
    finished = [task for task in tasks if task not in begun and curve_path(task.out).exists()]
    if not begun and not finished:
        return f"{why} before the first iteration; the same command begins again"
    return (
        f"{why}: {len(finished)} of {len(tasks)} seeds are finished; "
        "the same command with --resume goes on"
    )
