"""What is recorded holds: a change of results needs a commit that says so and records anew."""

import json
from collections.abc import Callable

import pytest
from digests import RECORDED, ars_digests, oracle_digests, rollout_digests, trial_digests

ANEW = "if that is meant: python tests/golden/digests.py --record"


@pytest.mark.parametrize("found", [trial_digests, rollout_digests, ars_digests, oracle_digests])
def test_results_are_those_recorded(found: Callable[[], dict[str, str]]) -> None:
    recorded = json.loads(RECORDED.read_text())
    changed = [name for name, digest in found().items() if recorded.get(name) != digest]
    assert not changed, ANEW
