"""Every write of a study fails in turn: afterwards the same study goes on to the same results."""

import errno
import os

import pytest
from small_studies import contents

from kinarm import _files
from kinarm.errors import OutputError
from kinarm.workers import LocalExecutor

ERRORS = {
    "no space": lambda: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    "not permitted": lambda: OSError(errno.EACCES, os.strerror(errno.EACCES)),
    "interrupted": KeyboardInterrupt,
}


@pytest.mark.parametrize("error", ERRORS)
def test_each_write_fails_in_turn(small, monkeypatch, error):
    straight = small("straight", seeds=1).run(jobs=1)
    replace, calls, failures = _files._replace, [], 0

    def failing(target, write):
        def interrupted(file):
            write(file)
            if len(calls) == failing_at:
                raise ERRORS[error]()

        calls.append(target)
        replace(target, interrupted)

    for failing_at in range(1, 50):
        calls.clear()
        study = small(f"study{failing_at}", seeds=1)
        monkeypatch.setattr(_files, "_replace", failing)
        try:
            study.run(executor=LocalExecutor(1))
        except (OutputError, KeyboardInterrupt):
            failures += 1
            monkeypatch.setattr(_files, "_replace", replace)
            study.run(executor=LocalExecutor(1))
        assert contents(study.store.folder) == contents(straight.store.folder)
        assert list(study.store.folder.rglob("*.part")) == []
        if len(calls) < failing_at:
            break
    assert failures == len(calls) == 1 + 1 + 2 * 2  # the study, the bounds, two trainings
