"""Contact pairs, enclosing capsules, motion bounds, and the proof of freedom held against Coal."""

import numpy as np
import pinocchio as pin
import pytest
from configurations import contact_boundary, depths, jittered, random_configurations, substeps
from simulators import changed

from kinarm.arm import Arm
from kinarm.bodies import HeldBody
from kinarm.collision import ContactModel
from kinarm.contact_pairs import make_verdicts_reliable, start_anew
from kinarm.contact_shapes import WITH_HALFSPACE
from kinarm.contact_statistics import contact_on_bare_ground
from kinarm.episodes import COLLISION, PAUSED, Control
from kinarm.kernels.rollout import advance
from kinarm.scene import Scene

CAPSULE_ARMS = ("lrmate200ic_5l", "paper", "paper_flange")


def screened(simulator, configurations):
    """Which configurations the kernel proves free, and which it proves to touch."""
    _, free, touching, proven = simulator.world.proven(configurations)
    assert proven == (free | touching).sum()
    return free, touching


def in_contact(simulator, configurations):
    """Ask Coal one configuration at a time, without a broad phase."""
    model, geometry = simulator.arm.model, simulator.world.contact_model.geometry
    data, geometry_data = model.createData(), make_verdicts_reliable(geometry.createData())
    verdicts = []
    for q in configurations:
        start_anew(geometry_data.collisionRequests)
        touches = pin.computeCollisions(model, data, geometry, geometry_data, q, True)
        verdicts.append(touches)
    return np.array(verdicts)


class TestPairs:
    def test_names_of_the_default_arm(self, simulator):
        links = ["base", "shoulder", "upper_arm", "elbow", "forearm", "wrist", "hand"]
        skipped = {("upper_arm", "forearm"), ("forearm", "hand")}
        # The forearm keeps them apart.
        skipped |= {("elbow", "wrist"), ("elbow", "hand")}
        expected = {(links[i], links[j]) for i in range(7) for j in range(i + 2, 7)} - skipped
        expected |= {
            (link, world) for link in links[2:] for world in ("right bench", "left bench", "ground")
        }
        expected -= {("upper_arm", "right bench"), ("upper_arm", "left bench")}  # which are lower
        assert set(simulator.world.contact_model.pair_names) == expected

    def test_first_link_is_tested_where_turning_it_can_touch(
        self, make_joint, make_collision, write_robot
    ):
        bar = make_collision(
            '<capsule radius="0.02" length="0.6"/>', xyz="0.3 0 0", rpy="0 1.5708 0"
        )
        arm = Arm.load(write_robot([make_joint(), make_joint(axis="0 1 0")], {1: bar}))
        assert ("link_1", "left bench") in ContactModel.build(arm, Scene()).pair_names

    def test_verdicts_do_not_depend_on_earlier_questions(self, any_simulator):
        free, hit = contact_boundary(any_simulator, 16, 1000)
        near = jittered(np.concatenate([free, hit]), 17)
        order = np.random.default_rng(18).permutation(len(near))
        ask = any_simulator.world.contact_model.in_contact
        verdicts = ask(near)
        np.testing.assert_array_equal(ask(near[order]), verdicts[order])
        np.testing.assert_array_equal(in_contact(any_simulator, near), verdicts)

    def test_mirror_image_has_the_same_verdict(self, simulator):
        configurations = random_configurations(simulator, 4, 2000)
        mirrored = configurations * [-1, 1, 1, -1, 1, -1]
        verdicts = simulator.world.contact_model.in_contact(configurations)
        np.testing.assert_array_equal(verdicts, simulator.world.contact_model.in_contact(mirrored))


def capsule_points(simulator, shape, poses):
    """Points of a capsule's segment in the world, shape (n, 5, 3)."""
    shapes = simulator.world.contact_model.shapes
    ends = shapes.capsules[shape, :6].reshape(2, 3)
    points = ends[0] + np.linspace(0, 1, 5)[:, None] * (ends[1] - ends[0])
    return np.array(
        [[pose.act(point) for point in points] for pose in poses[shapes.bodies[shape, 2]]]
    )


def link_poses(simulator, configurations):
    """World poses of the joint frames, by frame and then configuration."""
    model = simulator.arm.model
    data, poses = model.createData(), []
    for q in configurations:
        pin.forwardKinematics(model, data, q)
        poses.append([pin.SE3(data.oMi[k]) for k in range(model.njoints)])
    return list(zip(*poses, strict=True))


