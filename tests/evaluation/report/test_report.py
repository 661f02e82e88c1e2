"""The page shows what the document says, draws it where it belongs, and fetches nothing."""

import re
from dataclasses import replace
from importlib import resources
from math import log, sqrt
from statistics import NormalDist
from xml.etree import ElementTree

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, OutputError
from kinarm.evaluation.document import evaluation_document
from kinarm.evaluation.entrants import BASELINES, ORACLE, Entrant
from kinarm.evaluation.evaluation import evaluate, run_trials
from kinarm.evaluation.report import charts, maps
from kinarm.evaluation.report.groups import PAGE_COLOURS, PAGE_DASHES, group_results
from kinarm.evaluation.report.maps import fates, level
from kinarm.evaluation.report.page import page_template, report_page, write_report
from kinarm.evaluation.report.worst import record_worst, worst_trials
from kinarm.evaluation.table import table_rows
from kinarm.problem import ReachProblem
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.task import ReachTask
from kinarm.viewer import replay_page

PIXEL = 0.051
"""Coordinates are written to a tenth."""


@pytest.fixture(scope="module")
def faced(bounded_evaluations):
    """Several policies, seeds and tasks, the baseline and the oracle."""
    trial_sets = {each.problem.name: each.trials for each in bounded_evaluations}
    oracle = [run_trials(ORACLE, trials, oracle=True) for trials in trial_sets.values()]
    return [*bounded_evaluations, *oracle]


@pytest.fixture(scope="module")
def document(faced):
    return evaluation_document(faced, "kinarm-eval --report 'my results'")


@pytest.fixture(scope="module")
def page(document, faced) -> str:
    return report_page(document, faced)


@pytest.fixture(scope="module")
def tasks(document, faced):
    return {task.name: task for task in group_results(document, faced)}


@pytest.fixture(scope="module")
def right(tasks):
    return tasks["right"]


def content(page: str) -> ElementTree.Element:
    """What the page shows; that it is well-formed XML, too, makes it easy to search."""
    return ElementTree.fromstring(page[page.index("<main") : page.index("</main>") + 7])


def text_of(element) -> str:
    return " ".join("".join(element.itertext()).split())


def rows_of(page: str, task: str) -> list[ElementTree.Element]:
    return content(page).findall(f".//section[@id='{task}']//table[@class='summary']/tbody/tr")


def shapes(drawing, name: str, classes: str):
    """Shapes of a chart that belong to a policy."""
    return [s for s in drawing.shapes if s.series == name and s.classes == classes]


def drawn_map(task, group) -> ElementTree.Element:
    """The map of a group."""
    template = page_template().environment.get_template("map.html")
    return ElementTree.fromstring(template.module.bench_map(task, group))


def coordinates(path: str) -> np.ndarray:
    return np.array(re.findall(r"(-?[\d.]+)[ ,](-?[\d.]+)", path), dtype=float)


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """Wilson's interval from its formula."""
    z, share = NormalDist().inv_cdf(0.975), hits / trials
    centre = share + z**2 / (2 * trials)
    half = z * sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    return (centre - half) / (1 + z**2 / trials), (centre + half) / (1 + z**2 / trials)


