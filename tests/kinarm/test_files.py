"""Atomic writing, and seeing beforehand that a file can be written."""

import multiprocessing
import os
import signal
import stat
import time

import pytest

from kinarm._files import (
    check_folder,
    check_output,
    is_being_written,
    only_writer,
    write_atomically,
    write_text,
)
from kinarm.errors import OutputError


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


def test_permissions_follow_the_mask(tmp_path):
    path = tmp_path / "file.bin"
    before = os.umask(0o027)
    try:
        write_atomically(path, lambda file: file.write(b""))
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_stays_and_its_file_is_written(tmp_path):
    real, link = tmp_path / "far" / "real.bin", tmp_path / "link.bin"
    real.parent.mkdir()
    link.symlink_to(real)
    for content in (b"first", b"second"):
        write_atomically(link, lambda file, content=content: file.write(content))
        assert link.is_symlink()
        assert real.read_bytes() == content
    assert list(real.parent.iterdir()) == [real]


def _write_slowly(path):
    def write(file):
        file.write(b"half")
        file.flush()
        time.sleep(1)

    write_atomically(path, write)


def _hold(path, held):
    with only_writer(path):
        held.set()
        time.sleep(60)


class TestOtherWriters:
    @pytest.fixture
    def writer(self, tmp_path):
        """A process that has half written a file, and goes on in a second."""
        process = multiprocessing.get_context("spawn").Process(
            target=_write_slowly, args=(tmp_path / "file.bin",)
        )
        process.start()
        while not any(left.stat().st_size for left in tmp_path.iterdir()):
            time.sleep(0.01)
        yield process
        process.kill()
        process.join()

    def test_what_was_killed_is_written_over(self, tmp_path, writer):
        os.kill(writer.pid, signal.SIGKILL)
        writer.join()
        assert [path.name for path in tmp_path.iterdir()] == [".file.bin.part"]
        write_text(tmp_path / "file.bin", "new")
        assert [path.read_text() for path in tmp_path.iterdir()] == ["new"]

    def test_they_are_waited_for(self, tmp_path, writer):
        write_text(tmp_path / "file.bin", "new")
        writer.join()
        assert [path.read_text() for path in tmp_path.iterdir()] == ["new"]


class TestOnlyWriter:
    def test_another_process_is_refused_until_the_first_ends(self, tmp_path):
        path, context = tmp_path / "file.bin", multiprocessing.get_context("spawn")
        held = context.Event()
        process = context.Process(target=_hold, args=(path, held))
        process.start()
        assert held.wait(30)
        refusal = pytest.raises(OutputError, match=r"another process is writing '.*file\.bin'")
        with refusal, only_writer(path):
            pass
        process.kill()
        process.join()
        with only_writer(path):
            write_text(path, "free again")
        assert list(tmp_path.iterdir()) == [path]

    def test_what_it_writes_is_being_written(self, tmp_path):
        path = tmp_path / "one"
        with only_writer(path):
            assert is_being_written(path)
        (tmp_path / ".one.lock").touch()  # which a process that was killed left behind
        assert not is_being_written(path)


def test_a_folder_is_made_unless_a_file_is_in_the_way(tmp_path):
    check_folder(tmp_path / "new" / "newer")
    assert (tmp_path / "new" / "newer").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write to .*file"):
        check_folder(tmp_path / "file" / "below")


class TestCheckOutput:
    def test_existing_file_has_to_be_given_up(self, tmp_path):
        path = tmp_path / "old.npz"
        path.write_text("old")
        with pytest.raises(OutputError, match=r"old.npz' exists") as told:
            check_output(path)
        assert str(told.value).endswith("exists: --overwrite replaces it")
        assert told.value.__notes__ == ["in Python: overwrite=True"]
        check_output(path, overwrite=True)
        assert path.read_text() == "old"

    def test_other_endings_are_refused(self, tmp_path):
        with pytest.raises(OutputError, match=r"ends in .npz, got .*policy.npz.txt"):
            check_output(tmp_path / "new" / "policy.npz.txt", suffix=".npz")
        assert not (tmp_path / "new").exists()
