"""Runs on fake arms: commands are the simulator's motion; what goes wrong stops them at rest."""

from dataclasses import replace

import numpy as np
import pytest
from random_policies import policy_for

from docs.measurements.injections import FaultyArm
from kinarm import Plant, ReachProblem, Simulator
from kinarm.errors import (
    InvalidInputError,
    PolicyFileError,
    ProblemError,
    RunStoppedError,
    StartInContactError,
)
from kinarm.policies import export_policy, load_policy
from kinarm.policies.arm_policy import ArmPolicy
from kinarm.policies.export import load_wiring
from kinarm.policies.running.backend import WiredArm
from kinarm.policies.running.fake import FakeArm
from kinarm.policies.running.run import Run
from kinarm.policies.running.watchdog import SafeLimits
from kinarm.recording import load_recordings, save_recordings

WIRING = {"sign": np.array([1, -1, 1, 1, -1, 1.0]), "offset": np.array([0.5, 0, -1, 0, 0.2, 0])}
LAG = {"bandwidth": 8.0, "delay": 1}


@pytest.fixture(scope="module")
def policy():
    return load_policy("ppo-best-both")


@pytest.fixture(scope="module")
def simulator():
    return Simulator("both", threads=1).shielded()


@pytest.fixture(scope="module")
def trial(simulator):
    starts, goals = simulator.sample(np.random.default_rng(0), 3)
    return starts[0], goals


@pytest.fixture
def make(policy, simulator, trial):
    """A run on a fake arm."""

    def made(*, world=None, start=None, wiring=None, settings=None, **arm):
        fake = FaultyArm(simulator.world, trial[0] if start is None else start, **arm)
        wired = WiredArm(fake, world or simulator.world, wiring)
        return Run(wired, policy, simulator, **(settings or {}))

    return made


class Told:
    """Keeps commands, and may do something at one of them."""

    def __init__(self, at=-1, then=None):
        self.positions, self.at, self.then = [], at, then

    def __call__(self, positions):
        if len(self.positions) == self.at:
            self.then()
        self.positions.append(positions.copy())
        return positions


def raising(error):
    def fail():
        raise error

    return fail


def at_rest(arm):
    """Whether joints stay where they are."""
    arm.reads = np.copy
    arm.wait(arm.now() + 1.0)
    before = arm.read()
    arm.wait(arm.now() + 1.0)
    return np.abs(arm.read() - before).max() < 1e-3