class TestTable:
    def test_rows_are_those_of_the_table_in_its_order(self, page, document):
        for task in document["protocol"]["problems"]:
            names = [text_of(row.find("th")) for row in rows_of(page, task)]
            assert names == [row["policy"] for row in table_rows(document, task)]

    def test_figures_are_those_of_the_document(self, page, document):
        pooled, spread = document["pooled"][0]["metrics"], document["pooled"][0]["spread"]
        row = next(row for row in rows_of(page, "right") if text_of(row.find("th")) == "made-right")
        cells = {cell.get("data-label"): list(cell.itertext()) for cell in row.findall("td")}
        low, high = (100 * end for end in pooled["success"]["ci95"])
        rate = 100 * pooled["success"]["value"]
        assert cells["success %"] == [f"{rate:.1f}", f"{low:.1f}\N{EN DASH}{high:.1f}"]
        assert cells["of oracle %"] == [f"{100 * pooled['relative_success']['value']:.1f}"]
        worst, best = (100 * spread["success"][end] for end in ("min", "max"))
        assert cells["over seeds %"] == [f"{worst:.1f}\N{EN DASH}{best:.1f}", "3 seeds"]
        assert cells["median m"][0] == f"{pooled['median_distance']['value']:.3f}"
        assert cells["contact %"] == [f"{100 * pooled['collision']['value']:.1f}"]
        assert cells["step ratio"] == [
            f"{pooled['step_ratio']['value']:.2f}",
            f"p95 {pooled['step_ratio_p95']['value']:.2f}",
        ]

    def test_intervals_are_drawn_to_scale(self, document):
        parts = page_template().environment.get_template("parts.html").module
        row = document["pooled"][0]
        bar = ElementTree.fromstring(parts.interval_bar(row, 0.75, "colour0"))
        share = row["metrics"]["success"]
        assert float(bar.find("circle").get("cx")) == pytest.approx(120 * share["value"], abs=PIXEL)
        drawn = {path.get("class"): path.get("d") for path in bar.findall("path")}
        ends = [float(end) for end in re.findall(r"[MH]([\d.]+)", drawn["interval"])]
        assert ends == pytest.approx([120 * end for end in share["ci95"]], abs=PIXEL)
        assert drawn["bound"].startswith("M90,")

    def test_without_bounds_there_are_no_columns_for_them(self, evaluations):
        page = report_page(evaluation_document(evaluations, ""), evaluations)
        labels = {cell.get("data-label") for cell in rows_of(page, "right")[0].findall("td")}
        assert "success %" in labels
        assert not labels & {"of oracle %", "step ratio"}
        assert 'class="bound"' not in page
        assert 'data-label="oracle"' not in page

    def test_the_best_of_each_task_stand_at_the_top(self, page, document):
        for task in document["protocol"]["problems"]:
            row = next(r for r in table_rows(document, task) if r["algorithm"] == "ars")
            card = re.search(rf'<a href="#{task}" class="card">.*?</a>', page, re.DOTALL)[0]
            assert f">{100 * row['metrics']['success']['value']:.1f}<" in card
            assert f"reached by {row['policy']} " in card


def places(limits):
    """Where distances lie across a profile chart."""
    low, high = log(limits[0]), log(limits[-1])
    inside = charts.WIDTH - charts.LEFT - charts.RIGHT
    return charts.LEFT + (np.log(limits) - low) / (high - low) * inside


