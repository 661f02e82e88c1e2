"""Bounds of trials on disk: whatever happens to the files, the bounds are right."""

import io

import numpy as np
import pytest
from oracle_calls import count_calls
from trial_bounds import draw, same

from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.policies.provenance import package_versions


def archive(arrays: dict[str, np.ndarray]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


DAMAGES = {
    "all but the end": lambda whole, _: whole[:-1],
    "foreign": lambda *_: archive({"weights": np.zeros(3)}),
    "one missing": lambda _, arrays: archive(
        {k: v for k, v in arrays.items() if k != "proof_complete"}
    ),
    "objects": lambda _, arrays: archive({**arrays, "reasons": np.array([None] * 3)}),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_file_that_cannot_be_used_is_replaced(folder, solutions, monkeypatch, damage):
    oracle_bounds(draw())
    (path,) = folder.iterdir()
    path.write_bytes(DAMAGES[damage](path.read_bytes(), vars(solutions)))
    calls = count_calls(monkeypatch)
    assert same(oracle_bounds(draw()), solutions)
    assert same(oracle_bounds(draw()), solutions)
    assert calls == [3]
    assert list(folder.iterdir()) == [path]


@pytest.mark.parametrize("package", bounds.COMPUTING_PACKAGES)
def test_the_version_changes_with_the_packages_that_compute(monkeypatch, package):
    before, installed = bounds.oracle_version(), package_versions()
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, package: "99"})
    assert bounds.oracle_version() != before
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, "torch": "99"})
    assert bounds.oracle_version() == before
