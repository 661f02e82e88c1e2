"""Compare an exported policy with what kinarm computed: ``python self_test.py``."""

from __future__ import annotations

import hashlib
import json
import sys
from typing import Any

import numpy as np

ACCURACY = 1e-9
"""Largest error of a command [rad or m]."""


def digest_of(contract: dict[str, Any]) -> str:
    """Hash of a contract without its own."""
    rest = {name: value for name, value in contract.items() if name != "digest"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def self_test(policy: Any) -> list[str]:
    """What of an ``ArmPolicy`` differs from what kinarm exported, if anything, a line each."""
    intact = digest_of(policy.contract) == policy.contract["digest"]
    wrong = [] if intact else ["contract.json was changed after the export"]
    for number, vector in enumerate(policy.contract["self_test"]):
        policy.reset()
        try:
            command = policy.command(vector["joint_positions"], vector["goal"])
        except ValueError as refused:
            wrong.append(f"self-test vector {number}: {refused}")
            continue
        error = np.abs(command - np.array(vector["command"])).max()
        if not error <= ACCURACY:
            wrong.append(f"command of self-test vector {number} is off by {error:.3g}")
    return wrong


if __name__ == "__main__":
    from arm_policy import ArmPolicy  # type: ignore[import-not-found]

    failures = self_test(ArmPolicy())
    sys.stdout.write("\n".join([*failures, "failed" if failures else "passed", ""]))
    sys.exit(1 if failures else 0)