class TestProfile:
    BOTTOM = charts.PROFILE_HEIGHT - charts.BELOW
    SPAN = BOTTOM - 14

    @pytest.mark.parametrize("name", ["made-right", "zero", "oracle"])
    def test_line_is_the_share_within_each_distance(self, right, name):
        group = next(group for group in right.groups if group.name == name)
        (line,) = shapes(charts.profile_chart(right), name, "line")
        limits = charts.profile_limits(right)
        share = [np.mean(group.distances <= limit) for limit in limits]
        xs, ys = coordinates(line.path).T
        # Points that lie on a straight line may be left out.
        np.testing.assert_allclose(
            (self.BOTTOM - ys) / self.SPAN, np.interp(xs, places(limits), share), atol=0.01
        )
        for edge in (0, -1):
            assert xs[edge] == pytest.approx(places(limits)[edge], abs=PIXEL)

    def test_band_is_wilsons_interval_widened_to_whole_hits(self, right):
        group = next(group for group in right.groups if group.name == "made-right")
        (band,) = shapes(charts.profile_chart(right), "made-right", "band")
        limits, trials = charts.profile_limits(right), group.distances.shape[1]
        there, back = np.split(coordinates(band.path)[: 2 * len(limits)], 2)
        tolerance = PIXEL / self.SPAN
        for place, limit in enumerate(limits):
            hits = (group.distances <= limit).sum() / len(group.members)
            low, high = wilson(int(hits), trials)[0], wilson(int(np.ceil(hits)), trials)[1]
            drawn = [(self.BOTTOM - y) / self.SPAN for y in (back[-1 - place, 1], there[place, 1])]
            assert drawn == pytest.approx([low, high], abs=tolerance)

    def test_tolerance_and_the_distances_of_the_table_are_exact(self, right):
        assert {0.05, 0.1, 0.2} <= set(charts.profile_limits(right))

    def test_everything_ends_at_the_top(self, right):
        for group in right.groups:
            (line,) = shapes(charts.profile_chart(right), group.name, "line")
            assert coordinates(line.path)[-1, 1] == 14

    def test_ticks(self):
        assert charts.log_ticks(0.01, 1.6) == [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]
        assert charts.log_ticks(0.003, 0.011) == [0.005, 0.01]

    def test_the_style_sheet_has_the_last_word(self, right):
        """Charts bring no colours or fonts of their own."""
        drawing = charts.profile_chart(right)
        chart = page_template().environment.get_template("parts.html").module.chart(drawing)
        assert not re.search(r"#[0-9a-f]{6}|font|style=", chart)
        assert drawing.description in chart


class TestHistogram:
    def test_shares_are_those_of_the_bins(self, right):
        group = next(group for group in right.groups if group.name == "made-right")
        edges = np.array([0, 0.05, 0.1, 5.0])
        distances = group.distances.ravel()
        expected = [
            np.mean((low <= distances) & (distances < high))
            for low, high in ((0, 0.05), (0.05, 0.1), (0.1, 5.0))
        ]
        assert charts.bin_shares(group, edges) == pytest.approx(expected)

    def test_bars_show_every_trial(self, right):
        drawing = charts.histogram_chart(right)
        for group in right.groups:
            bars = shapes(drawing, group.name, "bars")
            shares = [float(bar.title.split(": ")[1].split()[0]) for bar in bars]
            assert sum(shares) == pytest.approx(100, abs=0.005 * len(shares))

    def test_bars_are_as_high_as_the_root_of_their_share(self, right):
        drawing = charts.histogram_chart(right)
        row = (drawing.height - charts.BELOW) / len(right.groups)
        for group in right.groups:
            for bar in shapes(drawing, group.name, "bars"):
                heights = coordinates(bar.path)[:, 1]
                share = float(bar.title.split(": ")[1].split()[0]) / 100
                expected = row * charts.ROW_HEIGHT * sqrt(share)
                assert np.ptp(heights) == pytest.approx(expected, abs=0.3)


