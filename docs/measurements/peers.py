"""Other people's simulators and learners beside kinarm, by turns in the same process.

``python -m docs.measurements.peers`` prints a table for a trained policy, ``--policy`` for another.
It needs the extras peers and robots, and vamp for VAMP; what is not installed is left out.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module, metadata
from itertools import combinations
from typing import Any

import coal
import gymnasium
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from docs.measurements.self_contact import of_hulls
from docs.measurements.turns import alternated
from kinarm.chain import quaternion_of
from kinarm.envs import ReachVectorEnv
from kinarm.evaluation.bench import VECTOR_ENVS
from kinarm.evaluation.report.templating import markdown_table
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import Policy, load_policy, recipe, train_policy
from kinarm.policies.learners import find_learner, state_policy
from kinarm.policies.running.mujoco_arm import arm_spec, set_servos
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator
from kinarm.world import World

EPISODES = 512
ROBOT_ITERATIONS = 20
"""Iterations of ARS after which a policy no longer acts at random."""
TESTED = 4
"""Configurations of a step that both simulators test: MuJoCo cannot test its whole motion."""
SINGLE_STEPS, VECTOR_STEPS = 500, 100
LEVEL, TRIALS, BUDGET, BETWEEN = 0.5, 200, 60.0, 0.25
"""Share of trials at which a training is over, how many trials there are, the time after which
it is given up [s], and training between two looks at the policy [s]."""

ARMATURE, STIFFNESS, DAMPING = 1.0, 10_000.0, 400.0
"""Inertia of motors in MuJoCo [kg m2], and gains of their position servos."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Medians of the rates of a peer and of kinarm at the same thing.

    Parameters
    ----------
    what : str
        What was done.
    unit : str
        What the rates count.
    theirs, ours : float
        The rates [1/s].
    terms : str
        What is alike, and what either does beyond the other.
    """

    what: str
    unit: str = "steps/s"
    theirs: float
    ours: float
    terms: str


def compared(
    theirs: Callable[[], int], ours: Callable[[], int], repetitions: int, **about: str
) -> Comparison:
    """Time both by turns; each returns how many of the unit it did."""
    rates = alternated({"theirs": theirs, "ours": ours}, repetitions)
    return Comparison(theirs=rates["theirs"]["median"], ours=rates["ours"]["median"], **about)


def compare_mujoco(policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """MuJoCo's rollouts in C of a policy's arm, and of UR5 with the convex hulls of its meshes."""
    ur5 = recipe(
        "ars",
        "paper",
        problem=PROBLEMS["right"].replace(arm=of_hulls("ur5"), tested_configurations=TESTED),
        iterations=ROBOT_ITERATIONS,
    )
    novice = train_policy(ur5).policy
    for arm, each in ((f"arm `{policy.problem.arm.name}`", policy), ("UR5 with hulls", novice)):
        simulator = Simulator(each.problem.replace(tested_configurations=TESTED))
        scenarios = simulator.sample(np.random.default_rng(EPISODES), EPISODES)
        targets = joint_targets(simulator, each, *scenarios)
        seconds = simulator.problem.stepping.time_step

        def ours(simulator=simulator, each=each, scenarios=scenarios) -> int:
            return int(simulator.rollout(each, *scenarios).steps.sum())

        terms = (
            f"{EPISODES} episodes on {simulator.threads} threads; same starts, shapes, pairs of "
            f"bodies and joint targets, which position servos follow, {seconds:g} s a "
            "step; for more tests of contact MuJoCo takes smaller steps. It solves the dynamics "
            "and resolves contact; kinarm also observes and runs the policy"
        )
        for tests, how in ((TESTED, f"both test {TESTED}"), (1, "1 tested by MuJoCo")):
            with driven(simulator, scenarios[0], targets, tests) as theirs:
                what = f"rollouts, {arm}, {how} a step"
                yield compared(theirs, ours, repetitions, what=what, terms=terms)


@contextmanager
def driven(
    simulator: Simulator, starts: NDArray[np.float64], targets: NDArray[np.float64], tests: int
) -> Iterator[Callable[[], int]]:
    """MuJoCo's rollouts to joint targets, in ``tests`` of its steps for each of kinarm's.

    What it gives runs them once and returns how many of kinarm's steps that were.
    """
    import mujoco
    from mujoco.rollout import Rollout

    threads, time_step = simulator.threads, simulator.problem.stepping.time_step
    model = mujoco_model(simulator.world, time_step / tests)
    workers = [mujoco.MjData(model) for _ in range(threads)]
    states = np.zeros(
        (len(starts), mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    )
    states[:, 1 : 1 + model.nq] = starts[:, : model.nq]  # after the time
    controls = np.repeat(targets, tests, axis=1)
    with Rollout(nthread=threads if threads > 1 else 0) as rollout:

        def run() -> int:
            rollout.rollout(model, workers, states, controls)
            return int(np.prod(targets.shape[:2]))

        yield run


def mujoco_model(world: World, time_step: float) -> Any:
    """A world for MuJoCo, whose joints have position servos."""
    model = mujoco_spec(world, time_step).compile()
    set_servos(model, STIFFNESS, DAMPING)
    return model


def mujoco_spec(world: World, time_step: float) -> Any:
    """Its arm, shapes, and pairs of bodies that may touch, for MuJoCo."""
    import mujoco

    spec = arm_spec(mujoco, world, time_step, ARMATURE)
    geometry, n_shapes = world.contact_model.geometry, world.arm.geometry.ngeoms
    names = [
        f"link{shape.parentJoint}" if index < n_shapes else "world"
        for index, shape in enumerate(geometry.geometryObjects)
    ]
    for index, (name, shape) in enumerate(zip(names, geometry.geometryObjects, strict=True)):
        add_shape(spec, spec.body(name), shape, f"shape{index}")
    tested = {frozenset((names[p.first], names[p.second])) for p in geometry.collisionPairs}
    there = ["world", *(f"link{k}" for k in range(world.arm.n_joints + 1))]
    for first, second in combinations(there, 2):
        if frozenset((first, second)) not in tested:
            spec.add_exclude(bodyname1=first, bodyname2=second)
    return spec


def add_shape(spec: Any, body: Any, shape: pin.GeometryObject, name: str) -> None:
    """Add a collision shape to a body of MuJoCo."""
    from mujoco import mjtGeom

    solid, placement = shape.geometry, shape.placement
    geom = body.add_geom(name=name)
    if isinstance(solid, coal.Capsule):
        geom.type, size = mjtGeom.mjGEOM_CAPSULE, [solid.radius, solid.halfLength]
    elif isinstance(solid, coal.Cylinder):
        geom.type, size = mjtGeom.mjGEOM_CYLINDER, [solid.radius, solid.halfLength]
    elif isinstance(solid, coal.Sphere):
        geom.type, size = mjtGeom.mjGEOM_SPHERE, [solid.radius]
    elif isinstance(solid, coal.Box):
        geom.type, size = mjtGeom.mjGEOM_BOX, solid.halfSide
    elif isinstance(solid, coal.Halfspace):
        upwards = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(solid.n))
        placement = placement * pin.SE3(upwards.matrix(), solid.d * np.array(solid.n))
        geom.type, size = mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0]
    else:
        spec.add_mesh(name=name, uservert=np.ravel(solid.points()))
        geom.type, geom.meshname, size = mjtGeom.mjGEOM_MESH, name, []
    geom.size[: len(size)] = size
    geom.pos, geom.quat = placement.translation, quaternion_of(placement.rotation)


def joint_targets(
    simulator: Simulator, policy: Policy, starts: NDArray[np.float64], goals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Targets of the actuated joints after each step: the paths of a policy's episodes.

    An episode that is over goes back on its path, and forth again, so that no arm rests.

    Returns
    -------
    ndarray, shape (n, horizon, n_actuated)
        [rad or m].
    """
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    horizon, last = simulator.task.horizon, rollouts.steps[:, None]
    places = np.arange(1, horizon + 1) % (2 * last)
    places = np.where(places <= last, places, 2 * last - places)
    rows = np.arange(len(starts))[:, None]
    targets: NDArray[np.float64] = rollouts.paths[rows, places, : simulator.n_actions]
    return targets


