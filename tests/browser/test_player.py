"""The replay in a real browser, offline."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from kinarm.arm import Arm
from kinarm.viewer import replay_page

CONTRAST = Path(__file__).with_name("contrast.js")


def placement(arm, configuration, name):
    """Pose of a joint or of the tool through Pinocchio, shape (4, 4)."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, np.array(configuration))
    if name == "tool":
        return data.oMf[arm.model.getFrameId("tool0", pin.FrameType.BODY)].homogeneous
    return data.oMi[int(name.removeprefix("axis_"))].homogeneous


def pose(watched, name, run=0):
    """Pose of a joint or of the tool in the page, shape (4, 4)."""
    return np.array(watched.tell(f"kinarm.pose({name!r}, {run})")).reshape(4, 4).T


def show(watched, index, frame):
    watched.tell(f"kinarm.select({index}); kinarm.seek({frame})")


def text(watched, selector):
    return watched.page.locator(selector).inner_text()


def test_it_is_drawn_nothing_is_fetched_and_nothing_fails(visit, page_file):
    """The arm is in the picture: many colours, and different ones at another step."""
    with visit(page_file, (400, 300), drawn=True) as watched:
        show(watched, 2, 5)
        watched.page.wait_for_timeout(100)
        pictures = []
        for frame in (0, 40):
            show(watched, 0, frame)
            pictures.append(watched.page.locator("#stage").screenshot())
        assert pictures[0] != pictures[1]
        assert len(pictures[0]) > 20_000
        assert watched.requests == [page_file.as_uri()]
        assert watched.complaints == []


@pytest.mark.parametrize("index", [0, 1, 2])
def test_poses_are_those_of_pinocchio(watched, recorded, index):
    arm, recording = Arm.load("paper"), recorded[index]
    names = ["tool", "axis_1", "axis_3", "axis_6"]
    for frame in (0, 1, recording.steps // 2, recording.steps):
        show(watched, index, frame)
        found = watched.page.evaluate("(names) => names.map((name) => kinarm.pose(name, 0))", names)
        for name, matrix in zip(names, found, strict=True):
            expected = placement(arm, recording.states[frame], name)
            seen = np.array(matrix).reshape(4, 4).T
            np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-6)


def test_the_card_says_what_happens(watched, recorded):
    collided = recorded[2]
    show(watched, 2, 3)
    assert text(watched, "#eyebrow") == f"Problem both · trial {collided.trial}"
    assert text(watched, "#runs .name") == "wave"
    assert text(watched, "#runs .badge") == "Contact"
    assert " touches ".join(collided.contact) in text(watched, "#runs .note")
    assert text(watched, "#step") == f"3 / {collided.steps}"
    assert text(watched, "#distance") == f"{collided.distances[3]:.3f} m"
    assert text(watched, "#floor") == "9 steps"
    show(watched, 0, 0)
    assert text(watched, "#runs .badge") == "Truncated"


def test_buttons(watched, recorded):
    page, trials = watched.page, [each.trial for each in recorded]
    show(watched, 0, 7)
    for button, what, value in (
        *(("forward", "frame", 8), ("back", "frame", 7), ("first", "frame", 0)),
        *(("play", "playing", True), ("play", "playing", False)),
        *(("next", "trial", trials[1]), ("previous", "trial", trials[0])),
        *(
            ("previous", "trial", trials[2]),
            ("theme", "theme", "dark"),
            ("theme", "theme", "light"),
        ),
    ):
        page.click(f"#{button}")
        assert watched.state[what] == value, button
        if watched.state["playing"]:
            page.wait_for_function("() => window.kinarm.state.frame > 1")
    page.select_option("#speed", "2")
    assert watched.state["speed"] == 2
    page.select_option("#trial", "1")
    assert watched.state["trial"] == trials[1]
    for visible in (True, False):
        page.click("#help")
        assert page.locator("#keys").is_visible() == visible


def test_the_scrubber(watched):
    show(watched, 0, 0)
    watched.page.fill("#frame", "13")
    assert watched.state["frame"] == 13
    watched.page.focus("#frame")
    watched.page.keyboard.press("ArrowRight")
    assert watched.state["frame"] == 14
    bounds = watched.page.locator("#plot").bounding_box()
    watched.page.mouse.click(bounds["x"] + bounds["width"] / 2, bounds["y"] + 10)
    assert watched.state["frame"] == round(watched.state["frames"] / 2)


def test_keys(watched, recorded):
    show(watched, 0, 7)
    watched.tell("document.activeElement.blur()")
    speed, (first, second, _) = watched.state["speed"], (each.trial for each in recorded)
    for key, what, value in (
        *(
            ("ArrowRight", "frame", 8),
            ("ArrowLeft", "frame", 7),
            ("End", "frame", recorded[0].steps),
        ),
        *(("Home", "frame", 0), (" ", "playing", True), (" ", "playing", False)),
        *(("n", "trial", second), ("p", "trial", first), ("t", "theme", "dark")),
        ("t", "theme", "light"),
    ):
        watched.page.keyboard.press(key)
        assert watched.state[what] == value, key
    watched.page.keyboard.press(",")
    assert watched.state["speed"] < speed
    watched.page.keyboard.press(".")
    assert watched.state["speed"] == speed
    for visible in (True, False):
        watched.page.keyboard.press("?")
        assert watched.page.locator("#keys").is_visible() == visible


