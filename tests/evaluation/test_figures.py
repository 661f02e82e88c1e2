"""Bands over seeds, and reproducible files."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from kinarm.evaluation.figures import Band, panels_figure, save_figure

SVG_BEGINNING = b'<?xml version="1.0"'
PNG_BEGINNING = b"\x89PNG\r\n\x1a\n"


@given(st.lists(st.floats(0, 1), min_size=2, max_size=6))
def test_intervals_of_curves_are_students(ends):
    steps = np.array([0.0, 10.0])
    band = Band.of([(steps, np.array([end, 0.5])) for end in ends])
    np.testing.assert_allclose(band.mean, [np.mean(ends), 0.5], atol=1e-12)
    error = stats.sem(ends)
    low, high = stats.t.interval(0.95, len(ends) - 1, np.mean(ends), error or 1e-300)
    np.testing.assert_allclose(band.low[0], np.clip(low, 0, 1), atol=1e-9)
    np.testing.assert_allclose(band.high[0], np.clip(high, 0, 1), atol=1e-9)
    assert (band.low[1], band.high[1]) == (0.5, 0.5)


def test_finer_curves_are_interpolated_at_the_points_of_the_coarsest():
    fine = np.arange(10.0, 101.0)
    band = Band.of([(fine, fine / 100), (np.array([0.0, 50.0, 120.0]), np.zeros(3))])
    np.testing.assert_array_equal(band.places, [10.0, 50.0, 100.0])
    np.testing.assert_allclose(band.mean, [0.05, 0.25, 0.5])


def test_a_single_curve_has_no_interval():
    band = Band.of([(np.array([1.0, 2.0]), np.array([0.25, 0.5]))])
    np.testing.assert_array_equal(band[1:], [[0.25, 0.5]] * 3)


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
