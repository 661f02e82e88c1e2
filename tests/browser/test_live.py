"""The live page of an environment in a real browser."""

import webbrowser

import numpy as np

from kinarm.envs import ReachEnv

MESHES = """() => {
  let meshes = 0;
  viewer.scene_tree.find(["meshcat", "arm"]).object.traverse((node) => { meshes += Boolean(node.isMesh); });
  return meshes;
}"""
TURN = """() => viewer.scene_tree.find(["meshcat", "arm", "axis_1"]).object.quaternion.toArray()"""


def test_what_is_drawn_is_seen_by_those_who_come_later(new_context, monkeypatch):
    addresses = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    env = ReachEnv("right", render_mode="human")
    env.reset(seed=0)
    page = new_context(offline=False, viewport={"width": 300, "height": 200}).new_page()
    page.goto(addresses[0])
    page.wait_for_function(f"() => ({MESHES})() >= 12", timeout=60_000)
    env.step([0.5, 0, 0, 0, 0])
    angle = env.unwrapped.episodes.q[0, 0]
    turned = np.cos(angle / 2), np.sin(angle / 2)
    page.wait_for_function(
        f"([w, z]) => Math.hypot(({TURN})()[3] - w, ({TURN})()[2] - z) < 1e-6", arg=turned
    )
    env.close()
