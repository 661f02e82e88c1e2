"""Where a policy comes from."""

import json
import re
from importlib import metadata

import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import Provenance
from kinarm.policies.provenance import package_versions, source_commit


def test_round_trip_through_json(provenance):
    text = json.dumps(provenance.to_json())
    assert Provenance.from_json(json.loads(text)) == provenance


@pytest.mark.parametrize("entry", ["algorithm", "seed", "arm_digest", "commit"])
def test_missing_entry_is_named(provenance, entry):
    entries = provenance.to_json()
    del entries[entry]
    with pytest.raises(InvalidInputError, match=f"missing or unknown entries: {entry}"):
        Provenance.from_json(entries)


def test_unknown_entry_is_named(provenance):
    with pytest.raises(InvalidInputError, match="entries: mood"):
        Provenance.from_json({**provenance.to_json(), "mood": "good"})


def test_versions_of_what_matters():
    versions = package_versions()
    for package in ("numpy", "numba", "pin", "coal"):
        assert versions[package] == metadata.version(package)
    assert re.fullmatch(r"3\.\d+\.\d+.*", versions["python"])


def test_commit_looks_like_one():
    assert re.fullmatch(r"([0-9a-f]{7,40}|.+-g[0-9a-f]{7,40})?(-dirty)?", source_commit())
