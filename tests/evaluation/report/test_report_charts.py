"""Charts and maps of reports: drawn to scale, from the figures of the trials."""

import re
from math import log, sqrt
from xml.etree import ElementTree

import numpy as np
import pytest
from drawings import PIXEL

from kinarm.bodies import Body
from kinarm.evaluation.report import charts
from kinarm.evaluation.report.charts import level
from kinarm.evaluation.report.templating import template
from kinarm.evaluation.statistics import share_over_seeds
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene


def drawn(page: str, path: str) -> ElementTree.Element:
    """The first part of a report that lies there."""
    found = page[page.index("<main") : page.index("</main>") + len("</main>")]
    return ElementTree.fromstring(found).find(path)


def drawn_map(page: str) -> ElementTree.Element:
    """The first map of a report."""
    return drawn(page, ".//svg[@class='map'][@tabindex]")


def shapes(page: str, name: str, classes: str) -> list[ElementTree.Element]:
    """Shapes that belong to a policy, in the charts of the problem right."""
    section = drawn(page, ".//section[@id='problem-right']")
    return section.findall(f".//g[@data-series='{name}']/*[@class='{classes}']")


def markers_of(drawn: ElementTree.Element) -> dict[int, ElementTree.Element]:
    """Markers of a map by the numbers of their trials."""
    titled = ((path, path.findtext("title", "")) for path in drawn.findall("path"))
    trials = ((re.match(r"trial (\d+)", title), path) for path, title in titled)
    return {int(found[1]): path for found, path in trials if found}


def coordinates(path: str) -> np.ndarray:
    return np.array(re.findall(r"(-?[\d.]+)[ ,](-?[\d.]+)", path), dtype=float)


CHART = template("chart.html").module


def places(limits):
    """Where distances lie across a profile chart."""
    low, high = log(limits[0]), log(limits[-1])
    inside = CHART.width - CHART.left - CHART.right
    return CHART.left + (np.log(limits) - low) / (high - low) * inside


class TestProfile:
    BOTTOM = CHART.profile_height - CHART.below
    SPAN = BOTTOM - CHART.above

    @pytest.mark.parametrize("name", ["made-right", "zero", "oracle"])
    def test_line_is_the_share_within_each_distance(self, page, right, name):
        group = next(group for group in right.groups if group.name == name)
        (line,) = shapes(page, name, "line")
        limits = np.array(charts.profiles(right)[0])
        share = [np.mean(group.distances <= limit) for limit in limits]
        xs, ys = coordinates(line.get("d")).T
        np.testing.assert_allclose(
            (self.BOTTOM - ys) / self.SPAN, np.interp(xs, places(limits), share), atol=0.01
        )
        for edge in (0, -1):
            assert xs[edge] == pytest.approx(places(limits)[edge], abs=PIXEL)

    def test_band_is_the_interval_at_each_distance(self, page, right):
        group = next(group for group in right.groups if group.name == "made-right")
        (band,) = shapes(page, "made-right", "band")
        limits = charts.profiles(right)[0]
        there, back = np.split(coordinates(band.get("d"))[: 2 * len(limits)], 2)
        for place, limit in enumerate(limits):
            drawn = [(self.BOTTOM - y) / self.SPAN for y in (back[-1 - place, 1], there[place, 1])]
            interval = share_over_seeds(group.distances <= limit).ci95
            np.testing.assert_allclose(drawn, interval, atol=PIXEL / self.SPAN)


