"""Studies of transfer: what is trained, once, and what it comes to."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_ind

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation import document_schema, evaluate
from kinarm.evaluation.studies.transfer import __main__ as command
from kinarm.evaluation.studies.transfer.document import (
    TransferResults,
    ratio_of_means,
    transfer_document,
)
from kinarm.evaluation.studies.transfer.figures import learning_curves
from kinarm.evaluation.studies.transfer.page import transfer_page
from kinarm.evaluation.studies.transfer.planning import (
    FIRST_SEEDS,
    MOST_SEEDS,
    SOURCE,
    Protocol,
    targets,
)
from kinarm.evaluation.studies.transfer.runs import Look, TransferRun, load_run, policy_path
from kinarm.evaluation.studies.transfer.study import TransferStudy
from kinarm.evaluation.studies.transfer.training import carry_out, look_iterations
from kinarm.policies import Policy, load_policy, recipe, train_policy
from kinarm.workers import Finished

PROTOCOL = Protocol(trials=30, looks=3, look_trials=20)
ARS = {"iterations": 6, "episodes": 1, "directions": 4, "top_directions": 2}
PPO = {
    "iterations": 2,
    "n_envs": 4,
    "n_steps": 8,
    "batch_size": 16,
    "n_epochs": 1,
    "net_arch": (64, 64, 64),
}
SETTINGS = {"ars": ARS, "ppo": PPO}


def small(**changes):
    given = {"learners": ("ars",), "seeds": 2, "lengths": (1.0, 0.5), "settings": SETTINGS}
    return TransferStudy(**{**given, "protocol": PROTOCOL, **changes})


class Counting:
    """An executor that carries out at most so many tasks in this process."""

    def __init__(self, limit=1000):
        self.names, self._limit = [], limit

    def carry_out(self, work, tasks):
        for number, task in enumerate(tasks):
            if len(self.names) == self._limit:
                raise KeyboardInterrupt
            self.names.append(task.name)
            yield Finished(number, work(task))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("trainings")


@pytest.fixture(scope="module")
def document(folder):
    return small().run(folder, command="made for tests")


def test_the_document_is_that_of_its_schema(document):
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.validate(document, document_schema("transfer"))


class TestPlanning:
    def test_every_training_is_the_tuned_recipe_without_its_mirror(self):
        for training in small().trainings:
            config = training.config
            expected = recipe(
                "ars", "tuned", problem=config.problem, symmetric=False, seed=config.seed, **ARS
            )
            assert replace(config, iterations=6) == expected
            assert config.iterations == round(6 * training.length)
            assert config.initial_policy is None

    def test_every_kind_has_all_seeds(self):
        study = small(learners=("ars", "ppo"), seeds=3)
        kinds = {}
        for each in study.trainings:
            kind = (each.learner, each.role, each.problem.name, each.length)
            kinds.setdefault(kind, set()).add(each.config.seed)
        assert len(kinds) == 2 * (1 + 2 * len(targets()) * 2)
        assert {len(seeds) for seeds in kinds.values()} == {3}
        assert len({each.name for each in study.trainings}) == len(study.trainings)

    def test_seeds_of_the_roles_are_apart(self):
        for training in small().trainings:
            first = FIRST_SEEDS[training.role]
            assert training.config.seed in range(first, first + 2)
        assert (np.diff(sorted(FIRST_SEEDS.values())) >= MOST_SEEDS).all()

    def test_warm_starts_begin_with_the_first_task_and_come_later(self):
        trainings = small().trainings
        for number, training in enumerate(trainings):
            assert (training.source is not None) == (training.role == "warm")
            if training.source is not None:
                assert training.source in trainings[:number]
                assert training.source.problem == SOURCE
        begun = [each.source.config.seed for each in trainings if each.source]
        assert begun == [0, 1] * 6

    @pytest.mark.parametrize(
        "changes",
        [
            {"protocol": replace(PROTOCOL, look_trials=21)},
            {"settings": {"ars": {**ARS, "noise": 0.04}}},
        ],
    )
    def test_other_settings_are_other_files(self, changes):
        first, other = ({each.name for each in s.trainings} for s in (small(), small(**changes)))
        assert not first & other

    @pytest.mark.parametrize(
        ("changes", "error", "message"),
        [
            ({"seeds": 0}, InvalidInputError, "seeds must be"),
            ({"seeds": 1001}, InvalidInputError, "seeds must be"),
            ({"learners": ()}, InvalidInputError, "needs a learner and a length"),
            ({"lengths": ()}, InvalidInputError, "needs a learner and a length"),
            ({"lengths": (1.5,)}, InvalidInputError, "up to 1, got 1.5"),
            ({"learners": ("sarsa",)}, UnknownNameError, "sarsa"),
        ],
    )
    def test_what_makes_no_study_is_refused(self, changes, error, message):
        with pytest.raises(error, match=message):
            small(**changes)

    @pytest.mark.parametrize("changes", [{"trials": 1}, {"looks": 1}, {"look_seed": -1}])
    def test_what_judges_nothing_is_refused(self, changes):
        with pytest.raises(InvalidInputError):
            Protocol(**changes)

    def test_looks_grow_from_the_first_iteration_to_the_last(self):
        found = look_iterations(8000, 80)
        assert (found[0], found[-1]) == (1, 8000)
        assert (np.diff(found) > 0).all()
        growth = found[30:] / found[29:-1]
        assert growth.max() < 1.2
        assert look_iterations(1, 80).tolist() == [1]


class TestTraining:
    def test_looks_are_evaluations_of_the_policy_by_then(self, document, folder):
        """The step size is constant here, so that shorter trainings begin as longer ones do."""
        settings = {"ars": {**ARS, "step_size_schedule": "constant"}}
        (training, *_) = small(settings=settings).trainings
        run = carry_out(training, folder)
        assert [look.iteration for look in run.looks] == [0, 1, 2, 6]
        assert run.looks[0].environment_steps == 0
        for look in run.looks[1:]:
            config = replace(training.config, iterations=look.iteration)
            policy = train_policy(config).policy
            outcome = evaluate(policy, trials=20, seed=1)
            assert look.successes == outcome.rollouts.success.sum()
            assert look.collisions == outcome.rollouts.collision.sum()
            assert look.environment_steps == policy.provenance.environment_steps

    @pytest.mark.parametrize("learner", ["ars", "ppo"])
    def test_a_warm_start_does_at_first_what_its_policy_does(self, learner, tmp_path):
        if learner == "ppo":
            pytest.importorskip("stable_baselines3")
        study = small(learners=(learner,), protocol=replace(PROTOCOL, look_trials=200))
        name = f"{learner}-tuned-both-seed0"
        known = replace(load_policy(name), mirror=None)
        (training, *_) = (
            each for each in study.trainings if each.source and each.problem.name == "both"
        )
        known.save(policy_path(tmp_path, training.source))
        first = carry_out(training, tmp_path).looks[0]
        outcome = evaluate(known, problem="both", trials=200, seed=1)
        assert first[:2] == (0, 0)
        assert first.successes == outcome.rollouts.success.sum() > 20
        assert first.collisions == outcome.rollouts.collision.sum()


class TestRunning:
    def test_an_interrupted_study_goes_on_with_what_is_missing(self, document, tmp_path):
        study = small()
        first, second = Counting(limit=5), Counting()
        with pytest.raises(KeyboardInterrupt):
            study.run(tmp_path, first)
        assert len(study.finished(tmp_path)) == 5
        assert study.run(tmp_path, second, "made for tests") == document
        assert sorted(first.names + second.names) == sorted(each.name for each in study.trainings)

    @pytest.mark.parametrize(
        ("ending", "damage"), [("npz", b""), ("json", b""), ("json", b'{"looks": []}')]
    )
    def test_what_is_damaged_is_trained_again(self, document, folder, ending, damage):
        training = small().trainings[3]
        path = folder / f"{training.name}.{ending}"
        kept = path.read_bytes()
        path.write_bytes(damage)
        assert load_run(folder, training) is None
        again = Counting()
        small().run(folder, again)
        assert again.names == [training.name]
        if ending == "json":
            assert path.read_bytes() == kept

    def test_nothing_depends_on_the_folder(self, document, folder):
        assert str(folder) not in json.dumps(document)


class TestResults:
    def test_policies_face_the_other_tasks(self, document, folder):
        study = small()
        sources = [Policy.load(policy_path(folder, each)) for each in study.trainings[:2]]
        rows = {(row["problem"], row["way"]): row for row in document["zero_shot"]}
        assert {problem for problem, _ in rows} == {
            "left",
            "right",
            "both",
            "left-lrmate200ic_5l",
        }
        for problem in (SOURCE, *targets()):
            row = rows[problem.name, "as it is"]
            shares = [
                evaluate(policy, problem=problem, trials=30, allow_other_arm=True).success.value
                for policy in sources
            ]
            assert row["success_each"] == shares
            assert row["success"]["value"] == pytest.approx(np.mean(shares))
        assert rows["left", "as it is"]["difference"] is None
        assert rows["left", "reflected"]["success"] == rows["left", "as it is"]["success"]
        differences = [row["difference"] for key, row in rows.items() if key[0] != "left"]
        assert all(len(difference["ci95"]) == 2 for difference in differences)

    def test_curves_and_counts_are_those_of_the_files(self, document, folder):
        study = small()
        assert document["trainings"] == len(study.trainings) == len(document["curves"])
        for training, curve in zip(study.trainings, document["curves"], strict=True):
            looks = load_run(folder, training).looks
            assert curve["environment_steps"] == [look.environment_steps for look in looks]
            assert curve["success"] == [look.successes / 20 for look in looks]
        steps = sum(curve["environment_steps"][-1] for curve in document["curves"])
        assert document["environment_steps"] == steps

    def test_time_to_a_level_is_that_of_the_first_look(self, document, folder):
        """Scratch reaches 50 % after 2 or 3 iterations, and 80 % with one seed."""
        study = small()
        runs = study.finished(folder)
        successes = {"warm": [(10, 18, 17), (11, 12, 18)], "scratch": [(0, 9, 16), (0, 3, 12)]}

        def remade(training, run):
            if training.role == "source":
                return run
            hits = successes[training.role][training.config.seed % 2]
            looks = [Look(i, 100 * i, hit, 0) for i, hit in enumerate(hits)]
            return TransferRun(run.policy, tuple(looks))

        results = TransferResults(study, {key: remade(key, run) for key, run in runs.items()})
        row = next(results.warm_start())
        half, most, nearly_all = row["until"]
        assert half["warm"] == {"iteration": [0, 0], "environment_steps": [0, 0]}
        assert half["scratch"] == {"iteration": [2, 2], "environment_steps": [200, 200]}
        assert half["warm_is_faster"]["value"] == 1
        assert half["ratio"]["value"] is None
        assert most["warm"]["iteration"] == [1, 2]
        assert most["scratch"]["iteration"] == [2, None]
        assert most["warm_is_faster"]["value"] == (1 + 0.5 + 1 + 1) / 4
        assert nearly_all["scratch"]["iteration"] == [None, None]
        assert nearly_all["warm"]["environment_steps"] == [100, 200]
        page = transfer_page({**document, "warm_start": [row]}, "transfer.png")
        cells = [line.split(" | ") for line in page.splitlines() if line.startswith("| ARS")]
        shown = {row[3]: row[4:6] for row in cells if row[3].endswith("%")}
        assert shown == {
            "50%": ["0 (0)", "0 (2)"],
            "80%": ["0 (1.5)", "most never, 1 of 2 seeds"],
            "90%": ["0 (1.5)", "never"],
        }

    def test_nothing_is_left_of_a_level_that_none_came_to(self, document):
        page = transfer_page(document, "transfer.png")
        assert all(until["success"] for row in document["warm_start"] for until in row["until"])
        assert "| 90% |" not in page
        assert "![Success against environment steps](transfer.png)" in page
        assert "by `made for tests`" in page.lower()

    def test_one_seed_has_no_interval_of_differences(self, folder):
        study = small(seeds=1, lengths=(1.0,))
        document = transfer_document(study, study.finished(folder), "")
        assert all(row["difference"]["ci95"] is None for row in document["warm_start"])
        assert "undecided" in transfer_page(document, "transfer.png")

    def test_ratio_of_means_is_welchs(self):
        first, second = np.array([2.0, 3.0, 2.5, 4.0]), np.array([8.0, 20.0, 9.0])
        ratio = ratio_of_means(first, second)
        welch = ttest_ind(np.log(first), np.log(second), equal_var=False).confidence_interval()
        assert ratio.value == pytest.approx(np.exp(np.log(first).mean() - np.log(second).mean()))
        assert ratio.ci95 == pytest.approx((np.exp(welch.low), np.exp(welch.high)))
        assert ratio_of_means(first[:1], second).ci95 is None
        assert ratio_of_means(np.array([0.0, 1.0]), second).value is None
        assert ratio_of_means(np.array([np.inf, 1.0]), second).value is None

    def test_the_figure_has_a_panel_per_learner_and_problem(self, document):
        panels = learning_curves(document).axes
        assert [axes.get_title() for axes in panels] == [
            f"ARS, {name}" for name in ("right", "both", "left-lrmate200ic_5l")
        ]
        (mean, *_) = panels[0].get_lines()
        curves = [
            curve
            for curve in document["curves"]
            if (curve["role"], curve["problem"], curve["length"]) == ("warm", "right", 1.0)
        ]
        begins = max(curve["environment_steps"][1] for curve in curves)
        assert mean.get_xdata()[0] == pytest.approx(begins)


class TestCommand:
    def test_writes_document_tables_and_figure(self, document, folder, tmp_path, monkeypatch):
        monkeypatch.setattr(command.TransferRequest, "study", small())
        out = tmp_path / "new" / "transfer.json"
        with pytest.raises(SystemExit) as ended:
            command.main(["--out", str(out), "--folder", str(folder)])
        assert ended.value.code == 0
        names = {path.name for path in out.parent.iterdir()}
        assert names == {"transfer.json", "TRANSFER.md", "transfer.png", "transfer.svg"}
        written = json.loads(out.read_text())
        assert written.pop("command").endswith(f"--out {out} --folder {folder}")
        assert written == {key: document[key] for key in document if key != "command"}

    def test_the_study_is_as_asked_for(self, tmp_path):
        request = command.TransferRequest(
            learners=("ars",), seeds=3, out=tmp_path / "a.json", folder=tmp_path
        )
        assert (request.study.learners, request.study.seeds) == (("ars",), 3)
        assert request.study.trainings[0].config.iterations == recipe("ars", "tuned").iterations

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["--out", "a.txt"], "out must be a .json file, got 'a.txt'"),
            (["--out", "a.json", "--jobs", "0"], "jobs must be"),
        ],
    )
    def test_bad_input_ends_in_one_line(self, arguments, message, tmp_path, capsys):
        with pytest.raises(SystemExit) as ended:
            command.main([*arguments, "--folder", str(tmp_path)])
        assert ended.value.code == 2
        assert message in capsys.readouterr().err
