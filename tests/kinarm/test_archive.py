"""Archives: what is written comes back, and anything else is refused in one line."""

import gc
import io
import pickle
import tempfile
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from kinarm._archive import cache_folder, cached_arrays, load_archive, reading, save_archive
from kinarm.errors import InvalidInputError, PolicyFileError

ARRAYS = {
    "numbers": np.linspace(0, 1, 40).reshape(8, 5),
    "flags": np.array([True, False]),
    "names": np.array(["a", "é"]),
    "nothing": np.zeros((0, 3)),
}
HEADER = {"name": "né", "count": 3, "list": [1, 2.5, None], "table": {"a": True}}


@pytest.fixture
def saved(tmp_path):
    """An archive, to be spoilt."""
    path = tmp_path / "thing.npz"
    save_archive(path, "test thing", 3, ARRAYS, HEADER)
    return path


def load(path, **changes):
    expected = {"kind": "test thing", "version": 3, "error": PolicyFileError, **changes}
    return load_archive(path, **expected)


def refused(path, message, **changes):
    error = changes.get("error", PolicyFileError)
    with pytest.raises(error, match=message) as caught:
        load(path, **changes)
    gc.collect(1)  # a file left open is reported here, not in a later test
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def rewritten(path, **changes):
    """The same archive with some entries replaced, or left out if they are None."""
    with np.load(path, allow_pickle=False) as file:
        entries = dict(file) | changes
    np.savez(path, **{name: entry for name, entry in entries.items() if entry is not None})
    return path


@pytest.mark.parametrize("compress", [False, True])
def test_what_is_written_comes_back(tmp_path, compress):
    path = tmp_path / "thing"
    save_archive(path, "test thing", 3, ARRAYS, HEADER, compress=compress)
    header, arrays = load(path)
    assert header == HEADER
    assert list(arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(arrays[name], array)


def test_same_content_same_bytes(saved, tmp_path):
    again = tmp_path / "again.npz"
    save_archive(again, "test thing", 3, ARRAYS, dict(reversed(HEADER.items())))
    assert again.read_bytes() == saved.read_bytes()


def test_a_failed_write_leaves_the_old_file(saved):
    before = saved.read_bytes()
    with pytest.raises(TypeError):
        save_archive(saved, "test thing", 3, ARRAYS, {"name": object()})
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]


class TestMismatch:
    def test_missing(self, tmp_path):
        refused(tmp_path / "gone.npz", "cannot read test thing .*No such file")

    def test_another_kind(self, saved):
        refused(saved, "holds 'kinarm-test-thing', not 'kinarm-policy'", kind="policy")

    @pytest.mark.parametrize(("version", "age"), [(2, "a later"), (4, "an earlier")])
    def test_another_version(self, saved, version, age):
        message = f"has format version 3, of {age} kinarm; this one reads {version}"
        refused(saved, message, version=version)

    def test_foreign_npz(self, saved):
        np.savez(saved, weights=np.zeros(3))
        refused(saved, "is not a kinarm test thing")

    @pytest.mark.parametrize("name", ["version", "header"])
    def test_missing_entry(self, saved, name):
        refused(rewritten(saved, **{name: None}), "is not a complete kinarm test thing")

    @pytest.mark.parametrize(
        ("name", "entry"),
        [
            ("version", np.array("one")),
            ("version", np.zeros(2)),
            ("version", np.array(np.nan)),
            ("header", np.array("{")),
            ("header", np.array("[" * 10_000)),
            ("header", np.array("[]")),
            ("header", np.array("3")),
            ("header", np.zeros(3)),
            ("format", np.array("something-else")),
            ("format", np.zeros(3)),
            ("numbers", np.array([{}], dtype=object)),
            ("format", np.array([{}], dtype=object)),
        ],
    )
    def test_bad_entry(self, saved, name, entry):
        refused(rewritten(saved, **{name: entry}), "thing")


class TestDamage:
    @pytest.mark.parametrize("compress", [False, True])
    def test_truncated_anywhere(self, saved, compress):
        save_archive(saved, "test thing", 3, ARRAYS, HEADER, compress=compress)
        content = saved.read_bytes()
        for length in range(0, len(content), 97):
            saved.write_bytes(content[:length])
            with pytest.raises(PolicyFileError, match=f"^[^\n]*{saved.name}[^\n]*$"):
                load(saved)
        gc.collect(1)

    @pytest.mark.parametrize("compress", [False, True])
    def test_flipped_bits_are_noticed_or_harmless(self, saved, compress):
        save_archive(saved, "test thing", 3, ARRAYS, HEADER, compress=compress)
        content = saved.read_bytes()
        noticed = 0
        for place in range(0, len(content), 41):
            spoilt = bytearray(content)
            spoilt[place] ^= 0xA5
            saved.write_bytes(spoilt)
            try:
                header, arrays = load(saved)
            except PolicyFileError:
                noticed += 1
                continue
            assert header == HEADER
            for name in set(arrays) & set(ARRAYS):
                np.testing.assert_array_equal(arrays[name], ARRAYS[name])
        gc.collect(1)
        assert noticed > 20

    @pytest.mark.parametrize(
        "content",
        [
            b"",
            b"hello\n",
            b"\x00" * 100,
            b"PK\x03\x04junk",
            b"\x93NUMPY\x01\x00",
            pickle.dumps({"format": "kinarm-test-thing"}),
        ],
    )
    def test_other_content(self, saved, content):
        saved.write_bytes(content)
        refused(saved, "thing")

    def test_pickles_are_never_run(self, saved, tmp_path):
        class Trap:
            def __reduce__(self):
                return (tmp_path.joinpath("sprung").write_text, ("",))

        array = io.BytesIO()
        np.save(array, np.array([Trap()], dtype=object), allow_pickle=True)
        with zipfile.ZipFile(saved, "a") as file:
            file.writestr("trap.npy", array.getvalue())
        refused(saved, "thing")
        saved.write_bytes(pickle.dumps(Trap()))
        refused(saved, "thing")
        assert not (tmp_path / "sprung").exists()


