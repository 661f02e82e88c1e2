"""What needs a library of an extra names both, in one line, where it is missing."""

import sys
from pathlib import Path

import pytest

from kinarm.arm_specification import ArmSpecification
from kinarm.errors import MissingExtraError
from kinarm.evaluation.experiments import search
from kinarm.moveit import import_problem
from kinarm.policies import Policy, sb3_vec_env
from kinarm.policies.conversion.layers import module_pieces
from kinarm.policies.learners import find_learner
from kinarm.policies.running.ur import URArm
from kinarm.scene import Mount
from kinarm.viewer import canvas

NEEDED = {
    "raylib-software, render": ("raylib", canvas._raylib.__wrapped__),
    "PyYAML, robots": (
        "yaml",
        lambda: import_problem("a.yaml", "b.yaml", ArmSpecification(), Mount()),
    ),
    "torch, sb3": ("torch", lambda: next(module_pieces(None))),
    "stable-baselines3, sb3": (
        "stable_baselines3.common.save_util",
        lambda: Policy.from_sb3(Path("model.zip"), "right"),
    ),
    "stable_baselines3, sb3": ("stable_baselines3", lambda: sb3_vec_env("right", 2)),
    "sb3_contrib, zoo": ("sb3_contrib", find_learner("tqc").check_installed),
    "ur_rtde, ur": ("rtde_receive", lambda: URArm("10.0.0.2")),
    "optuna, tune": ("optuna", lambda: search._open_search(None, Path())),
}


@pytest.mark.parametrize(("words", "module", "use"), [(k, *v) for k, v in NEEDED.items()])
def test_a_missing_library_is_named_with_its_extra(monkeypatch, words, module, use):
    package, extra = words.split(", ")
    if module in ("stable_baselines3", "sb3_contrib"):  # they come after torch
        pytest.importorskip("stable_baselines3")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as told:
        use()
    assert str(told.value) == f"{package} is not installed: pip install 'kinarm[{extra}]'"
