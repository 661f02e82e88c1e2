"""Arms in MuJoCo on position servos that lag, and what drives them: policies or given actions."""

from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from kinarm import Plant, Simulator, World
from kinarm.kernels.plant import COMMAND
from kinarm.policies import Policy, export_policy
from kinarm.policies.arm_policy import ArmPolicy
from kinarm.policies.running.mujoco_arm import SUBSTEP, servo_model
from kinarm.task import NEVER

Array = NDArray[np.float64]


class Manner(NamedTuple):
    """How a policy drives an arm.

    Attributes
    ----------
    feedback : str
        Which joint positions it sees; see `kinarm.Plant`.
    shield : str
        Of what a shield lets nothing touch: the motion of ``"commands"``, as if
        joints obeyed at once, or that of ``"joints"``, whose plant it knows.
    speed : float
        Share of its actions that is commanded, for as many times as long.
    """

    feedback: str = "measured"
    shield: Literal["", "commands", "joints"] = ""
    speed: float = 1.0


class Lags(NamedTuple):
    """How arms lag, and what is seen of them.

    Attributes
    ----------
    bandwidth, acceleration : ndarray, shape (n,)
        Of each arm's servos [Hz], and largest acceleration, 0 for no limit [rad/s^2].
    delay : ndarray of int, shape (n,)
        Steps by which a command comes late.
    noise, goal_noise : float
        Standard deviations of each measurement of a joint [rad], and of a goal's coordinate [m].
    """

    bandwidth: Array
    acceleration: Array
    delay: NDArray[np.int64]
    noise: float
    goal_noise: float


def draw_lags(plant: Plant, count: int, rng: np.random.Generator) -> Lags:
    """Lags of so many arms, uniform in the ranges of a plant."""
    bandwidth, acceleration = (
        rng.uniform(*plant.range_of(name), count) for name in ("bandwidth", "acceleration")
    )
    least, most = plant.range_of("delay")
    noises = (plant.range_of(name)[1] for name in ("noise", "goal_noise"))
    return Lags(bandwidth, acceleration, rng.integers(int(least), int(most) + 1, count), *noises)


class ServoArms:
    """Arms in MuJoCo on critically damped position servos, without gravity.

    Parameters
    ----------
    simulator : Simulator
        Arm and scene.
    lags : Lags
        How each of them lags.
    """

    def __init__(self, simulator: Simulator, lags: Lags) -> None:
        self.simulator, self.lags = simulator, lags
        model = cache(partial(_lagging_model, simulator.world))
        pairs = zip(lags.bandwidth.tolist(), lags.acceleration.tolist(), strict=True)
        self.models = [model(*pair) for pair in pairs]
        self.states = [*map(mujoco.MjData, self.models)]

    def begin(self, starts: Array) -> None:
        """Let arms rest at configurations, shape (n, n_joints) [rad or m]."""
        for model, state, start in zip(self.models, self.states, starts, strict=True):
            mujoco.mj_resetData(model, state)
            state.qpos[:] = start[: model.nq]

    def move(self, commands: Array, running: Array) -> Array:
        """Joint positions on the way, shape (n, parts, n_actions) [rad or m], for commands.

        Arms that are not ``running`` stay. Motors go at most as fast as joints are rated,
        and joints stop at their limits.
        """
        parts, time_step = 10, self.simulator.problem.stepping.time_step
        fastest = self.simulator.step_limit / time_step
        ways = np.empty((len(commands), parts, commands.shape[1]))
        for row, (way, state) in enumerate(zip(ways, self.states, strict=True)):
            model = self.models[row]
            limits = model.jnt_range.T
            way[:] = state.qpos
            state.ctrl[:] = commands[row]
            for part in range(parts if running[row] else 0):
                mujoco.mj_step(model, state, round(time_step / SUBSTEP / parts))
                speeds = np.clip(state.qvel, -fastest, fastest)
                late = 0.5 * time_step / parts * (speeds - state.qvel)
                within = np.clip(state.qpos + late, *limits)
                state.qvel[:] = speeds
                state.qvel[(within == limits[0]) | (within == limits[1])] = 0.0
                state.qpos[:] = within
                way[part] = state.qpos
        return ways


def _lagging_model(world: World, bandwidth: float, acceleration: float) -> mujoco.MjModel:
    """The arm on servos of a bandwidth [Hz], whose force ends at an acceleration [rad/s^2]."""
    model = servo_model(mujoco, world, bandwidth)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if acceleration:
        most = model.actuator_gainprm[:, 0] / (2 * np.pi * bandwidth) ** 2 * acceleration
        model.actuator_forcelimited[:] = 1
        model.actuator_forcerange[:] = np.stack([-most, most], axis=1)
    return model


