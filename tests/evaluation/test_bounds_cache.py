"""Bounds of trials on disk: whatever happens to the files, the bounds are right."""

import pytest

from kinarm.evaluation import bounds
from kinarm.policies.provenance import package_versions


@pytest.mark.parametrize("package", bounds.COMPUTING_PACKAGES)
def test_the_version_changes_with_the_packages_that_compute(monkeypatch, package):
    before, installed = bounds.oracle_version(), package_versions()
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, package: "99"})
    assert bounds.oracle_version() != before
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, "torch": "99"})
    assert bounds.oracle_version() == before
