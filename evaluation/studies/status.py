"""How far a study is, while it runs or after it was stopped."""

import time
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from kinarm._files import is_being_written

if TYPE_CHECKING:
    from kinarm.evaluation.studies.study import Study

RECENT = 50
"""How many of the latest trainings tell the rate."""


@dataclass(frozen=True, kw_only=True)
class StudyStatus:
    """How far a study is.

    Attributes
    ----------
    name : str
        The study.
    done, remaining : int
        Trainings that are finished, and that are not.
    failed : tuple of (str, str)
        Trainings that failed, among those that remain, and why.
    running : bool
        Whether a process is at it.
    rate : float or None
        Trainings finished a minute of late; None if that cannot be told.
    """

    name: str
    done: int
    remaining: int
    failed: tuple[tuple[str, str], ...]
    running: bool
    rate: float | None

    @classmethod
    def of(cls, study: "Study") -> "StudyStatus":
        """Look into the folder of a study."""
        store = study.store
        finished = [store.run_path(run) for run in study.runs if store.run_path(run).exists()]
        times = sorted(path.stat().st_mtime for path in finished)[-RECENT:]
        passed = times[-1] - times[0] if times else 0.0
        return cls(
            name=study.specification.name,
            done=len(finished),
            remaining=len(study.runs) - len(finished),
            failed=tuple((run.name, error) for run, error in study.failures.items()),
            running=is_being_written(store.folder),
            rate=60 * (len(times) - 1) / passed if passed > 0 else None,
        )

    def lines(self) -> list[str]:
        """The same in words."""
        told = [f"{self.name}: {self.done} of {self.done + self.remaining} trainings finished"]
        if self.running and self.remaining:
            told[0] += ", running"
            if self.rate:
                minutes = self.remaining / self.rate
                end = datetime.fromtimestamp(time.time()).astimezone() + timedelta(minutes=minutes)
                told.append(
                    f"{self.rate:.1f} a minute; {self.remaining} remain, until about {end:%H:%M}"
                )
        elif self.remaining:
            told[0] += ", stopped; the command that made it goes on"
        told += [f"failed: {name}: {error}" for name, error in self.failed]
        return told
