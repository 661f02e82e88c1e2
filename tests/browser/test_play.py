"""The playground in a real browser: its episodes are the simulator's, and one can play."""

from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
import pytest
from known_arms import INSTALLED
from random_policies import policy_for, sliding

from kinarm import Observation, Scene, Simulator
from kinarm.evaluation import ReplayRequest, TrialSet
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.replay import PLAYED, page_policy
from kinarm.goals import REST_PARTS, GoalSpecification
from kinarm.observation import OBSERVATION
from kinarm.plant import Plant
from kinarm.policies import load_policy
from kinarm.policies.mirror import problem_mirror
from kinarm.problem import ReachProblem
from kinarm.viewer.pages import play_page

ROLLOUT = "(r) => kinarm.rollout(r).map((end) => [end.joints, end.steps, end.outcome])"
PATHS = "(r) => kinarm.rollout(r).map((end) => end.path)"
SOLUTIONS = "([starts, goals]) => starts.map((q, n) => kinarm.solution(q, goals[n]))"
DRAGGED = """async () => {
    for (let frame = 0; frame < 30; frame++) {
        const [x, ...rest] = kinarm.state.goal;
        kinarm.setGoal([x + 0.001, ...rest]);
        await new Promise(requestAnimationFrame);
    }
}"""
LOOK = "[[-2.35, 1.85, 1.5], [0, 0, 0.3]]"
OTHERS = {"proximity", "obstacles", *chain(*REST_PARTS.values())}
SEEN = [part.name for part in OBSERVATION if part.name not in OTHERS]


@pytest.fixture(scope="module")
def play_file(tmp_path_factory):
    """The page without any option."""
    out = tmp_path_factory.mktemp("play") / "play.html"
    ReplayRequest(play=(), out=out).run()
    return out


@pytest.fixture(scope="module")
def page(visit, play_file):
    with visit(play_file, (1280, 800)) as opened:
        yield opened


@pytest.fixture
def watched(page):
    """The same, at the start of its first trial."""
    page.page.keyboard.press("r")
    page.tell("document.activeElement.blur()")
    yield page
    for number in (0, 1):
        page.tell(f"kinarm.moveObstacle({number}, [0, 0, 0])")


@pytest.fixture(scope="module")
def trials():
    return TrialSet.draw("both", 250, 3)


def check_episodes(page, simulator, policy, starts, goals, settings=None):
    """Final joints, steps and outcomes are the simulator's; return the outcomes."""
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    asked = {"starts": starts.tolist(), "goals": goals.tolist(), **(settings or {})}
    joints, steps, outcomes = zip(*page.page.evaluate(ROLLOUT, asked), strict=True)
    np.testing.assert_array_equal(steps, rollouts.steps)
    ends = np.where(rollouts.success, "success", "truncated")
    np.testing.assert_array_equal(outcomes, np.where(rollouts.collision, "collision", ends))
    expected = rollouts.paths[np.arange(len(starts)), rollouts.steps]
    np.testing.assert_allclose(joints, expected, rtol=0, atol=1e-9)
    return set(outcomes)


def page_of(simulator, policy, visit, folder):
    world = simulator.world
    player = page_policy("random", policy, world)
    starts, goals = simulator.sample(np.random.default_rng(0), 40)
    play_page(world, [player], starts, goals).save(folder / "play.html")
    return visit(folder / "play.html"), starts, goals


def test_thousand_episodes_are_those_of_the_simulator(page, trials):
    ends = set()
    for number, name in enumerate(PLAYED):
        given = load_policy(f"{name}-seed0"), trials.starts, trials.goals
        ends |= check_episodes(page, trials.simulator, *given, {"policy": number})
    assert ends == {"success", "collision", "truncated"}


@pytest.mark.parametrize(("hertz", "delay"), [(20, 0), (5, 1), (0, 2)])
def test_lag_and_delay(page, trials, hertz, delay):
    simulator = trials.simulator.with_plant(Plant(bandwidth=float(hertz), delay=delay))
    ends = set()
    for number, name in enumerate(PLAYED):
        given = load_policy(f"{name}-seed0"), trials.starts[:60], trials.goals[:60]
        settings = {"policy": number, "servo": hertz, "delay": delay}
        ends |= check_episodes(page, simulator, *given, settings)
    assert ends >= {"success", "collision"}


