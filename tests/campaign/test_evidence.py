"""A small share of the evidence, and whether it would notice a lie."""

import json

import numpy as np
import pytest

from tests.helpers.configurations import random_configurations

from . import evidence, steps, verdicts
from .engines import MARGIN, SecondEngine

pytestmark = pytest.mark.rare


@pytest.mark.parametrize(
    ("kind", "name", "size", "counted"),
    [
        ("steps", "paper", 4000, ("steps", "steps of the reference")),
        ("contact", "post-paper", 3000, ("configurations", "steps refused")),
        ("floors", "both", 960, ("trials", "successes")),
    ],
)
def test_what_is_claimed_holds(kind, name, size, counted, tmp_path):
    part = evidence.Part(kind, name, size)
    document = evidence.gather(part, tmp_path, "test")
    assert document["checked"]
    assert not any(document["failed"].values()), document["examples"]
    assert document["counts"][counted[0]] >= size
    assert document["counts"][counted[1]] > 0
    assert json.loads((tmp_path / f"{kind}-{name}.json").read_text()) == document
    assert evidence.gather(part, tmp_path, "again") == document


def test_a_floor_that_is_too_high_is_noticed(monkeypatch):
    solve = steps.Oracle.solve_batch

    def raised(self, *scenarios):
        """Bounds that claim a step too much."""
        solutions = solve(self, *scenarios)
        lower = solutions.steps_lower_bound + 1
        return type(solutions)(**{**vars(solutions), "steps_lower_bound": lower})

    monkeypatch.setattr(steps.Oracle, "solve_batch", raised)
    tally = steps.check_steps(evidence.Part("steps", "paper", 1).problem, 20_000, 0)
    assert tally.failed["no success is faster than is proven possible"] > 0


def test_a_proof_that_lies_is_noticed(monkeypatch):
    def all_free(_, asked):
        return np.ones(len(asked), dtype=bool), np.zeros(len(asked), dtype=bool)

    monkeypatch.setattr(verdicts, "proven", all_free)
    tally = verdicts.check_verdicts(evidence.Part("contact", "paper", 1).problem, 600, 0)
    assert tally.failed["what is proven free touches nothing"] > 0
    assert tally.failed["what is proven to touch does"] == 0


def test_the_second_engine_sees_what_coal_sees(simulators):
    pytest.importorskip("mujoco")
    for simulator in (simulators["paper"], simulators["sliding"], simulators["mesh"]):
        engine, model = SecondEngine(simulator.world), simulator.world.contact_model
        asked = random_configurations(simulator, 3, 200)
        truth = model.in_contact(asked)
        np.testing.assert_array_equal([engine.in_contact(q) for q in asked], truth)
        assert 0 < truth.sum() < len(asked)
        assert all(engine.depth(q) > 0 for q in asked[truth])
        closest = simulator.world.clearance(asked)
        for row in np.flatnonzero(~truth & (closest.distance < 0.01))[:20]:
            pair = model.pair_names.index(tuple(closest.bodies[row].tolist()))
            found = engine.distance(asked[row], pair)
            assert found == pytest.approx(closest.distance[row], abs=MARGIN)


def test_parts_add_up_to_the_whole():
    parts = evidence.parts(1.0)
    for kind, whole in evidence.WHOLE.items():
        assert sum(part.size for part in parts if part.kind == kind) >= whole
