"""The report in a real browser: offline, quiet, dark and light, on a phone, with its replay."""

import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.report.groups import group_results, worst_trials
from kinarm.evaluation.report.page import write_report
from kinarm.evaluation.summary import evaluation_document
from kinarm.evaluation.table import metric_columns
from kinarm.evaluation.trials import TrialSet

pytestmark = pytest.mark.slow

DESKTOP = {"viewport": {"width": 1280, "height": 900}}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}

CONTRAST = Path(__file__).with_name("contrast.js")

PLAYER = "document.querySelector('#worst iframe').contentWindow.kinarm"


@pytest.fixture(scope="module")
def evaluations():
    """Two recipes on one task, one on another, beside the oracle."""
    made = []
    for problem, names in (("right", ("ars-tuned-both", "ppo-best-both")), ("both", ("zero",))):
        trials = TrialSet.draw(problem, 20, seed=3)
        bounds = oracle_bounds(trials)
        contestants = [each for name in names for each in find_contestants(name)]
        made += [run_trials(each, trials, bounds=bounds) for each in (*contestants, ORACLE)]
    return made


@pytest.fixture(scope="module")
def document(evaluations):
    return evaluation_document(evaluations, "kinarm-eval --report report")


@pytest.fixture(scope="module")
def chosen(document, evaluations):
    """The worst trials in the order of the rows."""
    return [worst for each in group_results(document, evaluations) for worst in worst_trials(each)]


@pytest.fixture(scope="module")
def report(document, evaluations, tmp_path_factory) -> Path:
    return write_report(tmp_path_factory.mktemp("report"), document, evaluations)


@pytest.fixture
def visit(watch, report):
    """Open the report without network or motion; nothing may be fetched or go wrong."""
    opened = []
    with ExitStack() as stack:

        def call(**settings):
            opened.append(stack.enter_context(watch(report, reduced_motion="reduce", **settings)))
            return opened[-1].page

        yield call
    for each in opened:
        assert each.complaints == []
        assert [url for url in each.requests if not url.startswith("data:")] == [report.as_uri()]