@pytest.mark.parametrize(("hertz", "delay"), [(0, 0), (10, 1)])
def test_no_step_behind_the_shield_touches(page, trials, hertz, delay):
    """Every step is free of contact, as kinarm's own world decides."""
    bare = trials.simulator.with_plant(Plant(bandwidth=float(hertz), delay=delay))
    met = 0
    for number in (0, len(PLAYED) - 1):
        policy = load_policy(f"{PLAYED[number]}-seed0")
        touched = bare.rollout(policy, trials.starts, trials.goals).collision
        touched = touched & (np.cumsum(touched) <= 20)
        asked = {"starts": trials.starts[touched].tolist(), "goals": trials.goals[touched].tolist()}
        settings = {"policy": number, "shield": True, "servo": hertz, "delay": delay}
        for path in page.page.evaluate(PATHS, asked | settings):
            world = trials.simulator.world
            assert not any(world.contact(q, target) for q, target in pairwise(path))
            met += 1
    assert met > 15


@pytest.mark.parametrize(
    ("kind", "feedback"),
    [
        ("pose", "measured"),
        *(pytest.param(kind, "commanded", marks=pytest.mark.rare) for kind in ("pose", "position")),
        pytest.param("direction", "measured", marks=pytest.mark.rare),
    ],
)
def test_all_that_a_policy_may_see(visit, tmp_path, kind, feedback):
    goal = GoalSpecification(kind=kind, rotation_tolerance=1.5, hold=2, speed=5.0)
    problem = ReachProblem.load("both")
    problem = problem.replace(
        task=replace(problem.task, goal=goal, tolerance=0.5),
        plant=Plant(bandwidth=8.0, delay=1, feedback=feedback),
        observation=Observation(parts=(*SEEN, *REST_PARTS.get(kind, ())), history=3),
    )
    simulator = Simulator(problem, threads=1)
    policy = replace(policy_for(problem, activation="silu"), residual=True)
    visited, starts, goals = page_of(simulator, policy, visit, tmp_path)
    with visited as opened:
        ends = check_episodes(opened, simulator, policy, starts, goals, {"servo": 8, "delay": 1})
    assert len(ends) > 1


@pytest.mark.parametrize("activation", ["relu", "hardtanh", "elu", "leaky_relu"])
def test_functions_of_layers_and_mirror(visit, tmp_path, activation):
    simulator = Simulator("both", threads=1)
    mirror = problem_mirror(simulator.problem)
    policy = policy_for(simulator.problem, activation=activation, mirror=mirror)
    visited, starts, goals = page_of(simulator, policy, visit, tmp_path)
    with visited as opened:
        check_episodes(opened, simulator, policy, starts, goals)


@pytest.mark.parametrize("arm", ["ur5", "sliding"])
def test_other_arms(visit, tmp_path, arm, make_joint, write_robot):
    if arm == "sliding":
        arm = sliding(make_joint, write_robot)
    elif any(INSTALLED.args):
        pytest.skip("needs the extra robots")
    problem = ReachProblem.load("both").replace(arm=arm, scene=Scene())
    simulator = Simulator(problem, threads=1)
    policy = policy_for(problem)
    visited, starts, goals = page_of(simulator, policy, visit, tmp_path)
    with visited as opened:
        check_episodes(opened, simulator, policy, starts, goals)


def test_nearest_solutions(page, trials):
    """They reach their goals within their steps, mostly as few as the oracle proves necessary."""
    chosen = trials.first(60)
    floor = oracle_bounds(chosen).steps_lower_bound
    arm, rules = chosen.simulator.arm, chosen.simulator.world.rules
    asked = [chosen.starts.tolist(), chosen.goals.tolist()]
    solutions = page.page.evaluate(SOLUTIONS, asked)
    for start, goal, found in zip(chosen.starts, chosen.goals, solutions, strict=True):
        q = np.array(found["configuration"])
        assert np.linalg.norm(arm.tool_position(q) - goal) <= rules.tolerance + 1e-12
        assert (q >= arm.lower).all()
        assert (q <= arm.upper).all()
        moved = np.abs(q - start)[: len(rules.step_limit)] / rules.step_limit
        assert np.ceil(moved.max() - 1e-6) == found["steps"]
    more = np.array([found["steps"] for found in solutions]) - floor
    assert (more == 0).mean() > 0.9
    assert np.abs(more).max() <= 2


