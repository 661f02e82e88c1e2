"""Learning curves are those of the files, and their intervals those of SciPy."""

import csv
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from kinarm.errors import InvalidInputError
from kinarm.evaluation.curves import Band, LearningCurves
from kinarm.policies.learners import CurvePoint
from kinarm.policies.training import write_curve


def own(path, steps, success):
    path.parent.mkdir(exist_ok=True, parents=True)
    returns = [2 * share - 1 for share in success]
    points = zip(returns, returns, success, steps, steps, strict=True)
    write_curve(path, [CurvePoint(*point) for point in points])


def evaluations(path, steps, **results):
    path.parent.mkdir(exist_ok=True, parents=True)
    np.savez(path, timesteps=np.array(steps), **results)


def monitor(path, start, episodes):
    """A file of Stable-Baselines3's ``Monitor``, of returns, lengths and ends."""
    path.parent.mkdir(exist_ok=True, parents=True)
    with path.open("w") as file:
        file.write(f"#{json.dumps({'t_start': start, 'env_id': 'kinarm'})}\n")
        writer = csv.writer(file)
        writer.writerows([("r", "l", "t", "is_success"), *episodes])


class TestBand:
    @given(st.lists(st.floats(0, 1), min_size=2, max_size=6))
    def test_intervals_are_students(self, ends):
        steps = np.array([0.0, 10.0])
        band = Band.of([(steps, np.array([end, 0.5])) for end in ends])
        assert band.seeds == len(ends)
        np.testing.assert_allclose(band.mean, [np.mean(ends), 0.5], atol=1e-12)
        error = stats.sem(ends)
        low, high = stats.t.interval(0.95, len(ends) - 1, np.mean(ends), error or 1e-300)
        np.testing.assert_allclose(band.low[0], np.clip(low, 0, 1), atol=1e-9)
        np.testing.assert_allclose(band.high[0], np.clip(high, 0, 1), atol=1e-9)
        assert (band.low[1], band.high[1]) == (0.5, 0.5)

    def test_finer_curves_are_interpolated_at_the_points_of_the_coarsest(self):
        fine = np.arange(10.0, 101.0)
        band = Band.of([(fine, fine / 100), (np.array([0.0, 50.0, 120.0]), np.zeros(3))])
        np.testing.assert_array_equal(band.places, [10.0, 50.0, 100.0])
        np.testing.assert_allclose(band.mean, [0.05, 0.25, 0.5])

    def test_a_single_seed_has_no_interval(self):
        band = Band.of([(np.array([1.0, 2.0]), np.array([-3.0, 5.0]))], shares=False)
        np.testing.assert_array_equal(band[2:], [[-3.0, 5.0]] * 3)

    def test_curves_without_a_common_step_have_no_mean(self, tmp_path):
        one, other = np.array([1.0, 2.0]), np.array([3.0, 4.0])
        for seed, steps in enumerate((one, other)):
            own(tmp_path / f"mine-seed{seed}.curve.csv", steps, [0.5, 0.5])
        with pytest.raises(InvalidInputError, match="mine: a training ends before another begins"):
            LearningCurves.load([tmp_path])


class TestFiles:
    def test_seeds_of_kinarm_share_a_recipe(self, tmp_path):
        for seed, last in enumerate((0.2, 0.4)):
            own(tmp_path / f"ars-seed{seed}.curve.csv", [10, 20, 30], [0.0, 0.1, last])
        own(tmp_path / "ppo-seed0.curve.csv", [5, 30], [0.5, np.nan])
        curves = LearningCurves.load([tmp_path])
        assert curves.measure == "success"
        assert set(curves.bands) == {str(tmp_path / "ars"), str(tmp_path / "ppo")}
        band = curves.bands[str(tmp_path / "ars")]
        assert (band.seeds, band.places.tolist()) == (2, [10, 20, 30])
        assert band.mean.tolist() == pytest.approx([0.0, 0.1, 0.3])
        returns = LearningCurves.load([f"X={tmp_path}/ars*.csv"], "return").bands["X"]
        assert returns.mean.tolist() == pytest.approx([-1.0, -0.8, -0.4])

    def test_points_without_episodes_are_left_out(self, tmp_path):
        own(tmp_path / "mine.curve.csv", [10, 20, 30], [0.5, np.nan, 0.7])
        (band,) = LearningCurves.load([tmp_path / "mine.curve.csv"]).bands.values()
        assert band.places.tolist() == [10, 30]

    def test_evaluations_are_means_over_their_episodes(self, tmp_path):
        for seed in range(3):
            results, ends = np.full((2, 4), float(seed)), np.array([[False] * 4, [True] * 4])
            path = tmp_path / f"logs{seed}" / "evaluations.npz"
            evaluations(path, [100, 200], results=results, successes=ends)
            monitor(path.with_name("monitor.csv"), 0, [(9.0, 3, 1.0, False)])
        pattern = f"{tmp_path}/logs*"
        (band,) = LearningCurves.load([pattern]).bands.values()
        assert (band.seeds, band.mean.tolist()) == (3, [0.0, 1.0])
        (band,) = LearningCurves.load([pattern], "return").bands.values()
        assert band.mean.tolist() == [1.0, 1.0]

    def test_monitors_of_a_folder_are_one_training_in_the_order_of_time(self, tmp_path):
        pytest.importorskip("stable_baselines3")
        from stable_baselines3.common.monitor import load_results
        from stable_baselines3.common.results_plotter import ts2xy

        rng = np.random.default_rng(0)
        for env in range(2):
            times = np.sort(rng.uniform(0, 100, 700))
            episodes = zip(rng.normal(size=700), rng.integers(1, 64, 700), times, strict=True)
            path = tmp_path / f"{env}.monitor.csv"
            monitor(path, 1000.0 + env, [(*each, each[0] > 0) for each in episodes])
        steps, returns = ts2xy(load_results(str(tmp_path)), "timesteps")
        (band,) = LearningCurves.load([tmp_path], "return").bands.values()
        assert band.seeds == 1
        np.testing.assert_array_equal(band.places, steps[99:])
        windows = np.lib.stride_tricks.sliding_window_view(returns, 100).mean(axis=1)
        np.testing.assert_allclose(band.mean, windows, atol=1e-12)
        (band,) = LearningCurves.load([tmp_path]).bands.values()
        assert band.mean[0] == pytest.approx(np.mean(returns[:100] > 0))

    def test_what_not_all_tell_is_refused(self, tmp_path):
        own(tmp_path / "mine.curve.csv", [10, 20], [0.5, 0.6])
        evaluations(tmp_path / "evaluations.npz", [10, 20], results=np.ones((2, 3)))
        files = [tmp_path / "mine.curve.csv", tmp_path / "evaluations.npz"]
        assert LearningCurves.load(files).measure == "return"
        with pytest.raises(InvalidInputError, match="not every file tells success: choose return"):
            LearningCurves.load(files, "success")

    @pytest.mark.parametrize(
        ("name", "content", "words"),
        [
            ("mine.curve.csv", b"a,b\n1,2\n", "is not a complete file with a"),
            (
                "mine.curve.csv",
                b"environment_steps,success,mean_return\n9,nan,nan\n",
                "it holds no point",
            ),
            ("monitor.csv", b'#{"t_start": 0}\nr,l,t\n', "is not a complete file with a"),
            ("evaluations.npz", b"PK", "is not a complete file with a"),
        ],
    )
    def test_damaged_files_are_refused_in_one_line(self, tmp_path, name, content, words):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidInputError, match=words) as refused:
            LearningCurves.load([tmp_path / name])
        assert name in str(refused.value)
