"""Peers are compared on the same arm, scene and ways, and a missing one is named."""

import itertools
import os
import sys
from importlib import import_module
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import kinarm
from kinarm.errors import MissingExtraError
from kinarm.evaluation.measurements.peers import measuring, reach_environments
from kinarm.evaluation.measurements.peers.comparing import Comparison, compared
from kinarm.evaluation.measurements.peers.measuring import PEERS, Peer, measure_peers
from kinarm.evaluation.measurements.robots import robot_problem
from kinarm.evaluation.measurements.timing import Timing
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator
from kinarm.world import World

COMPARISON = Comparison(
    what="work", unit="steps/s", theirs=Timing(2, 3), ours=Timing(8, 9), terms="fair"
)


@pytest.fixture
def peer(monkeypatch):
    """A peer that is installed, whose measurement is what the test puts there."""
    module = ModuleType("kinarm.evaluation.measurements.peers.of_a_test")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(measuring, "PEERS", (Peer("numpy", "numpy", "of_a_test"),))
    return module


class TestMeasuring:
    def test_ratio_is_that_of_the_medians(self, peer):
        peer.compare = lambda policy, repetitions: [COMPARISON]
        (row,) = measure_peers(None, 1)
        assert row == {
            "peer": f"numpy {np.__version__}",
            "what": "work",
            "unit": "steps/s",
            "theirs": {"median": 2, "best": 3},
            "ours": {"median": 8, "best": 9},
            "ratio": 4.0,
            "terms": "fair",
        }

    @pytest.mark.parametrize("extra", ["peers", "vamp"])
    def test_missing_peer_is_named_with_its_extra(self, monkeypatch, extra):
        gone = Peer("no-such-peer", "no_such_peer", "mujoco_rollouts", extra)
        monkeypatch.setattr(measuring, "PEERS", (gone,))
        reason = f"no-such-peer is not installed: pip install 'kinarm[{extra}]'"
        assert measure_peers(None, 1) == [{"peer": "no-such-peer", "skipped": reason}]

    def test_nothing_is_measured_without_the_extras(self, monkeypatch):
        for each in PEERS:
            monkeypatch.setitem(sys.modules, each.imports.partition(".")[0], None)
            monkeypatch.setitem(sys.modules, each.imports, None)
        rows = measure_peers(None, 1)
        assert [row["peer"] for row in rows] == [each.package for each in PEERS]
        assert all("kinarm[" in row["skipped"] for row in rows)

    def test_broken_peer_is_left_out(self, monkeypatch, tmp_path):
        (tmp_path / "broken_peer.py").write_text("raise AttributeError('of a new NumPy')")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setattr(measuring, "PEERS", (Peer("numpy", "broken_peer", "x"),))
        (row,) = measure_peers(None, 1)
        assert row["skipped"] == "cannot be imported: of a new NumPy"

    def test_what_was_measured_is_kept_if_another_extra_is_missing(self, peer):
        def compare(policy, repetitions):
            yield COMPARISON
            raise MissingExtraError("example-robot-data", "robots")

        peer.compare = compare
        first, second = measure_peers(None, 1)
        assert first["what"] == "work"
        assert "kinarm[robots]" in second["skipped"]

    def test_standard_output_stays_clean(self, peer, capfd):
        def compare(policy, repetitions):
            sys.stdout.write("from Python\n")
            os.write(1, b"from C\n")
            return []

        peer.compare = compare
        measure_peers(None, 1)
        sys.stdout.write("after\n")
        out, err = capfd.readouterr()
        assert out == "after\n"
        assert "from C" in err
        assert "from Python" in err


def test_both_are_run_as_often_by_turns():
    ran = []
    found = compared(
        lambda: ran.append("theirs") or 1,
        lambda: ran.append("ours") or 1,
        2,
        what="",
        unit="",
        terms="",
    )
    assert ran == ["theirs", "ours"] * 3
    assert found.ours.median > 0


def test_environments_are_stepped_beside_ours(monkeypatch, train_novice):
    monkeypatch.setattr(reach_environments, "STEPS", 3)
    monkeypatch.setattr(reach_environments, "VECTOR_STEPS", 2)
    single, batch = reach_environments.compare_environment(
        kinarm, "kinarm/ReachLeft-v0", "terms", train_novice("left"), 1
    )
    assert "ReachLeft" in single.what
    assert "64 arms" in batch.what
    assert min(single.theirs.median, single.ours.median, batch.ours.median) > 0


