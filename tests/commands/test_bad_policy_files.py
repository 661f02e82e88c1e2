"""Policy files that cannot be used: refused in one line, whatever is wrong with them."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from refusals import check_refused

from kinarm.policies import Layer


def archive(**changes) -> bytes:
    """A file as Policy.save writes it, with some arrays replaced; None leaves one out."""
    arrays = {"format": np.array("kinarm-policy"), "version": np.array(2), **changes}
    file = io.BytesIO()
    np.savez(file, **{key: value for key, value in arrays.items() if value is not None})
    return file.getvalue()


def single_array() -> bytes:
    file = io.BytesIO()
    np.save(file, np.zeros(3))
    return file.getvalue()


@pytest.fixture
def valid(policy_folder) -> dict[str, np.ndarray]:
    with np.load(policy_folder / "mine-seed0.npz") as content:
        return dict(content)


@pytest.mark.parametrize("program", ["kinarm-eval", "kinarm-bench"])
@pytest.mark.parametrize(
    "case", ["empty", "text", "array", "foreign", "future", "bare", "nan", "provenance", "pickle"]
)
def test_unusable_policy_files_are_refused(run, tmp_path, valid, program, case):
    header = json.loads(str(valid["header"]))
    incomplete = json.dumps({**header, "provenance": {"algorithm": "ars"}})
    contents = {
        "empty": b"",
        "text": b"hello",
        "array": single_array(),
        "foreign": archive(format=np.array("other-policy")),
        "future": archive(**{**valid, "version": np.array(9)}),
        "bare": archive(),
        "nan": archive(**{**valid, "mean": np.full(48, np.nan)}),
        "provenance": archive(**{**valid, "header": np.array(incomplete)}),
        "pickle": archive(**{**valid, "mean": np.array([header], dtype=object)}),
    }
    path = tmp_path / "bad.npz"
    path.write_bytes(contents[case])
    words = {"future": ["version 9"], "foreign": ["other-policy"]}.get(case, [])
    check_refused(run(program, "--policy", path), "bad.npz", *words)


def test_a_policy_of_the_wrong_size_is_refused(run, tmp_path, policy):
    small = replace(
        policy, mean=np.zeros(41), std=np.ones(41), layers=(Layer(np.zeros((5, 41)), np.zeros(5)),)
    )
    small.save(tmp_path / "small.npz")
    answer = run("kinarm-eval", "--policy", tmp_path / "small.npz", "--trials", 2)
    check_refused(answer, "41", "48")
