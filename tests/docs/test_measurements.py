"""The scripts in ``docs/measurements``: MuJoCo's arm is kinarm's, and operations are counted."""

import tarfile

import numpy as np
import pytest
from known_arms import INSTALLED
from numba import njit

from docs.measurements import intervals, motionbenchmaker
from docs.measurements.counting import OperationCounter
from kinarm.arm import Arm
from kinarm.kernels.network import affine_layer
from kinarm.policies import load_policy
from kinarm.problem import PROBLEMS
from kinarm.world import World


def counted(function, *arguments):
    """Operations of each kind in a call of a function, which is compiled anew."""
    counter = OperationCounter()
    with counter.active():
        compiled = njit(error_model="numpy")(function)
        compiled(*arguments)
    counter.reset()
    compiled(*arguments)
    found = {}
    for counts in counter.by_function().values():
        for kind, count in counts.items():
            found[kind] = found.get(kind, 0) + count
    return {kind: count for kind, count in found.items() if count}


def test_layer_takes_a_product_and_a_sum_for_each_weight():
    weights, inputs, outputs = np.zeros(49 * 5), np.zeros((1, 48)), np.zeros((1, 5))
    found = counted(affine_layer.py_func, weights, 0, 48, 5, inputs, 0, outputs, 0)
    assert found == {"sums": 48 * 5, "products": 48 * 5}


def test_all_tables_of_intervals_are_printed(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["intervals", "--times", "2"])
    intervals.main()
    printed = capsys.readouterr().out
    rows = {"| seeds |": 2, "| 10 |": 15, "| mean distance, ": 1}
    assert {row: printed.count(row) for row in rows} == rows


class TestMuJoCo:
    @pytest.fixture(params=["paper", "lrmate200ic_5l", pytest.param("ur5", marks=INSTALLED)])
    def worlds(self, request):
        """An arm, in kinarm and in MuJoCo."""
        mujoco = pytest.importorskip("mujoco")
        from docs.measurements.peers import mujoco_model

        world = World(PROBLEMS["both"].replace(arm=request.param))
        model = mujoco_model(world, 0.02)
        return world, model, mujoco.MjData(model)

    def configurations(self, world, n):
        q = np.tile(world.arm.home, (n, 1))
        moved, rng = slice(0, world.n_actions), np.random.default_rng(0)
        q[:, moved] = rng.uniform(world.arm.lower[moved], world.arm.upper[moved], q[:, moved].shape)
        return q

    def test_joints_are_where_ours_are(self, worlds):
        import mujoco

        world, model, data = worlds
        moved = slice(0, world.n_actions)
        assert model.nq == model.nu == world.n_actions
        assert model.jnt_range[:, 0] == pytest.approx(world.arm.lower[moved])
        assert model.actuator_ctrlrange[:, 1] == pytest.approx(world.arm.upper[moved])
        for q in self.configurations(world, 20):
            data.qpos[:] = q[: model.nq]
            mujoco.mj_kinematics(model, data)
            last = data.body(f"link{world.arm.n_joints}")
            tool = last.xpos + last.xmat.reshape(3, 3) @ world.arm.chain.tool
            assert tool == pytest.approx(world.arm.tool_position(q), abs=1e-12)

    def test_same_bodies_touch(self, worlds):
        """But for configurations where they only just do, by either engine's tolerance."""
        import mujoco

        world, model, data = worlds
        q = self.configurations(world, 400)
        touching, found = world.screen(q)[1], np.zeros(400, dtype=bool)
        for i, configuration in enumerate(q):
            data.qpos[:] = configuration[: model.nq]
            mujoco.mj_forward(model, data)
            found[i] = data.ncon > 0
        assert 0.05 < touching.mean() < 0.95
        assert (found != touching).mean() <= 0.005

    def test_every_solid_has_its_size(self, make_joint, make_collision, write_robot):
        """The mass that MuJoCo gives a solid of density 1000 is that of its volume."""
        mujoco = pytest.importorskip("mujoco")
        from docs.measurements.peers import mujoco_spec

        shapes = {
            1: make_collision('<cylinder radius="0.1" length="0.3"/>', rpy="0.3 0.2 0.1"),
            2: make_collision('<sphere radius="0.1"/>'),
            3: make_collision('<box size="0.1 0.2 0.3"/>'),
        }
        path = write_robot([make_joint(), make_joint(xyz="0 0 0.5"), make_joint()], shapes)
        spec = mujoco_spec(World(PROBLEMS["right"].replace(arm=path)), 0.02)
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        model = spec.compile()
        volumes = [np.pi * 0.1**2 * 0.3, 4 / 3 * np.pi * 0.1**3, 0.1 * 0.2 * 0.3]
        masses = [model.body(f"link{k}").mass[0] for k in (1, 2, 3)]
        assert masses == pytest.approx(1000 * np.array(volumes))


class TestMotionBenchMaker:
    SCENE = (
        "world:\n  collision_objects:\n"
        "  - {id: can, primitives: [{type: cylinder, dimensions: [0.2, 0.05]}],\n"
        "     primitive_poses: [{position: [0.82, 0.13, 0.0], orientation: [0, 0, 0, 1]}]}\n"
    )
    """A can around the wrist of a UR5 at zero."""

    @INSTALLED
    def test_arm_touches_a_can_at_the_goal_alone(self, tmp_path, capsys):
        pytest.importorskip("yaml")
        source = Arm.load("ur5").description.path
        package = "package://example-robot-data/robots/ur_description/meshes"
        (tmp_path / "ur5.urdf").write_text(source.read_text().replace(package, "meshes"))
        (tmp_path / "ur5.srdf").write_text('<robot name="ur5"/>')
        (tmp_path / "meshes").symlink_to(source.parents[1] / "meshes")
        names, upright = Arm.load("ur5").joint_names, [0, -1.57, 0, 0, 0, 0]
        joints = [f"{{joint_name: {name}, position: 0}}" for name in names]
        scenes = tmp_path / "problems" / "cans_ur5"
        scenes.mkdir(parents=True)
        (scenes / "scene0001.yaml").write_text(self.SCENE)
        (scenes / "request0001.yaml").write_text(
            f"start_state: {{joint_state: {{name: [{', '.join(names)}], position: {upright}}}}}\n"
            f"goal_constraints: [{{joint_constraints: [{', '.join(joints)}]}}]\n"
        )
        with tarfile.open(tmp_path / "problems.tar.bz2", "w:bz2") as archive:
            archive.add(tmp_path / "problems", "problems")
        motionbenchmaker.main(tmp_path)
        assert "| `cans_ur5` | 1, 0, 0 | 1, 0, 0 | " in capsys.readouterr().out


class TestPeers:
    @pytest.fixture
    def peers(self, monkeypatch):
        pytest.importorskip("stable_baselines3")
        from docs.measurements import peers

        for name in ("EPISODES", "SINGLE_STEPS", "VECTOR_STEPS", "TRIALS", "ROBOT_ITERATIONS"):
            monkeypatch.setattr(peers, name, 3)
        monkeypatch.setattr(peers, "BUDGET", 0.0)
        return peers

    @pytest.mark.rare
    @pytest.mark.filterwarnings("ignore")
    def test_everybody_is_compared_with(self, peers):
        policy = load_policy("ars-tuned-both-seed0")
        table = "\n".join(peers.page(policy, 1))
        assert all(f"| {package}" in table for package in peers.PEERS)
