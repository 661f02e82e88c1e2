"""Names of series, and reproducible files."""

from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.figures import panels_figure, save_figure, series_labels
from kinarm.evaluation.trials import TrialSet
from kinarm.problem import PROBLEMS

SVG_BEGINNING = b'<?xml version="1.0"'
PNG_BEGINNING = b"\x89PNG\r\n\x1a\n"


def test_a_symmetric_policy_has_one_name_on_all_its_problems(train_novice):
    symmetric = Contestant.from_policy("ars-tuned-both-seed0", train_novice("both"))
    plain = Contestant.from_policy("ars-paper-both-seed0", train_novice("both", named="paper"))
    trial_sets = [TrialSet.draw(name, 4, seed=0) for name in PROBLEMS]
    trial_sets.append(TrialSet.draw(PROBLEMS["right"].replace(tolerance=0.2), 4, seed=0))
    for trials in trial_sets:
        for contestant in (symmetric, plain):
            (label,) = series_labels([run_trials(contestant, trials)])
            if contestant is symmetric:
                assert label == "ars-tuned-both"
            else:
                own = trials.problem.name == "both"
                assert label == ("ars-paper" if own else "ars-paper (trained on both)")
    other = TrialSet.draw(PROBLEMS["right"].replace(name="elsewhere", scene="post"), 4, seed=0)
    assert series_labels([run_trials(symmetric, other)]) == ["ars-tuned (trained on both)"]


def test_files_are_written_and_reproducible(tmp_path):
    contents = []
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        figure, ((axes,),) = panels_figure((3.0, 2.0), 1, 1)
        axes.plot([0, 1], label="line")
        axes.legend()
        paths = save_figure(figure, folder, "histogram")
        assert [path.name for path in paths] == ["histogram.png", "histogram.svg"]
        contents.append([path.read_bytes() for path in paths])
    assert contents[0] == contents[1]
    png, svg = contents[0]
    assert png.startswith(PNG_BEGINNING)
    assert svg.startswith(SVG_BEGINNING)