def test_nothing_is_fetched_and_nothing_fails(watched):
    watched.tell("for (let k = 0; k < 5; k++) kinarm.step()")
    assert len(watched.requests) == 1
    assert watched.complaints == []
    assert watched.tell("kinarm.census()")["triangles"] > 5000


def at_goal(watched):
    """Where the goal is seen, from a fixed place."""
    watched.tell(f"kinarm.lookFrom(...{LOOK})")
    return watched.tell("kinarm.onScreen(kinarm.state.goal)")


def test_the_cube_is_dragged(watched):
    x, y = at_goal(watched)
    before = watched.state
    watched.page.mouse.move(x, y)
    watched.page.mouse.down()
    watched.page.mouse.move(x + 60, y - 40, steps=3)
    watched.page.mouse.up()
    after = watched.state
    moved = np.subtract(after["goal"], before["goal"])
    np.testing.assert_allclose(watched.tell("kinarm.onScreen(kinarm.state.goal)"), [x + 60, y - 40])
    assert moved[2] > 0
    assert after["q"] == before["q"]
    assert after["steps"] == 0


def test_the_cube_is_dragged_by_touch(watched):
    """The view stays; a touch of nothing turns it."""
    x, y = at_goal(watched)
    session = watched.page.context.new_cdp_session(watched.page)

    def drag(*points):
        kinds = ("touchStart", *["touchMove"] * (len(points) - 1))
        for kind, (across, down) in zip(kinds, points, strict=True):
            touch = {"type": kind, "touchPoints": [{"x": across, "y": down}]}
            session.send("Input.dispatchTouchEvent", touch)
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    eye = watched.tell("kinarm.onScreen([0, 0, 0])")
    drag((x, y), (x - 30, y - 20), (x - 60, y - 40))
    found = watched.tell("kinarm.onScreen(kinarm.state.goal)")
    np.testing.assert_allclose(found, [x - 60, y - 40], atol=0.5)
    assert watched.tell("kinarm.onScreen([0, 0, 0])") == eye
    drag((1000, 150), (1040, 170), (1080, 200))
    assert watched.tell("kinarm.onScreen([0, 0, 0])") != eye


def test_an_obstacle_is_dragged_along_the_floor_and_touches(watched):
    """The verdict names what kinarm's world finds to touch."""
    at_goal(watched)
    x, y = watched.tell("kinarm.onScreen([0.3, -0.65, 0.31])")
    watched.page.mouse.move(x, y)
    watched.page.mouse.down()
    watched.page.mouse.move(x, y + 20, steps=3)
    watched.page.mouse.up()
    standing = watched.tell("kinarm.state.obstacles[0]")
    assert standing[2] == pytest.approx(0, abs=1e-9)
    assert np.abs(standing).max() > 0.02
    scene = Scene()
    other, bench = scene.obstacles
    met = set()
    for height in np.linspace(0, 1, 11):
        offset = np.array([0, -0.15, height])
        watched.tell(f"kinarm.moveObstacle(1, {offset.tolist()})")
        moved = replace(bench, lower=tuple(bench.lower + offset), upper=tuple(bench.upper + offset))
        there = replace(scene, obstacles=(other, moved))
        world = Simulator(ReachProblem.load("both").replace(scene=there), threads=1).world
        touching = world.contact(np.array(watched.state["q"]))
        assert watched.state["outcome"] == ("collision" if touching else None)
        if touching:
            assert " touches ".join(touching.pair) in watched.page.inner_text("#verdict")
        met.add(touching is None)
    assert met == {True, False}
    # Where it stands in the scene, shoulder and base are out of its reach.
    watched.tell("kinarm.moveObstacle(1, [0, -0.65, 0.1])")
    assert watched.state["outcome"] == "collision"
    assert "shoulder touches left bench" in watched.page.inner_text("#verdict")
    arm = world.arm
    joints = [shape.parentJoint for shape in arm.geometry.geometryObjects]
    touching = watched.tell("kinarm.contacts(kinarm.state.q)")
    assert {(0, 1), (1, 1)} <= {
        (joints[body], obstacle - len(joints)) for body, obstacle, *_ in touching
    }


