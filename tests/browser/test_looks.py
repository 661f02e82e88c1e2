"""Pictures look like the replay page, which a browser draws."""

import io

import numpy as np
from PIL import Image

from kinarm.viewer import Camera, Renderer

BARE = "#card, #dock { display: none !important; }"
SIZE = (480, 360)


def test_a_picture_looks_like_the_page(open_page, page_file, recorded):
    """To the eye the same: few pixels differ, and those along edges."""
    recording = recorded[0]
    camera = Camera.of_replays(recording.problem)
    watched = open_page(page_file, SIZE)
    watched.page.add_style_tag(content=BARE)
    watched.tell(f"kinarm.lookFrom({list(camera.position)}, {list(camera.target)})")
    watched.tell("kinarm.select(0); kinarm.seek(0)")
    shown = np.asarray(Image.open(io.BytesIO(watched.page.screenshot())).convert("RGB"), int)
    drawn = Renderer(recording.problem).render(recording.states[0], recording.goal).astype(int)
    apart = np.abs(shown - drawn).max(axis=2)
    assert np.median(apart) <= 2
    assert (apart > 24).mean() < 0.03
