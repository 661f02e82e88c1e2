"""What is trained: against the paper's text and Table 1."""

from collections import Counter

from kinarm.evaluation.reproduction.study import LITERAL, Reading, full_study, quick_study
from kinarm.policies import recipe
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights


class TestFullStudy:
    def test_nine_settings_of_the_sweep(self, study):
        sweep = [t for t in study.trainings if t.purpose == "sweep"]
        settings = Counter((t.config.step_size, t.config.directions) for t in sweep)
        nine = {(rate, n) for rate in (0.05, 0.01, 0.005) for n in (16, 24, 32)}
        assert settings == dict.fromkeys(nine, 4)
        assert {t.config.iterations for t in sweep} == {300}
        assert {t.config.problem.name for t in sweep} == {"left"}
        assert all(2 * t.config.top_directions == t.config.directions for t in sweep)

    def test_twelve_models_of_table_1(self, study):
        models = [t for t in study.trainings if t.purpose == "ars" and t.reading == LITERAL]
        assert Counter(t.config.problem.name for t in models) == {"left": 4, "right": 4, "both": 4}
        for training in models:
            config = training.config
            assert (config.step_size, config.noise) == (0.02, 0.03)
            assert (config.directions, config.top_directions) == (24, 12)
            assert (config.problem.task.horizon, config.iterations) == (64, 800)
            assert config.recipe == recipe("ars", "paper").recipe
        assert study.protocol.trials == 200

    def test_ppo_takes_the_papers_steps(self, study):
        models = [t for t in study.trainings if t.purpose == "ppo" and t.reading == LITERAL]
        assert Counter(t.config.problem.name for t in models) == {"left": 4, "right": 4, "both": 4}
        assert {t.config.environment_steps for t in models} == {1_200_000}
        assert {t.config.recipe for t in models} == {recipe("ppo", "paper").recipe}

    def test_every_combination_of_readings(self, study):
        assert len(study.readings()) == len(set(study.readings())) == 12
        assert study.readings()[0] == LITERAL
        assert {reading.sharing for reading in study.readings("ppo")} == {"none"}
        assert {reading.for_ppo for reading in study.readings()} == set(study.readings("ppo"))

    def test_names_are_unique(self, study):
        assert len({t.name for t in study.trainings}) == len(study.trainings) == 36 + 144 + 48

    def test_without_ppo(self, study):
        without = full_study(ppo=False)
        assert without.trainings == tuple(t for t in study.trainings if t.purpose != "ppo")


def test_quick_study_has_something_of_everything():
    quick = quick_study()
    assert {t.purpose for t in quick.trainings} == {"sweep", "ars", "ppo"}
    assert len(quick.readings()) == 2
    for purpose in ("ars", "ppo"):
        seeds = {t.config.seed for t in quick.trainings if t.purpose == purpose}
        assert len(seeds) > 1, "intervals need several seeds"
    assert not {t.purpose for t in quick_study(ppo=False).trainings} & {"ppo"}


class TestReading:
    def test_the_literal_one_is_the_papers_problems_as_they_are(self):
        for name, problem in PROBLEMS.items():
            assert LITERAL.problem(name) == problem
            assert LITERAL.weights(problem) is None

    def test_signs_of_all_steps_weigh_as_much_as_a_metre_of_progress(self):
        reading = Reading(start_spread=0.1, reward="sign")
        weights = reading.weights(reading.problem("left"))
        assert weights == RewardWeights(progress=0.0, closer=1 / 64)

    def test_trainings_follow_their_reading(self, study):
        for training in study.trainings:
            config, reading = training.config, training.reading
            assert config.problem.task.start_spread == reading.start_spread
            assert config.training_problem.task.reward.collision == -1
            assert (config.training_problem.task.reward.progress == 0) == (reading.reward == "sign")
            if training.purpose == "ars":
                assert config.sharing == reading.sharing