def test_keys(watched):
    press = watched.page.keyboard.press
    at_goal(watched)
    goal = np.array(watched.state["goal"])
    for key, moved in (
        ("ArrowLeft", [0, 0.02, 0]),
        ("ArrowRight", [0, 0, 0]),
        ("ArrowUp", [0.02, 0, 0]),
        ("PageUp", [0.02, 0, 0.02]),
        ("PageDown", [0.02, 0, 0]),
        ("r", [0, 0, 0]),
    ):
        press(key)
        np.testing.assert_allclose(watched.state["goal"], goal + moved, atol=1e-12, err_msg=key)
    press("n")
    assert watched.state["trial"] == 1
    for key, what, value in (("s", "shield", True), ("t", "theme", "dark"), (" ", "playing", True)):
        before = watched.state[what]
        press(key)
        assert watched.state[what] == value != before
        press(key)
    press("?")
    assert watched.page.locator("#keys").is_visible()
    press("?")


def test_the_policy_plays_until_it_is_there(watched):
    watched.page.select_option("#policy", "0")
    watched.tell("while (!kinarm.state.outcome) kinarm.step()")
    assert watched.state["outcome"] == "success"
    assert watched.page.inner_text("#outcome") == "Reached"
    assert watched.page.inner_text("#spoken").startswith("Reached: within 0.050 m after")
    watched.page.wait_for_timeout(300)
    assert watched.page.inner_text("#solution") != "…"
    goal = watched.state["goal"]
    watched.tell(f"kinarm.setGoal({[*goal[:2], goal[2] + 0.2]})")
    assert (watched.state["steps"], watched.state["outcome"]) == (0, None)


def test_it_plays_and_a_contact_pulses(visit, play_file):
    with visit(play_file, calm=False) as opened:
        opened.page.wait_for_selector("#outcome[data-outcome=success]")
        again = "document.getElementById('reset').click()"
        opened.tell(f"{again}; kinarm.moveObstacle(1, [0, -0.15, 0.4])")
        opened.page.wait_for_timeout(200)
        assert opened.state["outcome"] == "collision"
        opened.page.keyboard.press("n")
        before = opened.state["q"]
        opened.tell(DRAGGED)
        assert opened.state["q"] != before, "the arm follows while the cube is dragged"
        assert opened.complaints == []


def test_lag_delay_and_policy_are_chosen(watched):
    for name, value, what, expected in (
        ("#servo", "1", "servo", 5),
        ("#delay", "2", "delay", 2),
        ("#policy", "2", "policy", f"{PLAYED[2]}-seed0"),
    ):
        watched.page.select_option(name, value)
        assert watched.state[what] == expected
        watched.tell("kinarm.step()")
        watched.page.select_option(name, "0")


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (320, 568), (760, 560)])
def test_a_phone_or_a_frame_shows_everything(watched, size):
    watched.page.set_viewport_size({"width": size[0], "height": size[1]})
    watched.page.keyboard.press("s")
    watched.check_fit(size, "#card", "#dock", "#policy", "#servo", "#delay", "#speed", "#shield")
    watched.page.keyboard.press("s")
    watched.page.set_viewport_size({"width": 1280, "height": 800})


def test_a_pose_is_turned(visit, tmp_path):
    problem = ReachProblem.load("both")
    problem = problem.replace(task=replace(problem.task, goal=GoalSpecification(kind="pose")))
    simulator = Simulator(problem, threads=1)
    visited, _, _ = page_of(simulator, policy_for(problem), visit, tmp_path)
    with visited as opened:
        x, y = at_goal(opened)
        before = opened.state["goal"]
        opened.page.click("#turn")
        opened.page.mouse.move(x, y)
        opened.page.mouse.down()
        opened.page.mouse.move(x + 50, y, steps=2)
        opened.page.mouse.up()
        after = opened.state["goal"]
        np.testing.assert_allclose(after[:3], before[:3])
        assert 2 * np.arccos(abs(np.dot(after[3:], before[3:]))) == pytest.approx(0.5)
        opened.page.keyboard.press("Shift+PageUp")
        turned = opened.state["goal"]
        assert 2 * np.arccos(abs(np.dot(after[3:], turned[3:]))) == pytest.approx(0.1)
        assert opened.page.locator("#angle").is_visible()
        assert opened.complaints == []
