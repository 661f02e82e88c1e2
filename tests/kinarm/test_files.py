"""Atomic writing."""

import os
import stat

import pytest

from kinarm._files import check_folder, write_atomically
from kinarm.errors import OutputError


def test_writes_the_content(tmp_path):
    path = tmp_path / "file.bin"
    write_atomically(path, lambda file: file.write(b"content"))
    assert path.read_bytes() == b"content"
    assert list(tmp_path.iterdir()) == [path]


def test_replaces_an_existing_file(tmp_path):
    path = tmp_path / "file.bin"
    path.write_bytes(b"a much longer old content")
    write_atomically(path, lambda file: file.write(b"new"))
    assert path.read_bytes() == b"new"


def test_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.bin"
    path.write_bytes(b"old")

    def fail(file):
        file.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, fail)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_failure_leaves_no_new_file(tmp_path):
    def fail(_):
        raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        write_atomically(tmp_path / "file.bin", fail)
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(tmp_path):
    with pytest.raises(OutputError, match="cannot write .*file.bin.*No such file"):
        write_atomically(tmp_path / "gone" / "file.bin", lambda file: file.write(b""))


def test_folder_in_the_way(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match="cannot write .*taken.*directory"):
        write_atomically(tmp_path / "taken", lambda file: file.write(b""))
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_permissions_follow_the_mask_or_the_old_file(tmp_path):
    path = tmp_path / "file.bin"
    before = os.umask(0o027)
    try:
        write_atomically(path, lambda file: file.write(b""))
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o600)
    write_atomically(path, lambda file: file.write(b""))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_full_disk_is_reported(tmp_path):
    def fail(_):
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="cannot write .*No space left"):
        write_atomically(tmp_path / "file.bin", fail)
    assert list(tmp_path.iterdir()) == []


class TestCheckFolder:
    def test_existing_folder_is_left_as_it_is(self, tmp_path):
        check_folder(tmp_path)
        assert list(tmp_path.iterdir()) == []

    def test_missing_folder_is_created_only_if_asked(self, tmp_path):
        with pytest.raises(OutputError, match="new"):
            check_folder(tmp_path / "new")
        assert not (tmp_path / "new").exists()
        check_folder(tmp_path / "new", create=True)
        assert (tmp_path / "new").is_dir()

    def test_file_in_the_way(self, tmp_path):
        (tmp_path / "file").write_text("")
        for create in (False, True):
            with pytest.raises(OutputError, match="file"):
                check_folder(tmp_path / "file", create=create)