@pytest.mark.parametrize(
    ("module", "measured_by", "environment"),
    [
        ("panda_gym", "panda_reach", "PandaReach"),
        ("gymnasium_robotics", "fetch_reach", "FetchReach"),
    ],
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_environments_of_peers_are_stepped(
    monkeypatch, train_novice, module, measured_by, environment
):
    pytest.importorskip(module)
    monkeypatch.setattr(reach_environments, "STEPS", 3)
    monkeypatch.setattr(reach_environments, "VECTOR_STEPS", 2)
    peer = import_module(f"{measuring.__package__}.{measured_by}")
    found = list(peer.compare(train_novice("left"), 1))
    assert [row.what.split("-")[0] for row in found] == [environment] * 2
    assert {row.terms for row in found} == {peer.TERMS}
    assert min(row.theirs.median for row in found) > 0


class TestMuJoCo:
    @pytest.fixture(params=["paper", "lrmate200ic_5l", "ur5"])
    def worlds(self, request):
        """An arm, in kinarm and in MuJoCo."""
        mujoco = pytest.importorskip("mujoco")
        from kinarm.evaluation.measurements.peers.mjcf import mjcf

        try:
            problem = (
                robot_problem("ur5")
                if request.param == "ur5"
                else PROBLEMS["both"].replace(arm=request.param)
            )
        except MissingExtraError as error:
            pytest.skip(str(error))
        world = World(problem)
        model = mujoco.MjModel.from_xml_string(mjcf(world, 0.02))
        return world, model, mujoco.MjData(model)

    def configurations(self, world, n):
        q = np.tile(world.arm.home, (n, 1))
        moved, rng = slice(0, world.n_actions), np.random.default_rng(0)
        q[:, moved] = rng.uniform(world.arm.lower[moved], world.arm.upper[moved], q[:, moved].shape)
        return q

    def test_joints_are_where_ours_are(self, worlds):
        import mujoco

        world, model, data = worlds
        assert model.nq == model.nu == world.n_actions
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

    def test_limits_and_step(self, worlds):
        world, model, _ = worlds
        moved = slice(0, world.n_actions)
        assert model.jnt_range[:, 0] == pytest.approx(world.arm.lower[moved])
        assert model.actuator_ctrlrange[:, 1] == pytest.approx(world.arm.upper[moved])
        assert model.opt.timestep == 0.02

    def test_arms_are_driven_along_the_ways_of_the_policy(self, train_novice):
        mujoco = pytest.importorskip("mujoco")
        from mujoco import rollout

        from kinarm.evaluation.measurements.peers.mjcf import mjcf
        from kinarm.evaluation.measurements.peers.mujoco_rollouts import (
            initial_states,
            joint_targets,
        )

        simulator, policy = Simulator("right", threads=1), train_novice("right")
        starts, goals = simulator.sample(np.random.default_rng(0), 6)
        targets = joint_targets(simulator, policy, starts, goals)
        rollouts = simulator.rollout(policy, starts, goals, record=True)
        assert targets.shape == (6, 64, 5)
        assert (np.abs(np.diff(targets, axis=1)) <= simulator.step_limit + 1e-12).all()
        for way, steps, path in zip(targets, rollouts.steps, rollouts.paths[..., :5], strict=True):
            assert np.array_equal(way[:steps], path[1 : steps + 1])
            back = min(steps, 64 - steps)
            assert np.array_equal(way[steps : steps + back], path[:steps][::-1][:back])
        model = mujoco.MjModel.from_xml_string(mjcf(simulator.world, 0.02))
        states = initial_states(model, starts)
        controls = np.concatenate([targets, np.repeat(targets[:, -1:], 50, axis=1)], axis=1)
        found, _ = rollout.rollout(model, mujoco.MjData(model), states, controls)
        ends = found[:, -1, 1 : 1 + model.nq]
        assert np.median(np.abs(ends - targets[:, -1])) < 1e-2

    def test_rollouts_of_two_arms_are_compared(self, monkeypatch, train_novice):
        """Each by as many tests a step as kinarm's, and by one."""
        pytest.importorskip("mujoco")
        from kinarm.evaluation.measurements.peers import mujoco_rollouts

        counted = []
        monkeypatch.setattr(mujoco_rollouts, "EPISODES", 4)
        monkeypatch.setattr(mujoco_rollouts, "novice", lambda _: train_novice("left"))
        monkeypatch.setattr(
            mujoco_rollouts,
            "compared",
            lambda theirs, ours, *_, **__: counted.append([theirs(), ours()]),
        )
        policy = train_novice("right")
        assert len(list(mujoco_rollouts.compare(policy, 1))) == 4
        starts, goals = Simulator("right").sample(np.random.default_rng(4), 4)
        steps = int(Simulator("right").rollout(policy, starts, goals).steps.sum())
        assert counted[:2] == [[4 * 64, steps]] * 2

    def test_every_solid_has_its_size(self, make_joint, make_collision, write_robot):
        """The mass that MuJoCo gives a solid of density 1000 is that of its volume."""
        mujoco = pytest.importorskip("mujoco")
        from kinarm.evaluation.measurements.peers.mjcf import mjcf

        shapes = {
            1: make_collision('<cylinder radius="0.1" length="0.3"/>', rpy="0.3 0.2 0.1"),
            2: make_collision('<sphere radius="0.1"/>'),
            3: make_collision('<box size="0.1 0.2 0.3"/>'),
        }
        path = write_robot([make_joint(), make_joint(xyz="0 0 0.5"), make_joint()], shapes)
        document = ElementTree.fromstring(mjcf(World(PROBLEMS["right"].replace(arm=path)), 0.02))
        for body in document.iter("body"):
            for inertial in body.findall("inertial"):
                body.remove(inertial)  # so that MuJoCo works it out
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(document, encoding="unicode"))
        volumes = [np.pi * 0.1**2 * 0.3, 4 / 3 * np.pi * 0.1**3, 0.1 * 0.2 * 0.3]
        masses = [model.body(f"link{k}").mass[0] for k in (1, 2, 3)]
        assert masses == pytest.approx(1000 * np.array(volumes))


