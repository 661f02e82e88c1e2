"""What the oracle is asked to do."""

from kinarm.policies.oracle import Oracle


def count_calls(monkeypatch) -> list[int]:
    """Let the oracle note how many trials it is asked to solve, call by call."""
    whole, calls = Oracle.solve_batch, []

    def solve_batch(self, starts, goals, **settings):
        calls.append(len(starts))
        return whole(self, starts, goals, **settings)

    monkeypatch.setattr(Oracle, "solve_batch", solve_batch)
    return calls