def compare_environment(
    policy: Policy, repetitions: int, *, module: str, name: str, about: str
) -> Iterator[Comparison]:
    """Random actions in an environment that a module registers, and in both of kinarm's."""
    gymnasium.register_envs(import_module(module))
    terms = (
        f"random actions through gymnasium.make, one process. {about}, 20 steps of 0.002 s of "
        "dynamics a step of 0.04 s; kinarm: kinematics, 0.02 s a step, whose whole motion is "
        "tested for contact"
    )
    theirs = gymnasium.make(name, disable_env_checker=True)
    single = gymnasium.make(
        "kinarm/ReachRight-v0", problem=policy.problem, disable_env_checker=True
    )
    batch = ReachVectorEnv(VECTOR_ENVS, policy.problem)
    runs = {
        "the single environment": single_stepping(single),
        f"{VECTOR_ENVS} arms in the batch environment": batch_stepping(batch),
    }
    step_theirs = single_stepping(theirs)
    for what, ours in runs.items():
        yield compared(step_theirs, ours, repetitions, what=f"{name} and {what}", terms=terms)


def single_stepping(env: gymnasium.Env[Any, Any]) -> Callable[[], int]:
    """Steps with random actions, which are drawn beforehand."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SINGLE_STEPS)]

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return SINGLE_STEPS

    return run


def batch_stepping(env: ReachVectorEnv) -> Callable[[], int]:
    """Steps of all arms with random actions, which are drawn beforehand."""
    env.reset(seed=0)
    shape = (VECTOR_STEPS, env.num_envs, env.simulator.n_actions)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)

    def run() -> int:
        for action in actions:
            env.step(action)
        return VECTOR_STEPS * env.num_envs

    return run


def compare_ars(policy: Policy, _: int) -> Iterator[Comparison]:
    """One training each of sb3-contrib's ARS and kinarm's; rates are steps in training."""
    config = recipe("ars", "tuned", problem=policy.problem)
    trials = TrialSet.draw(config.problem, TRIALS, 0)
    training = find_learner("ars").begin(config, 1)
    state = training.iterate(training.initial_state())  # compiles

    def iterate() -> int:
        nonlocal state
        state = training.iterate(state)
        return int(state.environment_steps)

    attempts = {
        "theirs": attempt(*sb3_contrib_ars(config), trials),
        "ours": attempt(iterate, lambda: state_policy(config, state), trials),
    }
    told = ", ".join(
        f"{who} {success:.0%} of trials after {seconds:.1f} s and {steps / 1e3:,.0f} thousand steps"
        for who, (seconds, steps, success) in attempts.items()
    )
    yield Comparison(
        what=f"training by ARS; {told}",
        **{who: steps / seconds for who, (seconds, steps, _) in attempts.items()},
        terms=(
            f"recipe `tuned` on `{config.problem.name}`, one thread each, the same {TRIALS} "
            f"trials, during which the clock stands still; N = {config.directions}, "
            f"b = {config.top_directions}, {config.episodes} episodes a direction, linear policy "
            "without bias, normalised observations, the recipe's reward. sb3-contrib cannot "
            "share scenarios between directions, normalises by statistics that change within an "
            f"iteration, and steps {config.episodes} arms of the batch environment at a time"
        ),
    )


def sb3_contrib_ars(config: Any) -> tuple[Callable[[], int], Callable[[], Callable[..., Any]]]:
    """An iteration of sb3-contrib's ARS, by the same settings as far as it has them; its policy."""
    import torch
    from sb3_contrib import ARS
    from stable_baselines3.common.vec_env import VecNormalize

    torch.set_num_threads(1)
    problem = config.problem.replace(reward=config.reward)
    env = VecNormalize(sb3_vec_env(problem, config.episodes, threads=1), norm_reward=False)
    model = ARS(
        "LinearPolicy",
        env,
        n_delta=config.directions,
        n_top=config.top_directions,
        learning_rate=config.step_size,
        delta_std=config.noise,
        n_eval_episodes=config.episodes,
        seed=config.seed,
    )

    def iterate() -> int:
        model.learn(1, reset_num_timesteps=False)
        return int(model.num_timesteps)

    def act(observations: NDArray[np.float64]) -> NDArray[Any]:
        seen = env.normalize_obs(observations.astype(np.float32))
        actions: NDArray[Any] = model.predict(seen, deterministic=True)[0]
        return actions

    return iterate, lambda: act