class TestAugmentedRandomSearch:
    @pytest.fixture
    def contrib_ars(self, monkeypatch):
        pytest.importorskip("sb3_contrib")
        from kinarm.evaluation.measurements.peers import contrib_ars

        monkeypatch.setattr(contrib_ars, "TRIALS", 4)
        return contrib_ars

    def test_both_train_until_the_budget_is_spent(self, contrib_ars, monkeypatch, train_novice):
        monkeypatch.setattr(contrib_ars, "BUDGET", 0.0)
        (found,) = contrib_ars.compare(train_novice("right"), 1)
        assert "theirs" in found.what
        assert min(found.theirs.median, found.ours.median) > 0

    def test_trials_are_looked_at_now_and_then_until_the_budget_is_spent(
        self, contrib_ars, monkeypatch
    ):
        """Ten iterations of a second each, and a look at every second one."""
        clock = itertools.count(0.0)
        monkeypatch.setattr(contrib_ars, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
        for name, value in {"BUDGET": 10.0, "BETWEEN_LOOKS": 2.0, "LEVEL": 1.1}.items():
            monkeypatch.setattr(contrib_ars, name, value)
        trials, looks = TrialSet.draw(PROBLEMS["right"], 4, 0), []
        zeros = np.zeros(trials.simulator.n_actions)

        def policy():
            looks.append(len(looks))
            return lambda seen: zeros + 0 * seen[:, :5]

        found = contrib_ars.attempt(lambda: 7, policy, trials)
        assert (found.seconds, len(looks)) == (10.0, 5)

    def test_training_is_over_when_enough_trials_succeed(self, contrib_ars, monkeypatch):
        monkeypatch.setattr(contrib_ars, "BETWEEN_LOOKS", 0.0)
        monkeypatch.setattr(contrib_ars, "LEVEL", 0.0)
        trials = TrialSet.draw(PROBLEMS["right"], 4, 0)
        zeros = np.zeros(trials.simulator.n_actions)
        found = contrib_ars.attempt(lambda: 7, lambda: lambda seen: zeros + 0 * seen[:, :5], trials)
        assert found.steps == 7
        assert found.success == 0.0
        assert found.text.startswith("0% of trials after")

    def test_same_settings(self, contrib_ars, monkeypatch):
        made = {}

        def remember(name, env, **settings):
            made.update(settings, env=env)
            raise KeyboardInterrupt

        monkeypatch.setattr(contrib_ars, "ARS", remember)
        config = recipe("ars", "tuned", problem="right", seed=3)
        with pytest.raises(KeyboardInterrupt):
            contrib_ars.train_theirs(config, TrialSet.draw(config.problem, 4, 0))
        assert made.pop("env").num_envs == config.episodes
        assert made == {
            "n_delta": config.directions,
            "n_top": config.top_directions,
            "learning_rate": config.step_size,
            "delta_std": config.noise,
            "n_eval_episodes": config.episodes,
            "seed": 3,
        }


class TestVAMP:
    def test_configurations_between_waypoints(self):
        pytest.importorskip("vamp")
        from kinarm.evaluation.measurements.peers.vamp_validity import RAKE, on_the_way

        way = on_the_way(np.array([[0.0, 0.0], [0.8, 1.6], [0.0, 0.0]], dtype=np.float32))
        assert way.shape == (2 * RAKE, 2)
        assert way[0] == pytest.approx([0.1, 0.2])
        assert way[RAKE - 1] == pytest.approx([0.8, 1.6])
        assert way[-1] == pytest.approx([0.0, 0.0], abs=1e-12)
