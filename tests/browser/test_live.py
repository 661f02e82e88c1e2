"""The live page of an environment in a real browser."""

import webbrowser

import numpy as np

from kinarm.envs import ReachEnv

MESHES = """() => {
  const meshes = [];
  const arm = viewer.scene_tree.find(["meshcat", "arm"]).object;
  arm.traverse((node) => { if (node.isMesh) meshes.push(node); });
  return meshes.length;
}"""
COSINE = """() => {
  const [, , z, w] =
    viewer.scene_tree.find(["meshcat", "arm", "axis_1"]).object.quaternion.toArray();
  return w * w - z * z;
}"""


def test_what_is_drawn_is_seen_by_those_who_come_later(new_context, monkeypatch):
    addresses = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    env = ReachEnv("right", render_mode="human")
    env.reset(seed=0)
    page = new_context(offline=False, viewport={"width": 300, "height": 200}).new_page()
    page.goto(addresses[0])
    page.wait_for_function(f"() => ({MESHES})() >= 12", timeout=60_000)
    env.step([0.5, 0, 0, 0, 0])
    cosine = float(np.cos(env.episodes.q[0, 0]))
    page.wait_for_function(f"(cosine) => Math.abs(({COSINE})() - cosine) < 1e-6", arg=cosine)
    env.close()
