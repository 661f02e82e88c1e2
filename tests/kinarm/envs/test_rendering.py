"""Pictures and the live page of environments."""

import copy
import urllib.error
import urllib.request
import webbrowser

import gymnasium
import numpy as np
import pytest

from kinarm.envs import ReachEnv, ReachGoalEnv, ReachVectorEnv
from kinarm.errors import InvalidInputError
from kinarm.viewer import Camera, Renderer, drawing

pytest.importorskip("raylib")

SMALL = {"width": 64, "height": 48}


@pytest.fixture
def opened(monkeypatch):
    """Addresses that would be opened in a browser; no time is spent at real pace."""
    addresses = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    monkeypatch.setattr(drawing.time, "sleep", lambda _: None)
    return addresses


def moved(env, steps=5, seed=0):
    """The environment after some short random steps."""
    env.reset(seed=seed)
    actions = np.random.default_rng(seed).uniform(-0.2, 0.2, (steps, *env.action_space.shape))
    for action in actions:
        env.step(action)
    return env


class TestPicture:
    @pytest.mark.parametrize("kind", [ReachEnv, ReachGoalEnv])
    def test_is_what_the_renderer_draws(self, kind):
        env = moved(kind("left", render_mode="rgb_array", **SMALL))
        episode = env.episodes
        expected = Renderer("left", **SMALL).render(
            episode.q[0], episode.goal[0], trace=env._pictures._traces[0, :6]
        )
        np.testing.assert_array_equal(env.render(), expected)

    def test_way_is_that_of_the_tool(self):
        env = ReachEnv("right", render_mode="rgb_array", **SMALL)
        env.reset(seed=0)
        tools = [env.simulator.arm.tool_position(env.episodes.q[0])]
        for action in np.random.default_rng(0).uniform(-0.2, 0.2, (4, 5)):
            env.step(action)
            tools.append(env.simulator.arm.tool_position(env.episodes.q[0]))
        np.testing.assert_allclose(env._pictures._traces[0, :5], tools, atol=1e-12)

    def test_contact_is_shown(self, simulator):
        env = ReachEnv("right", render_mode="rgb_array", **SMALL)
        env.reset(seed=0)
        ended = False
        while not ended:
            *_, ended, _, info = env.step([0.0, 1.0, -1.0, 0.0, 0.0])
        assert info["collision"]
        contact = env._pictures._contacts[0]
        refused = env.episodes.q[0], env.episodes.target[0]
        assert contact.pair == env.simulator.world.contact_pair(*refused)
        assert info["contact"] > 0
        picture = env.render().astype(int)
        env._pictures._contacts.clear()
        assert np.abs(env.render() - picture).max() > 50

    def test_size_and_camera(self):
        size = {"width": 50, "height": 30}
        above, usual = (
            moved(ReachEnv(render_mode="rgb_array", camera=camera, **size)).render()
            for camera in (Camera((0, 0, 4), (0, 0, 0)), None)
        )
        assert above.shape == usual.shape == (30, 50, 3)
        assert (above != usual).any()


def test_gymnasium_collects_pictures():
    """In the mode ``rgb_array_list``: all since the last call."""
    env = gymnasium.make("kinarm/ReachRight-v0", render_mode="rgb_array_list", **SMALL)
    single = ReachEnv(render_mode="rgb_array", **SMALL)
    for each in (env, single):
        each.reset(seed=0)
    expected = [single.render()]
    for action in np.random.default_rng(0).uniform(-0.2, 0.2, (4, 5)):
        env.step(action)
        single.step(action)
        expected.append(single.render())
    np.testing.assert_array_equal(env.render(), expected)
    assert env.render() == []


class TestBatch:
    def test_pictures_are_those_of_single_environments(self):
        batch = ReachVectorEnv(3, "both", render_mode="rgb_array", **SMALL)
        batch.reset(seed=4)
        pictures = batch.render()
        assert len(pictures) == 3
        for row, picture in enumerate(pictures):
            env = ReachEnv("both", render_mode="rgb_array", **SMALL)
            env.reset(seed=4 + row)
            np.testing.assert_array_equal(picture, env.render())

    @pytest.mark.parametrize(("count", "shape"), [(1, (48, 64)), (4, (48, 64)), (64, (12, 16))])
    def test_many_share_the_area_of_four(self, count, shape):
        env = ReachVectorEnv(count, render_mode="rgb_array", **SMALL)
        env.reset(seed=0)
        pictures = env.render()
        assert len(pictures) == count
        assert {picture.shape for picture in pictures} == {(*shape, 3)}


class TestHuman:
    def test_page_follows_and_ends_with_the_environment(self, opened):
        env = ReachEnv(render_mode="human")
        assert opened == []
        moved(env)
        assert env.render() is None
        (address,) = opened
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=10) as page:
            assert page.status == 200
        env.close()
        with pytest.raises(urllib.error.URLError):
            urllib.request.urlopen(address, timeout=10)

    def test_copies_can_be_made(self, opened):
        env = moved(ReachEnv(render_mode="human"), 1)
        other = copy.deepcopy(env)
        other.step(np.zeros(5))
        assert len(opened) == 2
        env.close()
        other.close()

    def test_keeps_the_arms_own_time(self, monkeypatch, opened):
        waits, now = [], [100.0]
        monkeypatch.setattr(drawing.time, "sleep", waits.append)
        monkeypatch.setattr(drawing.time, "monotonic", lambda: now[0])
        env = moved(ReachEnv(render_mode="human"), 0)
        env.step(np.zeros(5))
        now[0] += 0.005
        env.step(np.zeros(5))
        now[0] += 1.0
        env.step(np.zeros(5))
        assert waits == pytest.approx([0.0, 0.015, 0.0])
        env.close()


class TestFilms:
    def test_batch(self, tmp_path):
        pytest.importorskip("moviepy")
        env = gymnasium.make_vec(
            "kinarm/ReachBoth-v0", num_envs=4, vectorization_mode="vector_entry_point",
            render_mode="rgb_array", horizon=3, **SMALL
        )  # fmt: skip
        env = gymnasium.wrappers.vector.RecordVideo(
            env, str(tmp_path / "films"), step_trigger=lambda step: step == 0
        )
        moved(env, 5).close()
        assert list(tmp_path.glob("films/*.mp4"))


class TestBadInput:
    @pytest.mark.parametrize("kind", [ReachEnv, ReachVectorEnv])
    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"render_mode": "film"}, "render_mode must be one of .*rgb_array.*human.*'film'"),
            ({"width": 0}, "width must be a whole number of at least 1, got 0"),
            ({"camera": "above"}, "camera must be a kinarm.viewer.Camera, got 'above'"),
        ],
    )
    def test_is_refused_at_once(self, kind, settings, message):
        with pytest.raises(InvalidInputError, match=message):
            kind(**settings)