class TestMotion:
    @pytest.mark.parametrize("speed", [1.0, 0.2, 0.3])
    def test_commands_are_the_simulators_steps(self, make, policy, simulator, trial, speed):
        start, goals = trial
        told = Told()
        run = make(settings={"speed": speed}, takes=told)
        (made,) = run.to_goals(goals[:1])
        rollout = simulator.rollout(policy, start[None], goals[:1], record=True)
        path = rollout.paths[0, : rollout.steps[0] + 1]
        steps = np.array(told.positions)[: run.parts * len(path[1:])]
        np.testing.assert_allclose(steps[run.parts - 1 :: run.parts], path[1:], rtol=0, atol=1e-12)
        moves = np.diff(np.vstack([start, steps]), axis=0)
        fastest = speed * simulator.arm.velocity_limits * (1 / run.rate)
        assert (np.abs(moves) <= fastest + 1e-12).all()
        assert made.outcome == "success"
        assert len(made.states) == len(path)

    def test_signs_and_offsets(self, make, trial):
        plain, wired = Told(), Told()
        make(takes=plain).to_goals(trial[1])
        run = make(wiring=WIRING)
        fake, sign, offset = run.arm.backend, WIRING["sign"], WIRING["offset"]
        fake.reads = lambda q: q * sign + offset
        fake.takes = lambda positions: (wired(positions) - offset) * sign
        run.to_goals(trial[1])
        expected = np.array(plain.positions) * WIRING["sign"] + WIRING["offset"]
        np.testing.assert_allclose(np.array(wired.positions), expected, rtol=0, atol=1e-12)

    @pytest.mark.parametrize("measured", [False, True])
    def test_an_arm_that_lags(self, make, trial, measured):
        settings = {"measured": measured, "speed": 0.5}
        made = make(plant=Plant(**LAG, noise=1e-4), settings=settings).to_goals(trial[1])
        assert [each.outcome for each in made] == ["success"] * 3

    @pytest.mark.parametrize("memory", [False, True])
    def test_measured_joints_are_seen_as_by_the_exported_runtime(
        self, make, policy, simulator, trial, tmp_path, memory
    ):
        """Rates, commands and actions are those of the command."""
        if memory:
            shown = ["goal", "joint_positions", "commanded", "last_action", "time_left"]
            policy = policy_for(ReachProblem.load("both").replace(observation=shown))
        export_policy(policy, tmp_path / "out", onnx=False)
        settings, readings, told = {"speed": 1.0, "measured": True}, [], Told()
        settings["limits"] = SafeLimits(distance=10.0, overspeed=10.0)
        lagging = make(settings=settings, takes=told, plant=Plant(**LAG))
        run = Run(lagging.arm, policy, simulator.shielded(False), **settings)
        run.arm.backend.reads = lambda q: readings.append(q) or q
        run.to_goals(trial[1][:1])
        runtime = ArmPolicy(tmp_path / "out", feedback="measured")
        for reading, command in zip(readings[1:12], told.positions[:11], strict=True):
            expected = runtime.command(reading, trial[1][0])
            np.testing.assert_allclose(command, expected, rtol=0, atol=1e-9)

    def test_a_start_a_little_beyond_the_limits(self, make, simulator, trial):
        """As arms rest that have settled at a stop: commands lead back at the run's speed."""
        arm, off, told = simulator.arm, 0.1 * (np.arange(6) == 0), Told()
        start = np.where(off, arm.upper, arm.home)
        run = make(start=start, reads=lambda q: q + off * (len(told.positions) < 8), takes=told)
        run.to_goals(trial[1][:1])
        moves = np.diff(np.vstack([start + off, told.positions]), axis=0)
        fastest = run.speed * arm.velocity_limits / run.rate
        assert (np.abs(moves) <= fastest + 1e-12).all()

    def test_a_goal_is_the_last_of_its_episode(self, make, policy, simulator, trial):
        """A task's sequence does not go on to goals that nobody named."""
        follow = simulator.changed(goal={"sequence": 3})
        (made,) = Run(make().arm, policy, follow).to_goals(trial[1][:1])
        assert made.outcome == "success"
        np.testing.assert_array_equal(made.states, make().to_goals(trial[1][:1])[0].states)

    def test_recordings(self, make, trial, tmp_path):
        made = make().to_goals(trial[1])
        save_recordings(tmp_path / "run.npz", made)
        kept = load_recordings(tmp_path / "run.npz")
        assert [each.outcome for each in kept] == ["success"] * 3
        assert kept[1].same_trial(made[1])
        np.testing.assert_allclose(kept[1].states[0], kept[0].states[-1], rtol=0, atol=1e-9)

    def test_a_run_goes_on_to_further_goals(self, make, trial):
        run = make()
        (first,), (second,) = (run.to_goals(goal[None]) for goal in trial[1][:2])
        assert [first, second] == run.recordings
        assert (first.trial, second.trial) == (0, 1)

    def test_shield_keeps_from_contact(self, policy, simulator):
        """A policy that runs into itself or a bench is stopped, or led around."""
        bare, rng = simulator.shielded(False), np.random.default_rng(5)
        starts, goals = bare.sample(rng, 2000)
        touching = np.flatnonzero(bare.rollout(policy, starts, goals).collision)
        assert len(touching)
        k = touching[0]
        for world, outcome in ((bare, "collision"), (simulator, "success")):
            fake = FakeArm(simulator.world, starts[k])
            run = Run(WiredArm(fake, world.world), policy, world)
            (made,) = run.to_goals(goals[k : k + 1])
            assert made.outcome == outcome
            assert (made.provenance["interventions"] > 0) == (outcome == "success")


class TestStops:
    """Each stops at rest, with a line and what was recorded."""

    def check(self, run, goals, words):
        with pytest.raises(RunStoppedError, match=words):
            run.to_goals(goals)
        assert [each.outcome for each in run.recordings] == ["truncated"]
        assert at_rest(run.arm.backend)

    def test_lost_connection(self, make, trial):
        told = Told(20, raising(ConnectionError("cable")))
        self.check(make(takes=told), trial[1], "lost the arm: cable")

    def test_blocked_joint(self, make, trial):
        def blocked(positions):
            return np.where(np.arange(6) == 1, trial[0], positions)

        run = make(takes=blocked, settings={"speed": 1.0})
        self.check(run, trial[1], "axis_2 is .* from its command; at most 0.3 is allowed")

    def test_stale_readings(self, make, trial):
        kept = []

        def frozen(positions):
            kept.append(positions)
            return kept[min(len(kept) - 1, 12)]

        run = make(reads=frozen, settings={"limits": SafeLimits(distance=10.0)})
        self.check(run, trial[1], "readings have not changed")

    def test_no_numbers(self, make, trial):
        told = []

        def broken(positions):
            told.append(positions)
            return positions * (np.nan if len(told) > 10 else 1)

        self.check(make(reads=broken), trial[1], "lost the arm: it reads")

    def test_late_cycles(self, make, trial):
        run = make(takes=(told := Told()))

        def slow(positions):
            run.arm.backend.time += 0.03 * (len(told.positions) > 10)
            return positions

        run.arm.backend.reads = slow
        self.check(run, trial[1], "3 cycles in a row were late")

    def test_too_fast(self, make, trial):
        """Somebody pushes a joint."""
        pushed = []

        def push(positions):
            pushed.append(positions)
            return positions + (np.arange(6) == 0) * 0.3 * max(len(pushed) - 20, 0)

        run = make(reads=push, settings={"limits": SafeLimits(distance=10.0)})
        self.check(run, trial[1], "axis_1 is .* too fast")

    def test_too_abrupt(self, make, trial):
        run = make(settings={"speed": 1.0, "limits": SafeLimits(acceleration=1.0)})
        self.check(run, trial[1], "too abrupt")

    def test_ctrl_c(self, make, trial):
        run = make(takes=Told(31, raising(KeyboardInterrupt())))
        with pytest.raises(KeyboardInterrupt):
            run.to_goals(trial[1])
        (made,) = run.recordings
        assert made.provenance["ended"] == "interrupted"
        assert made.steps > 5
        assert at_rest(run.arm.backend)