class TestHistogram:
    def test_bars_are_as_high_as_the_root_of_their_share(self, page, right):
        row = max(48, 270 // len(right.groups))
        for group in right.groups:
            for bar in shapes(page, group.name, "bars"):
                height = float(re.search(r"v-([\d.]+)", bar.get("d"))[1])
                share = float(bar.findtext("title").split(": ")[1].split()[0]) / 100
                expected = row * CHART.row_height * sqrt(share)
                assert height == pytest.approx(expected, abs=PIXEL)


class TestMap:
    def test_markers_lie_at_the_goals_and_show_what_happened(self, page, right):
        group, markers = right.contenders[0], markers_of(drawn_map(page))
        view, goals = charts.View.of(right.goal_regions), right.trials.goals
        outcomes, seen = charts.worst_outcomes(group), set()
        symbols = template("parts.html").module.symbols
        assert sorted(markers) == list(range(len(goals)))
        for trial, marker in markers.items():
            across, down = coordinates(marker.get("d"))[0]
            x, y = view.x[1] - down / charts.SCALE, view.y[1] - across / charts.SCALE
            assert (x, y) == pytest.approx(goals[trial, :2], abs=PIXEL / charts.SCALE)
            colour = level(group.distances[:, trial].mean(), right.tolerance)
            assert marker.get("class") == f"d{colour}"
            assert marker.get("d").endswith(symbols[outcomes[trial]])
            seen.add(outcomes[trial])
        assert len(seen) > 1

    def test_regions_obstacles_and_base_are_to_scale(self, page, right):
        drawn = drawn_map(page)
        (region,), view = right.goal_regions, charts.View.of(right.goal_regions)
        (rect,), base = drawn.findall("rect"), drawn.find("circle")
        (bench,) = drawn.findall("polygon")
        assert bench.find("title").text == "obstacle: right bench"
        assert rect.find("title").text == "region: right"
        places = [tuple(map(float, place.split(","))) for place in bench.get("points").split()]
        (obstacle,) = (each for each in PAPER_BENCHES if each.name == "right bench")
        ends = np.array([obstacle.lower[:2], obstacle.upper[:2]])
        across = (view.y[1] - ends[:, 1]) * charts.SCALE
        down = (view.x[1] - ends[:, 0]) * charts.SCALE
        for number, scaled in enumerate((across, down)):
            found = sorted({place[number] for place in places})
            assert found == pytest.approx(sorted(scaled), abs=PIXEL)
        assert float(rect.get("width")) == pytest.approx(
            (region.upper[1] - region.lower[1]) * charts.SCALE
        )
        assert float(rect.get("height")) == pytest.approx(
            (region.upper[0] - region.lower[0]) * charts.SCALE
        )
        assert float(rect.get("x")) == pytest.approx((view.y[1] - region.upper[1]) * charts.SCALE)
        # The right bench lies to the right of the base.
        assert float(rect.get("x")) > float(base.get("cx"))
        assert float(base.get("cx")) == pytest.approx(view.y[1] * charts.SCALE)
        assert float(base.get("cy")) == pytest.approx(view.x[1] * charts.SCALE)

    @pytest.mark.parametrize(
        ("distance", "expected"),
        [(0.0, 0), (0.05, 0), (0.0501, 1), (0.1, 1), (0.2, 2), (0.21, 3), (0.8, 4), (9.0, 5)],
    )
    def test_colours_double_in_distance(self, distance, expected):
        assert level(distance, 0.05) == expected


def test_maps_show_bodies_of_every_shape_as_they_stand():
    ball = Body(name="ball", shape="sphere", size=(0.1,), position=(0.3, 0.2, 0.4))
    wall = Body(name="wall", shape="halfspace", position=(0.0, 0.9, 0.0), rpy=(np.pi / 2, 0, 0))
    far = Body(name="far", shape="sphere", size=(0.1,), position=(9.0, 0.0, 0.0))
    box = Obstacle(name="box", lower=(0.4, -0.1, 0), upper=(0.6, 0.1, 0.5), yaw=np.pi / 4)
    view = charts.View((-1.0, 1.0), (-1.0, 1.0))
    found = dict(charts.footprints(Scene(obstacles=(ball, wall, far, box)), view))
    assert set(found) == {"ball", "box"}
    corners = np.array([0.5, 0]) + 0.1 * np.sqrt(2) * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    for corner in corners:
        assert np.abs(np.array(found["box"]) - corner).max(axis=1).min() < 1e-9
    distances = np.linalg.norm(np.array(found["ball"]) - (0.3, 0.2), axis=1)
    np.testing.assert_allclose(distances, 0.1, atol=1e-3)
