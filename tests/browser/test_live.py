"""The live page in a real browser."""

import numpy as np

from kinarm.arm import Arm
from kinarm.scene import Scene
from kinarm.viewer.drawing import aim_camera, draw_arm, draw_surroundings
from kinarm.viewer.live_server import LiveServer

COUNT = """() => {
  let meshes = 0;
  const arm = viewer.scene_tree.find(["meshcat", "arm"]).object;
  arm.traverse((node) => { meshes += node.isMesh ? 1 : 0; });
  viewer.render();
  return [meshes, viewer.renderer.info.render.triangles];
}"""
PLACE = """() => viewer.scene_tree.find(["meshcat", "arm", "axis_1"]).object.position.toArray()"""


def test_what_is_drawn_is_seen_by_those_who_come_later(new_context):
    with LiveServer(7300) as server:
        draw_surroundings(server.window, Scene())
        aim_camera(server.window)
        frames = draw_arm(server.window["arm"], Arm.load("paper"))
        placement = np.eye(4)
        placement[:3, 3] = (0.1, 0.2, 0.3)
        frames[1].set_transform(placement)
        context = new_context(offline=False, viewport={"width": 300, "height": 200})
        page = context.new_page()
        requests = []
        page.on("request", lambda request: requests.append(request.url))
        page.goto(server.address)
        page.wait_for_function(f"() => ({COUNT})()[0] >= 12", timeout=60_000)
        meshes, triangles = page.evaluate(COUNT)
        assert meshes >= 12
        assert triangles > 10_000
        assert page.evaluate(PLACE) == [0.1, 0.2, 0.3]
        assert all(url.startswith(server.address) for url in requests)
        context.close()