class TestRefusals:
    """Nothing moves."""

    def check(self, run, goals, kind, words):
        run.arm.backend.takes = raising(AssertionError)
        with pytest.raises(kind, match=words):
            run.to_goals(goals)

    def test_goal_out_of_reach(self, make):
        self.check(make(), np.array([[2.0, 0, 0.5]]), InvalidInputError, "out of reach")

    @pytest.mark.parametrize("goal", [[0.4, -0.5, 0.3], [], [[0.4, -0.5]], [[0.4, np.nan, 0.3]]])
    def test_what_is_no_goal(self, make, goal):
        self.check(make(), goal, InvalidInputError, "goals must")

    def test_goal_without_a_direction(self, make, policy, simulator):
        upright = simulator.changed(goal={"kind": "direction"})
        other = policy_for(upright.problem)
        goal = [[0.4, -0.5, 0.3, 0.0, 0.0, 0.0]]
        self.check(Run(make().arm, other, upright), goal, InvalidInputError, "must have length 1")

    def test_start_in_contact(self, make, simulator, trial):
        rng, arm = np.random.default_rng(0), simulator.arm
        q = rng.uniform(arm.lower, arm.upper, (200, 6))
        touching = q[simulator.world.in_contact(q)][0]
        run = make()
        run.arm.backend.reads = lambda positions: touching
        self.check(run, trial[1], StartInContactError, "touches")

    def test_start_beyond_the_limits(self, make, trial):
        run = make(reads=np.rad2deg)
        self.check(
            run, trial[1], InvalidInputError, "what the arm reads lies outside the limits: axis_"
        )

    def test_rate_that_the_machine_cannot_keep(self, make, trial):
        run = make(settings={"rate": 1e6})
        self.check(run, trial[1], InvalidInputError, "a cycle takes .* 1e\\+06 Hz leaves")

    def test_contract_of_another_arm(self, policy, simulator, make):
        other = Simulator(simulator.problem.replace(arm="lrmate200ic_5l"), threads=1)
        with pytest.raises(PolicyFileError, match="trained for arm 'paper'"):
            Run(make().arm, policy, other)

    def test_arm_with_other_joints(self, simulator):
        fake = FakeArm(simulator.world, simulator.arm.home)
        fake.joint_names = ("a", "b")
        with pytest.raises(InvalidInputError, match="the backend has the joints a, b, arm 'paper'"):
            WiredArm(fake, simulator.world)

    def test_no_connection(self, make, trial, monkeypatch):
        monkeypatch.setattr(FakeArm, "connect", lambda *_: raising(OSError("no route"))())
        self.check(make(), trial[1], RunStoppedError, "lost the arm: no route")

    def test_bodies_that_are_not_known(self, make, policy, simulator):
        moved = Simulator(simulator.problem, threads=1)
        moved.world.has_random_bodies = True
        with pytest.raises(ProblemError, match="random or move"):
            Run(make().arm, policy, moved)

    def test_memory_of_measurements(self, make, policy, simulator):
        shown = replace(policy.observation, history=2)
        seen = replace(policy.provenance, problem=policy.problem.replace(observation=shown))
        twice = [np.concatenate([each, each]) for each in (policy.mean, policy.std)]
        first = policy.layers[0]
        wide = first._replace(weights=np.concatenate([first.weights, first.weights], axis=1))
        layers = (wide, *policy.layers[1:])
        made = {"provenance": seen, "layers": layers, "mean": twice[0], "std": twice[1]}
        other = replace(policy, mirror=None, residual=False, **made)
        with pytest.raises(InvalidInputError, match="histories need commanded feedback"):
            Run(make().arm, other, simulator, measured=True)

    def test_changed_folder(self, policy, tmp_path):
        export_policy(policy, tmp_path / "out", onnx=False)
        assert load_wiring(tmp_path / "out")["sign"].tolist() == [1.0] * 6
        path = tmp_path / "out" / "contract.json"
        path.write_text(path.read_text().replace('"sign": 1.0', '"sign": -1.0', 1))
        with pytest.raises(PolicyFileError, match="fails its self-test: contract"):
            load_wiring(tmp_path / "out")
        path.write_text("{")
        with pytest.raises(PolicyFileError, match="is no exported folder"):
            load_wiring(tmp_path / "out")
