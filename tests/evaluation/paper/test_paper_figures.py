"""Figures of a reproduction, and the densities in them."""

import numpy as np
import pytest

from kinarm.evaluation.paper.page import density, figure_2, figure_3, learning_curves


class TestDensity:
    POSITIONS = np.linspace(0, 3, 3001)

    @pytest.mark.parametrize("samples", [np.full(50, 0.03), np.linspace(0, 1, 200)])
    def test_nothing_is_lost_below_zero(self, samples):
        total = np.trapezoid(density(samples, self.POSITIONS), self.POSITIONS)
        assert total == pytest.approx(1, abs=0.01)

    def test_far_outliers_do_not_blur_the_many(self):
        many = np.random.default_rng(0).uniform(0.03, 0.05, 190)
        values = density(np.concatenate([many, np.full(10, 1.0)]), self.POSITIONS)
        inside = (self.POSITIONS > 0.02) & (self.POSITIONS < 0.06)
        assert np.trapezoid(values[inside], self.POSITIONS[inside]) > 0.85

    def test_of_many_normal_samples(self):
        samples = np.random.default_rng(1).normal(1.5, 0.2, 4_000)
        places = self.POSITIONS[::50]
        expected = np.exp(-(((places - 1.5) / 0.2) ** 2) / 2) / (0.2 * np.sqrt(2 * np.pi))
        np.testing.assert_allclose(density(samples, places), expected, atol=0.1)


@pytest.fixture(scope="module")
def results(results_of, made_up_run):
    def run_of(run):
        rng = np.random.default_rng([*run.name.encode()])
        return made_up_run(rng.uniform(0, 1, 200), rng.uniform(0, 1, (4, 10)))

    return results_of(run_of)


def test_figure_2_has_seeds_and_their_mean(results):
    figure = figure_2(results)
    assert len(figure.axes) == 6
    for rewards in figure.axes[::2]:
        *seeds, mean = (line.get_ydata() for line in rewards.lines)
        assert len(seeds) == 4
        np.testing.assert_allclose(mean, np.mean(seeds, axis=0))
    for histograms in figure.axes[1::2]:
        shares = [patch.get_data().values.sum() for patch in histograms.patches]
        np.testing.assert_allclose(shares, 1)


def test_figure_3_shows_both_learners_and_the_oracle(results):
    figure = figure_3(results)
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["ARS", "PPO", "oracle (cut off)"]
    for axes in figure.axes:
        assert len([line for line in axes.lines if line.get_linewidth() > 2]) == 2


@pytest.mark.parametrize(("against", "last"), [("steps", 0.004), ("time", 1.0)])
def test_learning_curves_end_where_the_trainings_do(results, against, last):
    figure = learning_curves(results, against)
    assert len(figure.axes) == 6
    for axes in figure.axes:
        assert all(line.get_xdata()[-1] == pytest.approx(last) for line in axes.lines)
    shares = [line.get_ydata() for line in figure.axes[0].lines]
    assert all(((share >= 0) & (share <= 1)).all() for share in shares)