class TestMap:
    def test_markers_lie_at_the_goals(self, right):
        group = right.contenders[0]
        drawn = drawn_map(right, group)
        view = maps.View.of(right.goal_regions)
        goals = group.members[0].trials.goals
        markers = {}
        for marker in drawn.findall("path"):
            title = marker.find("title")
            if title is not None and title.text.startswith("trial"):
                trial = int(re.match(r"trial (\d+)", title.text)[1])
                markers[trial] = coordinates(marker.get("d"))[0]
        assert sorted(markers) == list(range(len(goals)))
        for trial, (across, down) in markers.items():
            x, y = view.x[1] - down / maps.SCALE, view.y[1] - across / maps.SCALE
            assert (x, y) == pytest.approx(goals[trial, :2], abs=PIXEL / maps.SCALE)

    def test_markers_have_the_colour_and_shape_of_what_happened(self, right):
        group = right.contenders[0]
        drawn = drawn_map(right, group)
        results = fates(group)
        seen = set()
        for marker in drawn.findall("path"):
            title = marker.find("title")
            if title is None or not title.text.startswith("trial"):
                continue
            fate = results[int(re.match(r"trial (\d+)", title.text)[1])]
            assert marker.get("class") == f"d{level(fate.distance, right.tolerance)}"
            assert marker.get("d").endswith(maps.SYMBOLS[fate.outcome])
            seen.add(fate.outcome)
        assert len(seen) > 1

    def test_many_trials_leave_a_map_light(self, right, monkeypatch):
        monkeypatch.setattr(maps, "MARKERS", 7)
        markers = maps.markers(right, right.contenders[0])
        assert sorted(marker.title.split(",")[0] for marker in markers) == [
            f"trial {number}" for number in range(7)
        ]

    def test_fate_is_the_worst_over_the_seeds(self, right):
        group = right.contenders[0]
        for trial, fate in enumerate(fates(group)):
            outcomes = [member.outcomes[trial] for member in group.members]
            assert fate.reached == outcomes.count("success")
            assert fate.distance == pytest.approx(group.distances[:, trial].mean())
            worst = next(o for o in ("collision", "truncated", "success") if o in outcomes)
            assert fate.outcome == worst

    def test_regions_obstacles_and_base_are_to_scale(self, right):
        drawn = drawn_map(right, right.contenders[0])
        (region,), view = right.goal_regions, maps.View.of(right.goal_regions)
        rects, base = drawn.findall("rect"), drawn.find("circle")
        assert [rect.find("title").text for rect in rects] == [
            "obstacle: right bench",
            "region: right",
        ]
        rect = rects[1]
        assert float(rect.get("width")) == pytest.approx(
            (region.upper[1] - region.lower[1]) * maps.SCALE
        )
        assert float(rect.get("height")) == pytest.approx(
            (region.upper[0] - region.lower[0]) * maps.SCALE
        )
        assert float(rect.get("x")) == pytest.approx((view.y[1] - region.upper[1]) * maps.SCALE)
        # The right bench lies to the right of the base.
        assert float(rect.get("x")) > float(base.get("cx"))
        assert float(base.get("cx")) == pytest.approx(view.y[1] * maps.SCALE)
        assert float(base.get("cy")) == pytest.approx(view.x[1] * maps.SCALE)

    def test_a_world_of_ones_own(self):
        """A region in front of the arm, and a post before it."""
        region = GoalRegion(name="front", lower=(0.4, -0.3, 0.2), upper=(0.7, 0.3, 0.5))
        post = Obstacle(name="post", lower=(0.3, -0.4, 0), upper=(0.36, -0.34, 0.8))
        far = Obstacle(name="far", lower=(5, 5, 0), upper=(6, 6, 1))
        scene = Scene(obstacles=(post, far), goal_regions=(region,))
        task = ReachTask(goal_regions=("front",))
        made = evaluate("zero", ReachProblem(name="own", scene=scene, task=task), trials=20)
        (results,) = group_results(evaluation_document([made], ""), [made])
        (group,) = results.groups
        rects = drawn_map(results, group).findall("rect")
        assert [rect.find("title").text for rect in rects] == ["obstacle: post", "region: front"]
        shares = [share for _, share in maps.failure_shares(group, region) if share is not None]
        assert shares == [1.0] * len(shares)
        assert "own" in report_page(evaluation_document([made], ""), [made])

    def test_failures_are_counted_where_they_happen(self, right):
        group, (region,) = right.contenders[0], right.goal_regions
        goals = group.members[0].trials.goals
        width = (region.upper[0] - region.lower[0]) / maps.SLICES
        for place, ((low, high), share) in enumerate(maps.failure_shares(group, region)):
            assert (low, high) == pytest.approx((region.lower[0] + place * width, low + width))
            inside = (low <= goals[:, 0]) & (goals[:, 0] < low + width)
            failed = [not o for m in group.members for o in m.rollouts.success[inside]]
            assert share == (pytest.approx(np.mean(failed)) if failed else None)

    @pytest.mark.parametrize(
        ("distance", "expected"),
        [(0.0, 0), (0.05, 0), (0.0501, 1), (0.1, 1), (0.2, 2), (0.21, 3), (0.8, 4), (9.0, 5)],
    )
    def test_colours_double_in_distance(self, distance, expected):
        assert level(distance, 0.05) == expected


