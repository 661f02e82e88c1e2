"""Charts and maps of reports: drawn to scale, from the figures of the trials."""

import re
from math import log, sqrt
from xml.etree import ElementTree

import numpy as np
import pytest
from drawings import PIXEL

from kinarm.evaluation.report import charts
from kinarm.evaluation.report.charts import level
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.statistics import share_over_seeds


def drawn(page: str, path: str) -> ElementTree.Element:
    """The first part of a report that lies there."""
    found = page[page.index("<main") : page.index("</main>") + len("</main>")]
    return ElementTree.fromstring(found).find(path)


def drawn_map(page: str) -> ElementTree.Element:
    """The first map of a report."""
    return drawn(page, ".//svg[@class='map'][@tabindex]")


def shapes(page: str, name: str, classes: str) -> list[ElementTree.Element]:
    """Shapes that belong to a policy, in the charts of the problem right."""
    section = drawn(page, ".//section[@id='right']")
    return section.findall(f".//g[@data-series='{name}']/*[@class='{classes}']")


def markers_of(drawn: ElementTree.Element) -> dict[int, ElementTree.Element]:
    """Markers of a map by the numbers of their trials."""
    titled = ((path, path.findtext("title", "")) for path in drawn.findall("path"))
    trials = ((re.match(r"trial (\d+)", title), path) for path, title in titled)
    return {int(found[1]): path for found, path in trials if found}


def coordinates(path: str) -> np.ndarray:
    return np.array(re.findall(r"(-?[\d.]+)[ ,](-?[\d.]+)", path), dtype=float)


CHART = template_environment(autoescape=True).get_template("chart.html").module


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
        symbols = template_environment().get_template("parts.html").module.symbols
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
        rects, base = drawn.findall("rect"), drawn.find("circle")
        assert [rect.find("title").text for rect in rects] == [
            "obstacle: right bench",
            "region: right",
        ]
        rect = rects[1]
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