class TestTravel:
    def test_bounds_the_relative_motion_of_every_pair(self, any_simulator):
        arm, shapes = any_simulator.arm, any_simulator.world.contact_model.shapes
        moved = arm.n_actuated
        rng = np.random.default_rng(5)
        before = random_configurations(any_simulator, 6, 150)
        after = before.copy()
        size = 10.0 ** rng.uniform(-4, 0, (150, 1))
        single = rng.integers(0, moved, 150)[:, None] == np.arange(moved)
        mask = np.where(np.arange(150)[:, None] < 100, single, True)
        after[:, :moved] += size * mask * rng.choice([-1, 1], (150, moved))
        after = np.clip(after, arm.lower, arm.upper)
        turn = np.abs(after - before)[:, :moved]
        old, new = link_poses(any_simulator, before), link_poses(any_simulator, after)
        tightest = 0.0
        for column, (kind, first, second) in enumerate(shapes.pairs[: shapes.travel.shape[1]]):
            within = second < arm.geometry.ngeoms
            mover = second if within else first
            base = shapes.bodies[first, 2] if within else 0
            points = []
            for poses in (old, new):
                world = capsule_points(any_simulator, mover, poses)
                local = [
                    [pose.actInv(point) for point in row]
                    for pose, row in zip(poses[base], world, strict=True)
                ]
                points.append(np.array(local))
            change = points[1] - points[0]
            if kind == WITH_HALFSPACE:
                change = change[..., 2:]
            motion = np.linalg.norm(change, axis=2).max(axis=1)
            bound = turn @ shapes.travel[: turn.shape[1], column]
            assert (motion <= bound + 1e-12).all()
            tightest = max(tightest, (motion / np.fmax(bound, 1e-9)).max())
        assert tightest > 0.9

    def test_bounds_the_motion_of_a_mesh_whose_polytope_leaves_vertices_out(self):
        rng = np.random.default_rng(4)
        vertices = rng.normal(size=(1000, 3))
        vertices *= 0.2 / np.linalg.norm(vertices, axis=1)[:, None]
        ball = HeldBody(name="it", link="hand", shape="mesh", vertices=vertices)
        arm = Arm.load("paper", held_bodies=(ball,))
        shapes = contact_on_bare_ground(arm).shapes
        shape = arm.geometry.geometryObjects[-1]
        placed = vertices @ shape.placement.rotation.T + shape.placement.translation
        last = shape.parentJoint - 1
        farthest = np.linalg.norm(np.cross(arm.chain.axis[last], placed), axis=1).max()
        ground = arm.geometry.ngeoms
        column = shapes.pairs.tolist().index([WITH_HALFSPACE, ground - 1, ground])
        assert farthest <= shapes.travel[last, column] <= farthest + 0.01

    def test_turning_the_base_leaves_heights_alone(self, simulator):
        shapes = simulator.world.contact_model.shapes
        pairs = shapes.pairs[: shapes.travel.shape[1]]
        ground = pairs[:, 0] == WITH_HALFSPACE
        np.testing.assert_array_equal(shapes.travel[0, ground], 0)
        assert (shapes.travel[0, ~ground & (shapes.bodies[pairs[:, 1], 2] > 1)] >= 0).all()


class TestProof:
    """What the kernel proves, Coal finds, too."""

    def test_holds_at_random_near_contact_and_along_lines(self, any_simulator):
        free, touching = contact_boundary(any_simulator, 8, 2000)
        near = [jittered(end, seed) for end in (free, touching) for seed in range(2)]
        drawn = random_configurations(any_simulator, 7, 20_000)
        ends = random_configurations(any_simulator, 9, 40).reshape(2, 20, 1, -1)
        lines = ends[0] + np.linspace(0, 1, 100)[:, None] * (ends[1] - ends[0])
        lines = lines.reshape(-1, drawn.shape[1])
        asked = np.concatenate([free, touching, *near, drawn, lines])
        proven_free, proven_touching = screened(any_simulator, asked)
        touches = any_simulator.world.contact_model.in_contact(asked)
        assert not (proven_free & touches).any()
        assert not (proven_touching & ~touches).any()
        assert proven_free[-22_000:].sum() > 0.3 * (~touches[-22_000:]).sum()

    def test_proves_capsule_arms_free_up_to_the_margin(self, simulators):
        for name in CAPSULE_ARMS:
            simulator = simulators[name]
            free, _ = contact_boundary(simulator, 9, 1500)
            near = jittered(free, 10)
            proven = screened(simulator, near)[0]
            clear = depths(simulator, near) < -1e-4
            assert clear.sum() > 100
            assert proven[clear].all()

    @pytest.mark.parametrize("bad", [np.nan, np.inf])
    def test_claims_nothing_about_numbers_that_are_not_finite(self, simulator, bad):
        configurations = np.where(np.eye(6, dtype=bool)[:5], bad, 0.0)
        assert not np.any(screened(simulator, configurations))

    @pytest.mark.parametrize("name", CAPSULE_ARMS)
    def test_leaves_little_to_coal_where_shapes_are_known(self, simulators, name):
        drawn = random_configurations(simulators[name], 45, 20_000)
        free, touching = screened(simulators[name], drawn)
        assert touching.mean() > 0.2
        assert (free | touching).mean() > 0.999


