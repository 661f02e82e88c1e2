"""Policies that are the same bit for bit."""

from kinarm._fields import to_plain
from kinarm.policies import Policy


def check_equal(one: Policy, other: Policy) -> None:
    """See that two policies are equal, and were made in the same way."""
    for first, second in zip(one.layers, other.layers, strict=True):
        assert first.weights.tobytes() == second.weights.tobytes()
        assert first.bias.tobytes() == second.bias.tobytes()
    assert (one.mean.tobytes(), one.std.tobytes()) == (other.mean.tobytes(), other.std.tobytes())
    assert to_plain(one.provenance) == to_plain(other.provenance)