def wait_until(page, condition: str, seconds: float = 60):
    """Ask again and again; the page forbids the evaluation of strings that waiting would need."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(50)


def start_replay(page):
    page.locator("#worst iframe").scroll_into_view_if_needed()
    wait_until(page, f"Boolean({PLAYER})")


def colour_of(page, selector: str) -> str:
    return page.evaluate(f"getComputedStyle(document.querySelector('{selector}')).backgroundColor")


def test_page_fits_every_width(visit):
    page = visit()
    for width in (320, 390, 768, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_appearance_follows_the_system_and_the_button(visit):
    light = visit(**DESKTOP, color_scheme="light")
    dark = visit(**DESKTOP, color_scheme="dark")
    colours = [colour_of(page, "body") for page in (light, dark)]
    assert colours[0] != colours[1]
    for page, other in ((light, colours[1]), (dark, colours[0])):
        page.locator("#theme").click()
        assert colour_of(page, "body") == other


def test_text_can_be_read(visit):
    """A contrast of 4.5 to 1 at least (WCAG 2, AA), wherever there is text."""
    page = visit(**DESKTOP)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        contrast, where = page.evaluate(CONTRAST.read_text())
        assert contrast >= 4.5, (scheme, where)


def test_replay_waits_until_it_is_near_and_rests_out_of_sight(visit):
    page = visit(**DESKTOP)
    page.wait_for_timeout(500)
    assert not page.evaluate("document.querySelector('#worst iframe').srcdoc")
    start_replay(page)
    page.evaluate(f"{PLAYER}.play()")
    page.evaluate("window.scrollTo(0, 0)")
    wait_until(page, f"!{PLAYER}.state.playing")


def test_a_row_chooses_the_trial(visit, chosen):
    page = visit(**PHONE)
    start_replay(page)
    for place in (len(chosen) - 1, 2):
        page.locator(f"tr[data-replay='{place}'] th").click()
        state = page.evaluate(f"{PLAYER}.state")
        assert (state["policy"], state["problem"], state["trial"]) == (
            chosen[place].evaluation.contestant.name,
            chosen[place].evaluation.problem.name,
            chosen[place].trial,
        )
        assert page.locator("tr[aria-current]").get_attribute("data-replay") == str(place)
        top = "document.querySelector('#worst iframe').getBoundingClientRect().y"
        wait_until(page, f"0 <= {top} && {top} < {PHONE['viewport']['height'] / 2}")


def test_page_and_player_go_together(visit):
    """Rows can be chosen by key; rows and colours follow, whichever of the two changes them."""
    page = visit(**DESKTOP, color_scheme="light")
    page.locator("#theme").click()
    start_replay(page)
    wait_until(page, f"{PLAYER}.state.theme === 'dark'")
    page.locator("#theme").click()
    wait_until(page, f"{PLAYER}.state.theme === 'light'")
    page.locator("tr[data-replay='1'] button").focus()
    page.keyboard.press("Enter")
    assert page.evaluate(f"{PLAYER}.state.index") == 1
    page.frame_locator("#worst iframe").locator("#trial").select_option("2")
    wait_until(page, "document.querySelector('tr[aria-current]').dataset.replay === '2'")


def test_pointing_at_a_policy_dims_the_others(visit):
    page = visit(**DESKTOP)
    page.locator("#problem-right .legend li[data-series='ars-tuned-both']").hover()
    dimmed = page.locator("#problem-right .chart .dimmed").count()
    shown = page.locator("#problem-right .chart .series:not(.dimmed)").all()
    assert dimmed > 0
    assert {each.get_attribute("data-series") for each in shown} == {"ars-tuned-both"}


def is_within(page, tip) -> bool:
    """Whether a tip lies on the screen as a whole."""
    box, (width, height) = tip.bounding_box(), page.evaluate("[innerWidth, innerHeight]")
    across = box["x"] >= 0 and box["x"] + box["width"] <= width
    return across and box["y"] >= 0 and box["y"] + box["height"] <= height


def meaning_of(heading: str) -> str:
    return next(column.meaning for column in metric_columns() if column.heading == heading)


def test_a_tap_tells_what_a_figure_means(visit):
    page = visit(**PHONE)
    tip = page.locator("#tip")
    assert tip.is_hidden()
    for cell in page.locator("#problem-right td[data-term]:has(.value)").all():
        cell.tap()
        assert tip.inner_text() == meaning_of(cell.get_attribute("data-term"))
        assert is_within(page, tip)
    page.locator("#problem-right h2").tap()
    assert tip.is_hidden()


def test_arrows_go_through_the_goals_of_a_map(visit):
    page = visit(**DESKTOP)
    tip, first = page.locator("#tip"), page.locator("#problem-right svg.map[tabindex]").first
    titles = first.locator(":has(> title) > title").all_text_contents()[::-1]
    first.focus()
    for key, index in (("ArrowRight", 0), ("ArrowDown", 1), ("ArrowLeft", 0), ("ArrowUp", -1)):
        first.press(key)
        tip.wait_for()  # the page scrolls there
        assert tip.inner_text() == titles[index]
        assert first.locator(".chosen > title").text_content() == titles[index]
        assert is_within(page, tip)
    first.press("Escape")
    assert tip.is_hidden()
    first.press("ArrowRight")
    page.keyboard.press("Tab")
    assert tip.is_hidden()
    assert not first.locator(".chosen").count()


@pytest.mark.parametrize("width", [320, 1280])
def test_the_keyboard_tells_what_every_figure_means(visit, width):
    """Each figure of a table is on the way of the tabulator key, once, wherever it stands."""
    page = visit(viewport={"width": width, "height": 844})
    tip, told = page.locator("#tip"), []
    page.locator("#problem-right h2").evaluate("h2 => { h2.tabIndex = -1; h2.focus(); }")
    focus = "document.activeElement"
    while page.evaluate(f"{focus}.closest('section')?.id") == "problem-right":
        if page.evaluate(f"{focus}.classList.contains('term')"):
            told.append(page.evaluate(f"{focus}.textContent"))
            assert tip.inner_text() == meaning_of(told[-1])
            assert is_within(page, tip)
        page.keyboard.press("Tab")
    cells = page.locator("#problem-right td[data-term]:has(.value)").all()
    assert sorted(told) == sorted({cell.get_attribute("data-term") for cell in cells})