def attempt(
    iterate: Callable[[], int], policy: Callable[[], Any], trials: TrialSet
) -> tuple[float, int, float]:
    """Iterate until enough trials succeed, or the budget is spent.

    Returns
    -------
    tuple
        Time without looking at the policy [s], environment steps, and share of successes.
    """
    seconds, looked = 0.0, 0.0
    while True:
        began = time.perf_counter()
        steps = iterate()
        seconds += time.perf_counter() - began
        over = seconds >= BUDGET
        if over or seconds - looked >= BETWEEN:
            rollouts = trials.simulator.rollout(policy(), trials.starts, trials.goals)
            looked, success = seconds, float(rollouts.success.mean())
            if over or success >= LEVEL:
                return seconds, steps, success


def compare_vamp(_: Policy, repetitions: int) -> Iterator[Comparison]:
    """VAMP's check of configurations, which another file holds."""
    from docs.measurements.vamp_validity import compare

    for what, unit, terms, theirs, ours in compare():
        yield compared(theirs, ours, repetitions, what=what, unit=unit, terms=terms)


compare_panda_gym = partial(
    compare_environment,
    module="panda_gym",
    name="PandaReach-v3",
    about="PandaReach: PyBullet, seven axes with hand moved by inverse kinematics, empty table",
)
compare_fetch = partial(
    compare_environment,
    module="gymnasium_robotics",
    name="FetchReach-v4",
    about="FetchReach: MuJoCo, a whole Fetch moved by a mocap weld",
)
PEERS: dict[str, tuple[str, Callable[[Policy, int], Iterator[Comparison]]]] = {
    "mujoco": ("mujoco.rollout", compare_mujoco),
    "vamp-planner": ("vamp", compare_vamp),
    "panda-gym": ("panda_gym", compare_panda_gym),
    "gymnasium-robotics": ("gymnasium_robotics", compare_fetch),
    "sb3-contrib": ("sb3_contrib", compare_ars),
}
"""Who is compared with: distribution, the module that it is imported by, and how."""


def page(policy: Policy, repetitions: int) -> Iterator[str]:
    """Compare with all peers; a table in Markdown, and what was alike."""
    rows: list[tuple[str, ...]] = []
    terms: dict[str, None] = {}
    for package, (module, compare) in PEERS.items():
        try:
            import_module(module)
        except ImportError:
            rows.append((package, "not installed", "", "", ""))
            continue
        title = f"{package} {metadata.version(package)}"
        for each in compare(policy, repetitions):
            rates = (f"{rate:,.0f} {each.unit}" for rate in (each.theirs, each.ours))
            rows.append((title, each.what, *rates, f"{each.ours / each.theirs:.3g}"))
            terms[f"- **{title}**: {each.terms}."] = None
    yield markdown_table(("peer", "what", "theirs", "kinarm", "ratio"), rows)
    yield from terms


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--policy", default="ars-tuned-both", metavar="NAME_OR_FILE")
    parser.add_argument("--repetitions", type=int, default=3)
    given = parser.parse_args()
    for part in page(load_policy(given.policy), given.repetitions):
        print(part)


if __name__ == "__main__":
    main()
