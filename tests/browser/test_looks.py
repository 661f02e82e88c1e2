"""Pictures look like the replay page, which a browser draws."""

import io

import numpy as np
import pytest
from PIL import Image

from kinarm.recording import record_rollouts
from kinarm.simulator import Simulator
from kinarm.viewer import Camera, Renderer, replay_page

BARE = "#card, #dock { display: none !important; }"
SIZE = (480, 360)


@pytest.mark.rare
@pytest.mark.parametrize("problem", ["both", "shelf-panda"])
def test_a_picture_looks_like_the_page(visit, tmp_path, problem):
    """To the eye the same: few pixels differ, and those along edges."""
    if problem != "both":
        pytest.importorskip("trimesh")
    simulator = Simulator(problem, threads=1)
    starts, goals = simulator.sample(np.random.default_rng(0), 1)
    still = np.zeros((1, simulator.task.horizon, simulator.n_actions))
    rollouts = simulator.rollout_actions(still, starts, goals, record=True)
    (recording,) = record_rollouts(simulator, rollouts, "still")
    replay_page(recording, tmp_path / "made.html")
    camera = Camera.of_replays(recording.problem)
    with visit(tmp_path / "made.html", SIZE, drawn=True) as watched:
        watched.page.add_style_tag(content=BARE)
        watched.tell(f"kinarm.lookFrom({list(camera.position)}, {list(camera.target)})")
        watched.tell("kinarm.seek(0)")
        assert watched.complaints == []
        shown = np.asarray(Image.open(io.BytesIO(watched.page.screenshot())).convert("RGB"), int)
    drawn = Renderer(recording.problem).render(recording.states[0], recording.goal).astype(int)
    apart = np.abs(shown - drawn).max(axis=2)
    assert np.median(apart) <= 2
    assert (apart > 24).mean() < 0.03
