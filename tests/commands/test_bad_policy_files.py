"""Policy files that cannot be used: refused in one line, whatever is wrong with them."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import check_refused

from kinarm.policies import Layer


@pytest.mark.parametrize("program", ["kinarm-eval", "kinarm-bench"])
@pytest.mark.parametrize("case", ["empty", "foreign", "pickle"])
def test_unusable_policy_files_are_refused(run, tmp_path, policy_folder, program, case):
    with np.load(policy_folder / "mine-seed0.npz") as content:
        arrays = dict(content)
    changes = {
        "empty": {},
        "foreign": {**arrays, "format": np.array("other-policy")},
        "pickle": {**arrays, "mean": np.array([{}], dtype=object)},
    }
    np.savez(tmp_path / "bad.npz", **changes[case])
    words = ["other-policy"] if case == "foreign" else []
    check_refused(run(program, "--policy", tmp_path / "bad.npz"), "bad.npz", *words)


def test_a_policy_of_the_wrong_size_is_refused(run, tmp_path, policy):
    small = replace(
        policy, mean=np.zeros(41), std=np.ones(41), layers=(Layer(np.zeros((5, 41)), np.zeros(5)),)
    )
    small.save(tmp_path / "small.npz")
    answer = run("kinarm-eval", "--policy", tmp_path / "small.npz", "--trials", 2)
    check_refused(answer, "41", "48")
