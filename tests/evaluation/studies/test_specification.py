"""Study files: what they can say, and what is refused."""

import math

import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.studies.ranges import LARGEST
from kinarm.evaluation.studies.specification import StudySpecification

FILE = """
learner = "ars"
problems = ["right", "own.toml"]
seeds = 3

[trials]
count = 50

[fixed]
iterations = 7
reward.success = 2.0

[grid]
step_size = [0.01, 0.05]
"problem.task.start_spread" = [0.2, 1.0]

[random]
count = 4
noise = { low = 0.001, high = 0.1, log = true }
problem.task.horizon = { low = 10, high = 12 }
episodes = [1, 2]
"""


def made(**entries):
    return StudySpecification.from_json({"name": "mine", **entries}, "study")


@pytest.fixture
def specification(tmp_path):
    path = tmp_path / "steps.toml"
    path.write_text(FILE)
    (tmp_path / "own.toml").touch()
    return StudySpecification.load(path)


class TestFile:
    def test_what_it_says(self, specification, tmp_path):
        assert specification.name == "steps"
        assert specification.learners == ("ars",)
        assert specification.recipes == ("paper",)
        assert specification.problems == ("right", str(tmp_path / "own.toml"))
        assert specification.trials.count == 50
        assert specification.fixed == {"iterations": 7, "reward.success": 2.0}
        assert list(specification.grid) == ["step_size", "problem.task.start_spread"]

    def test_written_and_read_again(self, specification):
        assert StudySpecification.from_json(specification.to_json(), "it") == specification

    def test_it_is_found_from_elsewhere(self, tmp_path):
        (tmp_path / "study.toml").write_text('recipe = "mine.toml"\nproblem = "gone.toml"')
        (tmp_path / "mine.toml").touch()
        read = StudySpecification.load(tmp_path / "study.toml")
        assert read.recipes == (str(tmp_path / "mine.toml"),)
        assert read.problems == ("gone.toml",)


class TestChoices:
    def test_every_value_with_every_other(self, specification):
        choices = list(specification.choices())
        assert len(choices) == 2 * 2 * 4
        grid = {(c["step_size"], c["problem.task.start_spread"]) for c in choices}
        assert grid == {(0.01, 0.2), (0.01, 1.0), (0.05, 0.2), (0.05, 1.0)}

    def test_draws_are_the_same_for_every_value_of_the_grid(self, specification):
        choices = list(specification.choices())
        assert [c["noise"] for c in choices[:4]] == [c["noise"] for c in choices[4:8]]

    def test_more_draws_begin_with_the_same_ones(self):
        entries = {"noise": {"low": 0.0, "high": 1.0}, "seed": 3}
        few, many = (list(made(random={"count": n, **entries}).choices()) for n in (3, 20))
        assert many[:3] == few
        assert len({c["noise"] for c in many}) == 20

    def test_another_seed_draws_others(self):
        ranges = {"count": 5, "noise": {"low": 0.0, "high": 1.0}}
        first, second = (list(made(random={**ranges, "seed": n}).choices()) for n in (0, 1))
        assert first != second

    def test_draws_fill_their_range(self):
        ranges = {"low": 1, "high": 3}, {"low": 0.001, "high": 10.0, "log": True}
        entries = {"count": 400, "episodes": ranges[0], "noise": ranges[1], "size": ["a", "b"]}
        drawn = list(made(random=entries).choices())
        assert {c["episodes"] for c in drawn} == {1, 2, 3}
        assert {c["size"] for c in drawn} == {"a", "b"}
        logs = sorted(math.log10(c["noise"]) for c in drawn)
        assert -3 <= logs[0] < -2.9
        assert 0.9 < logs[-1] <= 1
        assert logs[200] == pytest.approx(-1, abs=0.4)

    @pytest.mark.parametrize("number", [float, int])
    @pytest.mark.parametrize("log", [True, False])
    def test_draws_from_the_widest_ranges_are_finite(self, log, number):
        low = 1 / LARGEST if log else -LARGEST
        widest = {"low": number(low) or 1, "high": number(LARGEST), "log": log}
        drawn = [c["noise"] for c in made(random={"count": 9, "noise": widest}).choices()]
        assert all(widest["low"] <= value <= widest["high"] for value in drawn)
        assert len(set(drawn)) == 9

    def test_nothing_varies(self):
        assert list(made().choices()) == [{}]


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"seeds": 0}, "seeds must be a whole number of at least 1, got 0"),
        ({"seeds": 2**63}, "seeds must be at most 100000, got 9223372036854775808"),
        (
            {"random": {"count": 10**6, "noise": [1]}},
            "random.count must be at most 100000, got 1000000",
        ),
        (
            {"seeds": 1000, "grid": {"noise": [1, 2], "step_size": [0.1] * 100}},
            "a study has at most 100,000 trainings, this one 200,000",
        ),
        ({"learners": []}, "learners must not be empty"),
        ({"problems": ["right", "right"]}, "problems names the same twice: right, right"),
        ({"grid": {"noise": []}}, "grid.noise must be a list of at least one value, got []"),
        ({"grid": {"noise": 0.1}}, "grid.noise must be a list of at least one value, got 0.1"),
        ({"grid": {"noise": [1]}, "fixed": {"noise": 1}}, "'noise' stands in fixed and in grid"),
        ({"random": {"noise": [1]}}, "random.count must be a whole number of at least 1"),
        ({"random": {"count": 1, "noise": {"low": 1, "high": 1}}}, "low below high"),
        ({"random": {"count": 1, "noise": {"low": 1, "hihg": 2}}}, "low below high"),
        ({"random": {"count": 1, "noise": {"low": True, "high": 2}}}, "low below high"),
        ({"random": {"count": 1, "noise": []}}, "random.noise must be a list of at least one"),
        ({"random": {"count": 1, "noise": 3}}, "random.noise must be a list of values"),
        (
            {"random": {"count": 1, "noise": {"low": 0, "high": 2, "log": True}}},
            "random.noise.low must be greater than 0 with log, got 0",
        ),
        (
            {"random": {"count": 1, "noise": {"low": 1, "high": 10**400, "log": True}}},
            "random.noise.high must be between 1e-30 and 1e+30, got 10000",
        ),
        (
            {"search": {"count": 1, "noise": {"low": -(10**400), "high": 1}}},
            "search.noise.low must be between -1e+30 and 1e+30, got -10000",
        ),
        (
            {"random": {"count": 1, "noise": {"low": 0.0, "high": math.inf}}},
            "random.noise.high must be between -1e+30 and 1e+30, got inf",
        ),
        (
            {"random": {"count": 1, "noise": {"low": 5e-324, "high": 1, "log": True}}},
            "random.noise.low must be between 1e-30 and 1e+30, got 5e-324",
        ),
        ({"trials": {"count": 0}}, "trials: count must be a whole number of at least 1"),
        ({"trials": {"count": 10**8}}, "trials: count must be at most 10000000, got 100000000"),
        ({"trials": {"per_decade": 10**4}}, "trials: per_decade must be at most 1000, got 10000"),
        ({"trials": {"cuont": 5}}, "unknown key 'trials.cuont'; available: count"),
        ({"sedes": 5}, "unknown key 'sedes'; available: name, learners"),
        ({"grid": 5}, "grid must be a table, got 5"),
    ],
)
def test_refused(entries, words):
    with pytest.raises(InvalidInputError, match="^study: ") as caught:
        made(**entries)
    assert words in str(caught.value)
