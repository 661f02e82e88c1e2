"""Files of each kind whose parts are missing or do not fit: refused in one line.

How archives are read is tested with them.
"""

import numpy as np
import pytest

from kinarm.errors import PolicyFileError, RecordingFileError
from kinarm.policies import Policy, load_checkpoint, recipe, save_checkpoint
from kinarm.policies.learners import training_states
from kinarm.recording import load_recordings, record_rollouts, save_recordings


@pytest.fixture(scope="module")
def files(make_policy, simulator, tmp_path_factory):
    """A file of each kind."""
    folder = tmp_path_factory.mktemp("files")
    policy = make_policy()
    policy.save(folder / "policy.npz")
    for learner in ("ars", "ppo"):
        config = recipe(learner, "paper", iterations=2)
        save_checkpoint(folder / f"{learner}.npz", config, next(training_states(config)))
    starts, goals = simulator.sample(np.random.default_rng(0), 1)
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    save_recordings(folder / "recordings.npz", record_rollouts(simulator, rollouts, "mine"))
    return folder


LOAD = {
    "policy": (Policy.load, PolicyFileError),
    "ars": (load_checkpoint, PolicyFileError),
    "ppo": (load_checkpoint, PolicyFileError),
    "recordings": (load_recordings, RecordingFileError),
}


@pytest.mark.parametrize(
    ("kind", "entry", "value"),
    [
        ("policy", "weights_0", None),
        ("policy", "std", np.full(48, -1.0)),
        ("ars", "state.theta", None),
        ("ppo", "state.first_moment", None),
        ("recordings", "states_0", None),
    ],
)
def test_parts_that_are_missing_or_do_not_fit(files, tmp_path, kind, entry, value):
    load, error = LOAD[kind]
    load(files / f"{kind}.npz")
    with np.load(files / f"{kind}.npz") as file:
        spoilt = {**file, entry: value}
    np.savez(tmp_path / "spoilt.npz", **{k: v for k, v in spoilt.items() if v is not None})
    with pytest.raises(error, match=r"^[^\n]*spoilt\.npz[^\n]*$"):
        load(tmp_path / "spoilt.npz")