def test_everything_can_be_reached_and_has_a_name(watched):
    nameless = watched.tell(
        "[...document.querySelectorAll('#dock button, #dock input, #dock select')]"
        ".filter((node) => !node.getAttribute('aria-label')).map((node) => node.id)"
    )
    assert nameless == []
    watched.page.focus("#first")
    watched.page.keyboard.press("Tab")
    assert watched.tell("document.activeElement.id") == "back"
    assert watched.tell("getComputedStyle(document.activeElement).outlineStyle") == "solid"


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (320, 568)])
def test_a_phone_shows_everything(watched, size):
    watched.page.set_viewport_size({"width": size[0], "height": size[1]})
    show(watched, 2, 3)
    watched.check_fit(size, "#card", "#dock", "#play", "#frame", "#speed", "#trial", "#next")
    watched.page.set_viewport_size({"width": 800, "height": 600})


def test_it_plays_by_itself_and_a_ghost_comes_along(visit, recorded, tmp_path):
    first = recorded[0]
    other = replace(
        first,
        policy="other",
        states=np.concatenate([first.states[:1], first.states[:-1]]),
    )
    replay_page([first], tmp_path / "made.html", ghosts=[other])
    with visit(tmp_path / "made.html", calm=False) as watched:
        assert watched.state["playing"]
        show(watched, 0, 20)
        arm = Arm.load("paper")
        for run, recording in enumerate((first, other)):
            expected = placement(arm, recording.states[20], "tool")
            np.testing.assert_allclose(pose(watched, "tool", run), expected, rtol=0, atol=1e-6)
        names = watched.page.locator("#runs .name").all_inner_texts()
        assert names == ["wave", "other"]
        assert not watched.page.locator("#trial-choice").is_visible()
        assert watched.complaints == []


GROUPS = ("hand touches bench within 3 steps", "truncated", "truncated")


@pytest.fixture(scope="module")
def listed_file(recorded, tmp_path_factory):
    """A page whose trials are listed in two groups."""
    path = tmp_path_factory.mktemp("listed") / "listed.html"
    replay_page(recorded, path, groups=GROUPS, heading="wave: 3 of 24 trials failed")
    return path


@pytest.fixture(scope="module")
def listed(visit, listed_file):
    """That page where there is room for the list."""
    with visit(listed_file, (1020, 660)) as opened:
        yield opened


def test_trials_are_listed_in_groups(listed, recorded):
    watched, page = listed, listed.page
    assert page.locator("#list-heading").inner_text() == "wave: 3 of 24 trials failed"
    groups = page.locator("#list-groups details")
    assert [" ".join(each.split()) for each in groups.locator("summary").all_inner_texts()] == [
        f"{GROUPS[0]} 1",
        f"{GROUPS[1]} 2",
    ]
    assert [each.get_attribute("open") is not None for each in groups.all()] == [True, False]
    page.locator("summary", has_text="truncated").click()
    page.get_by_role("button", name=f"Trial {recorded[2].trial}", exact=True).click()
    assert watched.state["index"] == 2
    marked = page.locator('.chip[aria-current="true"]').all_inner_texts()
    assert marked == [str(recorded[2].trial)]
    page.keyboard.press("p")
    assert page.locator('.chip[aria-current="true"]').all_inner_texts() == [str(recorded[1].trial)]
    labels = page.eval_on_selector_all("#trial optgroup", "all => all.map(each => each.label)")
    assert labels == list(dict.fromkeys(GROUPS))
    assert watched.complaints == []


def test_the_list_is_hidden_and_shown(listed):
    page = listed.page
    panel, button = page.locator("#trial-list"), page.locator("#list")
    assert panel.is_visible()
    page.keyboard.press("l")
    assert not panel.is_visible()
    assert button.get_attribute("aria-expanded") == "false"
    button.click()
    assert panel.is_visible()


def test_on_a_phone_the_list_waits_until_it_is_asked_for(visit, listed_file):
    with visit(listed_file, (390, 844)) as watched:
        page = watched.page
        panel = page.locator("#trial-list")
        assert not panel.is_visible()
        page.locator("#list").click()
        box = panel.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 390
        assert box["y"] + box["height"] <= page.locator("#dock").bounding_box()["y"]
        page.locator(".chip").first.click()
        assert not panel.is_visible()


@pytest.mark.parametrize("size", [(1280, 900), (390, 844)])
def test_text_can_be_read(watched, size):
    """A contrast of 4.5 to 1 at least (WCAG 2, AA)."""
    watched.page.set_viewport_size({"width": size[0], "height": size[1]})
    show(watched, 0, 0)
    contrast, where = watched.tell(CONTRAST.read_text())
    assert contrast >= 4.5, where


def test_steps_that_a_shield_replaced_are_marked_with_the_reason(visit, recorded, tmp_path):
    reasons = ((2, ("hand", "left bench")), (4, None))
    page, path = replace(recorded[0], replaced=reasons), tmp_path / "shielded.html"
    replay_page([page, recorded[1]], path)
    with visit(path, (600, 400)) as watched:
        show(watched, 0, 0)
        assert watched.page.locator("#plot .replaced").count() == 2
        said = []
        for frame in (0, 2, 4):
            show(watched, 0, frame)
            said.append(text(watched, "#replaced"))
        assert said == ["2 steps", "hand would touch left bench", "not proven free"]
        show(watched, 1, 0)
        assert watched.page.locator("#replaced-row").is_hidden()
        assert watched.complaints == []
