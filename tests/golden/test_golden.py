"""What is recorded holds: other results need another semantics version, recorded anew."""

import json
from collections.abc import Callable

import pytest
from digests import (
    RAISE,
    RECORDED,
    ars_digests,
    changed,
    oracle_digests,
    ppo_digests,
    renewed,
    rollout_digests,
    seal,
    trial_digests,
)

from kinarm import SEMANTICS
from kinarm.policies.oracle import ORACLE_SEMANTICS

RECORD = json.loads(RECORDED.read_text())
ANEW = f"results changed: {RAISE}, and run python tests/golden/digests.py --record"


@pytest.mark.parametrize("found", [trial_digests, rollout_digests, ars_digests, oracle_digests])
def test_results_are_those_recorded(found: Callable[[], dict[str, str]]) -> None:
    assert not changed(RECORD, found()), ANEW


@pytest.mark.slow
def test_ppo_is_as_recorded() -> None:
    assert not changed(RECORD, ppo_digests()), ANEW


def test_they_were_recorded_under_this_version() -> None:
    versions = (RECORD["semantics"], RECORD["oracle_semantics"])
    expected = (SEMANTICS, ORACLE_SEMANTICS)
    assert versions == expected, "run python tests/golden/digests.py --record"


def test_they_were_not_edited_by_hand() -> None:
    assert RECORD["seal"] == seal(RECORD), "run python tests/golden/digests.py --record"


OLD = {
    "semantics": SEMANTICS,
    "oracle_semantics": ORACLE_SEMANTICS,
    "digests": {"trials": "a", "ppo x": "b"},
}


class TestRecordingAnew:
    @pytest.mark.parametrize("digests", [{"trials": "z", "ppo x": "b"}, {"ppo x": "z"}, {}])
    def test_other_results_need_another_version(self, digests: dict[str, str]) -> None:
        with pytest.raises(SystemExit, match="raise SEMANTICS"):
            renewed(OLD, digests)
        made = renewed({**OLD, "semantics": "0"}, digests)
        assert made["digests"] == digests
        assert made["seal"] == seal(made)

    def test_other_bounds_need_another_version_of_the_oracle_alone(self) -> None:
        old = {**OLD, "digests": {**OLD["digests"], "oracle x": "c"}}
        digests = {**OLD["digests"], "oracle x": "d"}
        with pytest.raises(SystemExit, match="oracle x"):
            renewed(old, digests)
        assert renewed({**old, "oracle_semantics": "0"}, digests)["digests"] == digests
        with pytest.raises(SystemExit, match="trials"):
            renewed({**old, "oracle_semantics": "0"}, {**digests, "trials": "z"})

    def test_what_follows_from_another_policy_needs_none(self) -> None:
        old = {**OLD, "digests": {**OLD["digests"], "rollouts": "p a"}}
        digests = {**OLD["digests"], "rollouts": "q b"}
        assert renewed(old, digests)["digests"] == digests
        with pytest.raises(SystemExit, match="rollouts"):
            renewed(old, {**digests, "rollouts": "p b"})
        with pytest.raises(SystemExit, match="rollouts"):
            renewed(old, OLD["digests"])

    def test_further_digests_do_not(self) -> None:
        digests = {**OLD["digests"], "oracle": "c"}
        assert renewed(OLD, digests)["digests"] == digests
