"""Histograms of the final distance: shares, panels, legends and reproducible files."""

import numpy as np
import pytest
from matplotlib.patches import StepPatch

from kinarm.evaluation.contestants import BASELINES, Contestant
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.figures import distance_histograms, save_figure, series_labels
from kinarm.evaluation.trials import TrialSet
from kinarm.problem import PROBLEMS

SVG_BEGINNING = b'<?xml version="1.0"'
PNG_BEGINNING = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def figure(evaluations):
    return distance_histograms(evaluations)


def stairs(axes) -> list[StepPatch]:
    return [patch for patch in axes.patches if isinstance(patch, StepPatch)]


def legend(axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_seeds_are_drawn_besides_their_mean(figure):
    right, left = figure.axes
    assert len(stairs(right)) == 3 + 1 + 1
    assert len(stairs(left)) == 1


def test_shares_are_those_of_the_trials(skilled_evaluation):
    (patch,) = stairs(distance_histograms([skilled_evaluation]).axes[0])
    distance = skilled_evaluation.rollouts.distance
    for share, low, high in zip(patch.get_data().values, *ends(patch), strict=True):
        inside = sum(low <= d < high for d in distance)
        assert share == pytest.approx(inside / len(distance))


def ends(patch: StepPatch) -> tuple[np.ndarray, np.ndarray]:
    edges = patch.get_data().edges
    return edges[:-1], edges[1:]


def test_the_mean_line_is_the_mean_of_the_seeds(figure):
    colours: dict[tuple, list] = {}
    for patch in stairs(figure.axes[0]):
        colours.setdefault(patch.get_edgecolor()[:3], []).append(patch)
    patches = next(group for group in colours.values() if len(group) == 4)
    thickest = max(patches, key=lambda patch: patch.get_linewidth())
    seeds = [patch.get_data().values for patch in patches if patch is not thickest]
    np.testing.assert_allclose(thickest.get_data().values, np.mean(seeds, axis=0))


@pytest.mark.parametrize("furthest", [0.001, 0.05, 0.15, 0.3, 0.35, 0.6, 0.7, 1.0, 1.4, 1.45])
def test_no_trial_is_lost_at_the_last_edge(made_up, furthest):
    (patch,) = stairs(distance_histograms([made_up([furthest, furthest / 2])]).axes[0])
    assert patch.get_data().values.sum() == pytest.approx(1)


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


def test_every_line_of_a_matrix_has_a_look_of_its_own(train_novice):
    policies = {
        f"ars-{named}-{problem}-seed0": train_novice(problem, named=named)
        for named in ("paper", "tuned")
        for problem in PROBLEMS
    }
    contestants = [Contestant.from_policy(*item) for item in policies.items()] + [
        *BASELINES.values()
    ]
    trial_sets = [TrialSet.draw(name, 4, seed=0) for name in PROBLEMS]
    matrix = [run_trials(contestant, trials) for trials in trial_sets for contestant in contestants]
    for axes in distance_histograms(matrix).axes:
        assert len(set(legend(axes))) == len(contestants)
        looks = {(patch.get_edgecolor(), patch.get_linestyle()) for patch in stairs(axes)}
        assert len(looks) == len(contestants)


def test_files_are_written_and_reproducible(evaluations, tmp_path):
    contents = []
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        paths = save_figure(distance_histograms(evaluations), folder, "histogram")
        assert [path.name for path in paths] == ["histogram.png", "histogram.svg"]
        contents.append([path.read_bytes() for path in paths])
    assert contents[0] == contents[1]
    png, svg = contents[0]
    assert png.startswith(PNG_BEGINNING)
    assert svg.startswith(SVG_BEGINNING)
