"""Archives: what is written comes back, and anything else is refused in one line."""

import gc
import io
import pickle
import zipfile

import numpy as np
import pytest

from kinarm._files import cache_folder, cached_arrays, load_archive, save_archive
from kinarm.errors import PolicyFileError

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

    @pytest.mark.parametrize(
        ("name", "entry"),
        [
            ("header", np.array("{")),
            ("numbers", np.array([{}], dtype=object)),
        ],
    )
    def test_bad_entry(self, saved, name, entry):
        with np.load(saved, allow_pickle=False) as file:
            entries = dict(file) | {name: entry}
        np.savez(saved, **{name: entry for name, entry in entries.items() if entry is not None})
        refused(saved, "thing")


class TestDamage:
    def test_truncated_anywhere(self, saved):
        content = saved.read_bytes()
        for length in range(0, len(content), 97):
            saved.write_bytes(content[:length])
            with pytest.raises(PolicyFileError, match=f"^[^\n]*{saved.name}[^\n]*$"):
                load(saved)
        gc.collect(1)

    def test_flipped_bits_are_noticed_or_harmless(self, saved):
        content, noticed = saved.read_bytes(), 0
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

    def test_what_cannot_be_read_is_replaced(self, folder, look_up):
        look_up()
        (path,) = folder.iterdir()
        path.write_bytes(b"no archive")
        for _ in range(2):
            look_up()
        assert look_up.made == 2

    def test_where_nothing_can_be_written_nothing_is_kept(self, folder, look_up):
        folder.write_text("")
        for _ in range(2):
            look_up()
        assert look_up.made == 2

    def test_the_folder_is_the_users_unless_another_is_named(self, tmp_path, monkeypatch):
        monkeypatch.setenv("HOME", str(tmp_path / "home"))
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.delenv("KINARM_CACHE", raising=False)
        assert cache_folder() == tmp_path / "home" / ".cache" / "kinarm"
        for variable, folder in (
            ("XDG_CACHE_HOME", tmp_path / "kinarm"),
            ("KINARM_CACHE", tmp_path),
        ):
            monkeypatch.setenv(variable, str(tmp_path))
            assert cache_folder() == folder
