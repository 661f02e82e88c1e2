"""Bounds of trials on disk: whatever happens to the files, the bounds are right."""

import os
import time
from pathlib import Path

import pytest
from trial_bounds import draw

from kinarm import _files
from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.policies.provenance import package_versions


@pytest.mark.parametrize("package", bounds.COMPUTING_PACKAGES)
def test_the_version_changes_with_the_packages_that_compute(monkeypatch, package):
    before, installed = bounds.oracle_version(), package_versions()
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, package: "99"})
    assert bounds.oracle_version() != before
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, "torch": "99"})
    assert bounds.oracle_version() == before


def fill(folder: Path, *names: str, size: int = 1000) -> None:
    """Write files of which each was used an hour before the next, the last one an hour ago."""
    folder.mkdir(parents=True, exist_ok=True)
    for age, name in enumerate(reversed(names), start=1):
        (folder / name).write_bytes(bytes(size))
        used = time.time() - 3600 * age
        os.utime(folder / name, (used, used))


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


class TestRoom:
    """What the cache keeps when it gets full."""

    def test_the_least_recently_used_files_go_beyond_a_size(self, folder, monkeypatch):
        fill(folder, *(f"oracle-{name}-1.npz" for name in "abcd"), size=100_000)
        monkeypatch.setattr(_files, "KEPT_BYTES", 250_000)
        oracle_bounds(draw())
        assert {f"oracle-{name}-1.npz" for name in "cd"} < names_in(folder)
        assert len(names_in(folder)) == 3

    def test_looking_up_is_use(self, folder, monkeypatch):
        oracle_bounds(draw())
        (first,) = names_in(folder)
        monkeypatch.setattr(_files, "KEPT_BYTES", 3 * (folder / first).stat().st_size)
        os.utime(folder / first, (0, 0))
        fill(folder, "oracle-old-1.npz", size=2 * (folder / first).stat().st_size)
        oracle_bounds(draw())
        oracle_bounds(draw(seed=6))
        assert first in names_in(folder)
        assert "oracle-old-1.npz" not in names_in(folder)

    def test_only_what_belongs_to_the_cache_goes(self, folder, monkeypatch):
        monkeypatch.setattr(_files, "KEPT_BYTES", 1)
        abandoned = ".oracle-a-1.npz.x2f9k"
        fill(folder, abandoned, "notes.txt", "oracle.npz", "policy.npz", "oracle-mine.txt")
        oracle_bounds(draw())
        assert {"notes.txt", "oracle.npz", "policy.npz", "oracle-mine.txt"} < names_in(folder)
        assert abandoned not in names_in(folder)