def doubted_steps(simulator, starts, actions):
    """Advance by one step without asking Coal: episodes and the doubt about their substeps."""
    episodes = simulator.reset(starts, np.tile([0.0, 0.0, 5.0], (len(starts), 1)))
    np.copyto(episodes.stop, 1)
    control = Control(actions=actions[:, None])
    advance(np.zeros(2, dtype=np.int64), simulator.world.session(control, episodes))
    stopped = (episodes.status == PAUSED) | (episodes.status == COLLISION)
    tested = simulator.problem.stepping.tested_configurations
    bits = episodes.doubt[:, None] >> np.arange(tested) & 1
    return episodes, stopped[:, None] & bits.astype(bool)


def steps_near_contact(simulator, seed, count):
    """Free starts close to contact, and actions of every size."""
    free, _ = contact_boundary(simulator, seed, count)
    rng = np.random.default_rng(seed)
    arm = simulator.arm
    near = np.clip(jittered(free, seed), arm.lower, arm.upper)
    starts = np.concatenate([free, near])
    starts = starts[~simulator.world.contact_model.in_contact(starts)]
    actions = rng.normal(size=(len(starts), arm.n_actuated))
    return starts, actions * 10.0 ** rng.uniform(-3, 0.5, (len(starts), 1))


class TestStepProof:
    def test_names_the_pair_that_coal_finds_first(self, any_simulator):
        starts, actions = steps_near_contact(any_simulator, 47, 1000)
        episodes, _ = doubted_steps(any_simulator, starts, actions)
        refused = episodes.status == COLLISION
        ways = substeps(any_simulator.world, starts, episodes.target)[refused]
        contacts = any_simulator.world.contact_model
        for way, number in zip(ways, episodes.touched[refused], strict=True):
            found = [contacts.first_in_contact(q) for q in way]
            assert next(index for index in found if index is not None) == number - 1

    def test_flags_every_tested_configuration_that_touches(self, any_simulator):
        starts, actions = steps_near_contact(any_simulator, 11, 3000)
        episodes, doubted = doubted_steps(any_simulator, starts, actions)
        tested = substeps(any_simulator.world, starts, episodes.target)
        for k in range(4):
            touching = any_simulator.world.contact_model.in_contact(tested[:, k])
            assert not (touching & ~doubted[:, k]).any()
        assert doubted.any(axis=1).sum() > 100

    @pytest.mark.parametrize("n", [1, 3, 32])
    def test_flags_them_whatever_their_number(self, simulator, n):
        other = changed(simulator, tested_configurations=n, time_step=0.1)
        starts, actions = steps_near_contact(other, 19, 1500)
        episodes, doubted = doubted_steps(other, starts, actions)
        tested = substeps(other.world, starts, episodes.target)
        touching = other.world.contact_model.in_contact(tested.reshape(-1, 6)).reshape(-1, n)
        assert not (touching & ~doubted).any()
        assert touching.any(axis=0).all()

    def test_no_accepted_step_of_whole_episodes_touches(self, any_simulator):
        rng = np.random.default_rng(15)
        starts, goals = any_simulator.sample(rng, 600)
        actions = np.repeat(rng.uniform(-1, 1, (600, 8, any_simulator.n_actions)), 8, axis=1)
        rollouts = any_simulator.rollout_actions(actions, starts, goals, record=True)
        world = any_simulator.world
        ask = world.contact_model.in_contact
        moves = rollouts.steps - rollouts.collision
        for path, count in zip(rollouts.paths, moves, strict=True):
            if count:
                tested = substeps(world, path[:count], path[1 : count + 1])
                assert not ask(tested.reshape(-1, path.shape[1])).any()
        refused = substeps(world, rollouts.configurations, rollouts.targets)[rollouts.collision]
        assert rollouts.collision.sum() > 20
        assert all(ask(tested).any() for tested in refused)


@pytest.mark.parametrize(
    "configuration",
    [
        "2.089669367612132 1.4484182951518316 1.2221036959293732 "
        "0.3209242395453302 -0.3047626538669959 -3.1965649212790037",
        "-2.226523374792933 0.910218036619165 0.15901152469457733 "
        "-0.639787945605816 0.46831362615289185 -3.4513153356917727",
    ],
)
def test_deep_contacts_that_coal_overlooks_by_default_are_found(simulators, configuration):
    q = np.fromstring(configuration, sep=" ")
    model = simulators["paper"].world.contact_model
    assert depths(simulators["paper"], q[None])[0] > 0.02
    assert model.in_contact(q[None])[0]
    assert "bench" in model.contact_pair(q)[1]