class TestReading:
    @pytest.mark.parametrize(
        ("raised", "message"),
        [
            (KeyError("mean"), "'a' is not a complete kinarm policy: 'mean'"),
            (ValueError("one\ntwo"), "'a' is not a complete kinarm policy: one"),
            (InvalidInputError("bad"), "'a' is not a complete kinarm policy: bad"),
            (FileNotFoundError(2, "gone"), "cannot read policy 'a': gone"),
            (PolicyFileError("as it is"), "as it is"),
        ],
    )
    def test_turns_what_is_raised_into_one_line(self, raised, message):
        with pytest.raises(PolicyFileError) as caught, reading("'a'", "policy", PolicyFileError):
            raise raised
        assert str(caught.value) == message


class TestHostileFiles:
    """Files that claim more than they are."""

    def member(self, saved, content):
        with zipfile.ZipFile(saved, "a") as archive:
            archive.writestr("extra.npy", content)

    def test_a_bomb_is_not_inflated(self, saved, monkeypatch):
        monkeypatch.setattr("kinarm._archive.SMALL", 10**7)
        np.savez_compressed(saved, format=np.array("kinarm-test-thing"), bomb=np.zeros(10**7))
        assert saved.stat().st_size < 10**6
        tracemalloc.start()
        refused(saved, "claims to hold 80 MB")
        assert tracemalloc.get_traced_memory()[1] < 5e6
        tracemalloc.stop()

    @pytest.mark.parametrize("shape", ["(99999999999,)", "(3, 3)", "(-1, -6)"])
    def test_a_shape_that_the_content_does_not_have(self, saved, shape):
        buffer = io.BytesIO()
        header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
        header = header + " " * (117 - len(header)) + "\n"
        buffer.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little"))
        buffer.write(header.encode() + np.zeros(6).tobytes())
        self.member(saved, buffer.getvalue())
        refused(saved, "is not a complete kinarm test thing")

    @pytest.mark.parametrize(
        "array", [np.zeros(3, complex), np.zeros(2, "S4"), np.zeros(2, "M8[s]")]
    )
    def test_arrays_of_other_types(self, saved, array):
        buffer = io.BytesIO()
        np.save(buffer, array)
        self.member(saved, buffer.getvalue())
        refused(saved, "extra holds")


class TestCache:
    """Arrays that can be computed anew are kept in the user's cache folder."""

    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "cache"))
        return tmp_path / "cache"

    @pytest.fixture
    def look_up(self):
        """Look arrays up; counts how often they are made."""

        def call(kind="thing", version=1, content=b"content"):
            def make():
                call.made += 1
                return {"numbers": np.arange(3.0)}

            arrays = cached_arrays(kind, version, content, make)
            np.testing.assert_array_equal(arrays["numbers"], [0, 1, 2])

        call.made = 0
        return call

    def test_made_once_for_the_same_content_and_version(self, folder, look_up):
        for _ in range(3):
            look_up()
        assert look_up.made == 1
        assert [path.name.split("-")[0] for path in folder.iterdir()] == ["thing"]
        look_up(content=b"else")
        look_up(version=2)
        assert look_up.made == 3

    @pytest.mark.parametrize("content", [b"", b"no archive", bytes(range(256))])
    def test_what_cannot_be_read_is_replaced(self, folder, look_up, content):
        look_up()
        (path,) = folder.iterdir()
        path.write_bytes(content)
        for _ in range(2):
            look_up()
        assert look_up.made == 2

    def test_where_nothing_can_be_written_nothing_is_kept(self, tmp_path, monkeypatch, look_up):
        (tmp_path / "file").write_text("")
        monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "file" / "cache"))
        for _ in range(2):
            look_up()
        assert look_up.made == 2

    def test_the_folder_is_the_users_unless_another_is_named(self, tmp_path, monkeypatch):
        monkeypatch.setenv("KINARM_CACHE", str(tmp_path))
        assert cache_folder() == tmp_path
        monkeypatch.delenv("KINARM_CACHE")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        assert cache_folder() == tmp_path / "kinarm"
        monkeypatch.delenv("XDG_CACHE_HOME")
        monkeypatch.setenv("HOME", str(tmp_path))
        assert cache_folder() == tmp_path / ".cache" / "kinarm"

    def test_without_a_home_it_is_that_of_temporary_files(self, monkeypatch):
        def homeless():
            raise RuntimeError("Could not determine home directory.")

        for name in ("KINARM_CACHE", "XDG_CACHE_HOME"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setattr("kinarm._archive.Path.home", homeless)
        assert cache_folder() == Path(tempfile.gettempdir()) / "kinarm"
