"""Policy files that cannot be used: refused in one line, whatever is wrong with them."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
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


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.9, 0.999])
def test_truncated_policy_files_are_refused(run, tmp_path, policy_folder, share):
    whole = (policy_folder / "mine-seed0.npz").read_bytes()
    path = tmp_path / "short.npz"
    path.write_bytes(whole[: int(share * len(whole))])
    check_refused(run("kinarm-eval", "--policy", path), "short.npz")


@pytest.mark.slow
@given(st.data())
@settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_damaged_policy_files_are_refused_or_harmless(run, tmp_path, policy_folder, data):
    """Whatever byte is wrong: an answer, no traceback."""
    content = bytearray((policy_folder / "mine-seed0.npz").read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "damaged.npz"
    path.write_bytes(content)
    answer = run("kinarm-eval", "--policy", path, "--task", "right", "--trials", 1)
    if answer.status != 0:
        check_refused(answer, "damaged.npz")


@pytest.mark.parametrize("content", [b"\x50\x4b\x03\x04", b"\x93NUMPY", b"\x80\x04]"])
def test_files_that_only_begin_well_are_refused(run, tmp_path, content):
    path = tmp_path / "short.npz"
    path.write_bytes(content)
    check_refused(run("kinarm-eval", "--policy", path), "short.npz")


def test_a_compressed_and_damaged_archive_is_refused(run, tmp_path):
    file = io.BytesIO()
    np.savez_compressed(file, format=np.array("kinarm-policy"), version=np.zeros(500))
    content = bytearray(file.getvalue())
    content[60:90] = b"\xff" * 30
    path = tmp_path / "damaged.npz"
    path.write_bytes(content)
    check_refused(run("kinarm-eval", "--policy", path), "damaged.npz")


def test_a_policy_of_the_wrong_size_is_refused(run, tmp_path, policy):
    small = replace(
        policy, mean=np.zeros(41), std=np.ones(41), layers=(Layer(np.zeros((5, 41)), np.zeros(5)),)
    )
    small.save(tmp_path / "small.npz")
    answer = run("kinarm-eval", "--policy", tmp_path / "small.npz", "--trials", 2)
    check_refused(answer, "41", "48")


def test_a_policy_of_another_arm_is_refused(run, policy_folder):
    path = policy_folder / "flange.npz"
    answer = run("kinarm-eval", "--policy", path, "--problem", "right", "--trials", 2)
    check_refused(answer, "'paper_flange'", "'paper'")


def test_a_folder_is_no_policy(run, tmp_path):
    check_refused(run("kinarm-eval", "--policy", tmp_path), str(tmp_path))