class TestWorst:
    def test_failures_come_first_and_the_farthest_of_them(self, right):
        chosen = worst_trials(right)
        for group in right.contenders:
            everything = sorted(
                (bool(member.rollouts.success[trial]), -member.rollouts.distance[trial])
                for member in group.members
                for trial in range(len(member.trials))
            )
            found = [
                (bool(e.rollouts.success[trial]), -e.rollouts.distance[trial])
                for owner, e, trial in chosen
                if owner is group
            ]
            assert found == everything[: len(found)]
            assert len(found) >= 3

    def test_rows_tell_what_happened(self, page, right):
        rows = content(page).findall(".//section[@id='worst']//tbody/tr")
        for row, (_, evaluation, trial) in zip(rows, worst_trials(right), strict=False):
            cells = {cell.get("data-label"): text_of(cell) for cell in row.findall("td")}
            assert text_of(row.find("th")) == evaluation.entrant.name
            assert cells["trial"] == str(trial)
            assert cells["distance m"] == f"{evaluation.rollouts.distance[trial]:.3f}"
            assert cells["steps"] == str(evaluation.rollouts.steps[trial])
            assert cells["oracle"].startswith(str(evaluation.bounds.steps[trial]))
            pair = evaluation.contacts[trial]
            assert all(body in cells["outcome"] for body in pair or ())

    def test_replay_holds_the_trials_of_the_rows_in_their_order(self, page, tasks):
        chosen = [worst for task in tasks.values() for worst in worst_trials(task)]
        rows = content(page).findall(".//section[@id='worst']//tbody/tr")
        assert [row.get("data-replay") for row in rows] == [str(n) for n in range(len(chosen))]
        for recording, worst in zip(record_worst(chosen), chosen, strict=True):
            _, evaluation, trial = worst
            assert (recording.policy, recording.problem.name, recording.trial) == (
                evaluation.entrant.name,
                evaluation.problem.name,
                trial,
            )
            assert recording.final_distance == evaluation.rollouts.distance[trial]
            assert recording.outcome == evaluation.outcomes[trial]

    def test_replay_is_part_of_the_page(self, page, tasks):
        chosen = [worst for task in tasks.values() for worst in worst_trials(task)]
        (frame,) = content(page).findall(".//iframe")
        expected = replay_page(record_worst(chosen)).html
        assert " ".join(frame.get("data-page").split()) == " ".join(expected.split())
        assert frame.get("title")


