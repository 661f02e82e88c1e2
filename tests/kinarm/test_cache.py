"""Arrays that can be computed anew are kept in the user's cache folder."""

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from kinarm._cache import cache_folder, cached_arrays


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Makes arrays, and counts how often."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return {"numbers": np.arange(3.0)}


def test_made_once(folder):
    make = Maker()
    for _ in range(3):
        arrays = cached_arrays("thing", 1, b"content", make)
        np.testing.assert_array_equal(arrays["numbers"], [0, 1, 2])
    assert make.calls == 1
    (path,) = folder.iterdir()
    assert path.name.startswith("thing-")


@pytest.mark.parametrize("other", [("thing", 1, b"else"), ("thing", 2, b"content")])
def test_other_content_and_another_version_are_made_anew(folder, other):
    make = Maker()
    cached_arrays("thing", 1, b"content", make)
    cached_arrays(*other, make)
    assert make.calls == 2


@pytest.mark.parametrize("content", [b"", b"no archive", bytes(range(256))])
def test_what_cannot_be_read_is_replaced(folder, content):
    make = Maker()
    cached_arrays("thing", 1, b"content", make)
    (path,) = folder.iterdir()
    path.write_bytes(content)
    for _ in range(2):
        cached_arrays("thing", 1, b"content", make)
    assert make.calls == 2


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "file" / "cache"))
    make = Maker()
    for _ in range(2):
        assert cached_arrays("thing", 1, b"content", make)["numbers"].sum() == 3
    assert make.calls == 2


def test_the_folder_is_the_users_unless_another_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.delenv("KINARM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "kinarm"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == Path(tmp_path) / ".cache" / "kinarm"
    assert "KINARM_CACHE" not in os.environ


def test_without_a_home_it_is_that_of_temporary_files(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for name in ("KINARM_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder() == Path(tempfile.gettempdir()) / "kinarm"