class GivenActions:
    """Commands of given actions, as `kinarm.policies.arm_policy.ArmPolicy` has those of a policy.

    Parameters
    ----------
    simulator : Simulator
        The arm.
    starts, actions : ndarray, shape (n, n_joints) and (n, horizon, n_actions)
        Where arms rest [rad or m], and what they do.
    """

    def __init__(self, simulator: Simulator, starts: Array, actions: Array) -> None:
        self.commanded, self._actions = starts, iter(actions.swapaxes(0, 1))
        self._step, self._limits = simulator.step_limit, (simulator.arm.lower, simulator.arm.upper)

    def command(self, *_: Array) -> Array:
        """Joint positions of the next step, shape (n, n_joints) [rad or m]."""
        moved, action = self.commanded.copy(), next(self._actions)
        moved[:, : len(self._step)] += action * self._step
        self.commanded = np.clip(moved, *self._limits)
        return self.commanded


def exported(policy: Policy, feedback: str) -> ArmPolicy:
    """What drives an arm by a policy, of measured or commanded joint positions."""
    with TemporaryDirectory() as folder:
        export_policy(policy, Path(folder) / "arm", onnx=False)
        return ArmPolicy(Path(folder) / "arm", feedback=feedback)


def run(
    arms: ServoArms,
    policy: Policy | Array,
    starts: Array,
    goals: Array,
    manner: Manner,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """Drive arms by a policy, or by actions, shape (n, horizon, n_actions), to the end.

    Returns which succeeded and touched, shape (n,), and the paths of actuated joints, shape (n,
    horizon + 1, n_actions). Arms that a policy drives rest once either is so.
    """
    simulator, lags, trained = arms.simulator, arms.lags, isinstance(policy, Policy)
    driver: ArmPolicy | GivenActions
    if isinstance(policy, Policy):
        driver = exported(policy, manner.feedback)
    else:
        driver = GivenActions(simulator, starts, policy)
    task, world, n = simulator.task, simulator.world, simulator.n_actions
    stride = np.inf if task.goal.speed is None else task.goal.speed
    stride *= simulator.problem.stepping.time_step
    known = Plant()
    if manner.shield == "joints":
        known = replace(simulator.problem.plant, noise=0.0)
    shield = simulator.changed(plant=known, tolerance=NEVER, shield=True)
    told = shield.reset(starts, goals)
    arms.begin(starts)
    horizon = round(task.horizon / manner.speed)
    rows, commands, q = np.arange(len(starts)), [starts], starts.copy()
    paths = np.empty((len(starts), horizon + 1, n))
    paths[:, 0] = starts[:, :n]
    success, contact = np.zeros((2, len(starts)), dtype=bool)
    tools = world.poses(q)[:, :3, 3]
    for step in range(1, horizon + 1):
        running = ~(success | contact)
        if trained and not running.any():
            break
        seen, aims = q.copy(), goals.copy()
        seen[:, :n] += lags.noise * rng.normal(size=(len(q), n))
        if lags.goal_noise:
            aims[:, :3] += lags.goal_noise * rng.normal(size=(len(q), 3))
        last = commands[-1]
        command = last + manner.speed * (driver.command(seen, aims) - last)
        if manner.shield:
            shield.step(told, (command - last)[:, :n] / simulator.step_limit)
            command = command.copy()
            command[:, :n] = told.q[:, :n] if known.ideal else told.drive[:, COMMAND]
        driver.commanded = command
        commands.append(command)
        late = np.array(commands)[np.maximum(step - lags.delay, 0), rows, :n]
        ways = arms.move(late, running | (not trained))
        paths[:, step] = q[:, :n] = ways[:, -1]
        visited = np.repeat(q[running, None], ways.shape[1], axis=1)
        visited[:, :, :n] = ways[running]
        touched = world.in_contact(visited.reshape(-1, q.shape[1])).reshape(-1, ways.shape[1])
        contact[running] = touched.any(axis=1)
        before, tools = tools, world.poses(q)[:, :3, 3]
        slow = np.linalg.norm(tools - before, axis=1) <= stride
        near = world.distances(q, goals) <= task.tolerance
        success |= running & ~contact & near & slow
    return {"success": success, "contact": contact, "paths": paths}