class TestPage:
    def test_how_it_was_made_is_told(self, page, document):
        told = text_of(content(page).find(".//section[@id='method']"))
        protocol = document["protocol"]
        assert protocol["command"] in told
        assert protocol["problems"]["right"]["digest"] in told
        for entry in protocol["problems"].values():
            assert entry["trial_set_hash"] in told
        for package, version in protocol["versions"].items():
            assert f"{package} {version}" in told
        for words in (protocol["commit"], "Wilson", "percentile bootstrap", "1000 resamples"):
            assert words in told

    def test_nothing_points_outside(self, page):
        assert "default-src 'none'" in page
        own = page[: page.index("<iframe")] if "<iframe" in page else page
        assert not re.findall(r"(?i)https?://|//[a-z]+\.[a-z]|@import|url\(", own)
        assert all(
            target.startswith(("#", "data:,"))
            for target in re.findall(r'(?:href|src|action)="([^"]*)"', own)
        )

    def test_equal_input_gives_equal_text(self, page, document, faced):
        assert report_page(document, faced) == page

    def test_names_are_text_and_never_markup(self, faced):
        evil = '<img src=x onerror="alert(1)">&amp;'
        first = replace(faced[0], entrant=replace(faced[0].entrant, name=evil, group=evil))
        page = report_page(evaluation_document([first], f"kinarm-eval --policy {evil}"), [first])
        assert "<img" not in page
        assert evil in [text_of(row.find("th")) for row in rows_of(page, "right")]
        assert evil in text_of(content(page).find(".//section[@id='method']//pre"))

    def test_figures_are_described_for_those_who_cannot_see_them(self, page):
        for drawing in content(page).iter("svg"):
            hidden, role = drawing.get("aria-hidden"), drawing.get("role")
            assert hidden == "true" or (role == "img" and drawing.get("aria-label"))

    def test_classes_are_in_the_style_sheet(self, page):
        styles = (resources.files("kinarm.evaluation.report") / "templates/page.css").read_text()
        for kind, count in (("colour", PAGE_COLOURS), ("d", maps.DISTANCE_COLOURS)):
            for place in range(count):
                assert f".{kind}{place} {{" in styles
        for place in range(1, PAGE_DASHES):
            assert f".dash{place} .line" in styles
        for name in (*BASELINES, "oracle"):
            assert f".{name} .line" in styles

    def test_dark_and_light_have_the_same_variables(self):
        styles = (resources.files("kinarm.evaluation.report") / "templates/page.css").read_text()
        light, *dark = (
            set(re.findall(r"(--\w+):", block))
            for block in re.findall(r"\{([^{}]*--page:[^{}]*)\}", styles)
        )
        assert len(dark) == 2
        assert all(names == light for names in dark)

    @pytest.mark.parametrize("policy", ["zero", "oracle"])
    def test_untrained_ones_alone(self, policy):
        evaluation = evaluate(policy, "both", trials=4, oracle=True)
        page = report_page(evaluation_document([evaluation], ""), [evaluation])
        assert f"<h1>{policy}</h1>" in page
        assert [text_of(row.find("th")) for row in rows_of(page, "both")] == [policy]

    def test_a_single_trial(self, skilled):
        evaluation = evaluate(skilled, trials=1)
        page = report_page(evaluation_document([evaluation], ""), [evaluation])
        assert len(rows_of(page, "right")) == 1

    def test_many_policies_stay_apart(self, skilled_evaluation):
        many = [
            replace(
                skilled_evaluation, entrant=replace(Entrant.from_policy(name, made), group=name)
            )
            for name, made in (
                (f"policy{n}", skilled_evaluation.entrant.policy) for n in range(PAGE_COLOURS + 2)
            )
        ]
        (task,) = group_results(evaluation_document(many, ""), many)
        assert len({group.style for group in task.groups}) == len(many)

    def test_another_document_is_refused(self, document, evaluations):
        with pytest.raises(InvalidInputError, match="document of the very evaluations"):
            report_page(document, evaluations)

    def test_policies_of_one_name_are_refused(self, skilled_evaluation):
        twice = [skilled_evaluation, skilled_evaluation]
        with pytest.raises(InvalidInputError, match="two policies are called 'skilled'"):
            report_page(evaluation_document(twice, ""), twice)

    def test_a_single_policy_is_the_title(self, skilled_evaluation):
        page = report_page(evaluation_document([skilled_evaluation], ""), [skilled_evaluation])
        assert "<h1>skilled</h1>" in page

    def test_several_are_counted(self, page):
        assert "<h1>4 policies</h1>" in page


class TestWriting:
    def test_file_holds_the_page(self, page, document, faced, tmp_path):
        path = write_report(tmp_path / "new" / "folder", document, faced)
        assert path == tmp_path / "new" / "folder" / "index.html"
        assert path.read_text(encoding="utf-8") == page

    def test_what_cannot_be_written_is_said(self, document, faced, tmp_path):
        (tmp_path / "file").write_text("mine")
        with pytest.raises(OutputError, match="file"):
            write_report(tmp_path / "file", document, faced)
