"""The page shows what the document says, draws it where it belongs, and fetches nothing."""

import re
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from drawings import PIXEL

from kinarm.errors import InvalidInputError
from kinarm.evaluation import EvaluationRequest
from kinarm.evaluation.report.groups import record_worst, worst_trials
from kinarm.evaluation.report.page import report_page
from kinarm.evaluation.report.templating import template
from kinarm.evaluation.summary import evaluation_document


def content(page: str) -> ElementTree.Element:
    """What the page shows; that it is well-formed XML, too, makes it easy to search."""
    return ElementTree.fromstring(page[page.index("<main") : page.index("</main>") + 7])


def text_of(element) -> str:
    return " ".join("".join(element.itertext()).split())


def rows_of(page: str, task: str) -> list[ElementTree.Element]:
    return content(page).findall(
        f".//section[@id='problem-{task}']//table[@class='summary']/tbody/tr"
    )


class TestTable:
    def test_intervals_are_drawn_to_scale(self, page, document, right):
        row = next(row for row in rows_of(page, "right") if text_of(row.find("th")) == "made-right")
        bar, share = row.find("td/svg"), document.pooled[0].metrics["success"]
        assert float(bar.find("circle").get("cx")) == pytest.approx(120 * share.value, abs=PIXEL)
        drawn = {path.get("class"): path.get("d") for path in bar.findall("path")}
        places = [*share.ci95, right.oracle_rate]
        found = re.findall(r"[MH]([\d.]+)", drawn["interval"] + drawn["bound"])
        assert [float(x) for x in found] == pytest.approx([120 * x for x in places], abs=PIXEL)


class TestWorst:
    def test_failures_come_first_and_the_farthest_of_them(self, right):
        """Each group shows the worst of what no better one shows; seeds count together."""
        chosen, taken = worst_trials(right), set()
        assert [group for group, *_ in chosen] == sorted(
            (group for group, *_ in chosen), key=right.contenders.index
        )
        for group in right.contenders:
            badness = {
                trial: min(
                    (bool(member.rollouts.success[trial]), -member.rollouts.distance[trial])
                    for member in group.members
                )
                for trial in range(len(right.trials))
                if trial not in taken
            }
            found = [(evaluation, trial) for owner, evaluation, trial in chosen if owner is group]
            shown = [
                (bool(each.rollouts.success[trial]), -each.rollouts.distance[trial])
                for each, trial in found
            ]
            assert shown == sorted(badness.values())[: len(shown)]
            assert len(shown) >= 3
            taken |= {trial for _, trial in found}

    def test_what_the_oracle_makes_of_a_trial(self):
        """It reached the first and the second goal, not the third, and was not asked of more."""
        bounds = SimpleNamespace(
            reachable=[True, True, False], steps=[9, 9, 64], steps_lower_bound=[9, 7, 40]
        )
        parts = template("parts.html").module
        told = [parts.oracle_steps(bounds, trial) for trial in range(4)]
        assert told == ["9", "9, proven \N{GREATER-THAN OR EQUAL TO} 7", "not reached", "not asked"]

    def test_replay_holds_the_trials_of_the_rows_in_their_order(self, page, tasks):
        chosen = [worst for task in tasks.values() for worst in worst_trials(task)]
        rows = content(page).findall(".//section[@id='worst']//tbody/tr")
        assert [row.get("data-replay") for row in rows] == [str(n) for n in range(len(chosen))]
        for recording, worst in zip(record_worst(chosen), chosen, strict=True):
            _, evaluation, trial = worst
            assert (recording.policy, recording.problem.name, recording.trial) == (
                evaluation.contestant.name,
                evaluation.problem.name,
                trial,
            )
            assert recording.final_distance == evaluation.rollouts.distance[trial]
            assert recording.outcome == evaluation.rollouts.outcomes[trial]


class TestPage:
    def test_nothing_points_outside(self, page):
        assert "default-src 'none'" in page
        own = page[: page.index("<iframe")] if "<iframe" in page else page
        assert not re.findall(r"(?i)https?://|//[a-z]+\.[a-z]|@import|url\(", own)
        assert all(
            target.startswith(("#", "data:,"))
            for target in re.findall(r'(?:href|src|action)="([^"]*)"', own)
        )

    def test_names_are_text_and_never_markup(self, faced):
        evil = '<img src=x onerror="alert(1)">&amp;'
        first = replace(faced[0], contestant=replace(faced[0].contestant, name=evil))
        page = report_page(evaluation_document([first], f"kinarm-eval --policy {evil}"), [first])
        assert "<img" not in page
        assert evil in [text_of(row.find("th")) for row in rows_of(page, "right")]
        assert evil in text_of(content(page).find(".//section[@id='method']//pre"))

    def test_policies_of_one_name_are_refused(self, skilled_evaluation):
        twice = [skilled_evaluation, skilled_evaluation]
        with pytest.raises(InvalidInputError, match="two policies are called 'skilled'"):
            report_page(evaluation_document(twice, ""), twice)


def test_problems_of_other_scenes_have_a_replay_of_their_own():
    request = EvaluationRequest(
        policies=("random",), problems=("right", "left", "post-paper"), trials=3, oracle=False
    )
    evaluations = request.evaluate()
    page = report_page(evaluation_document(evaluations, ""), evaluations)
    theatres = content(page).findall(".//div[@class='theatre']")
    captions = [[text_of(each) for each in theatre.iter("caption")] for theatre in theatres]
    assert captions == [["Problem right", "Problem left"], ["Problem post-paper"]]
    for theatre in theatres:
        rows = theatre.findall(".//tr[@data-replay]")
        assert [row.get("data-replay") for row in rows] == [str(n) for n in range(len(rows))]
        assert len(theatre.findall(".//iframe")) == 1
