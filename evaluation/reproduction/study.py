"""What a reproduction consists of: the paper's trainings, under every reading of its text."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, Literal, get_args

from kinarm._fields import to_plain
from kinarm.policies.ars.config import ARSConfig, Sharing
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import RewardWeights

Scaling = Literal["progress", "sign"]
Purpose = Literal["sweep", "ars", "ppo"]

LEARNERS: Mapping[Purpose, str] = {"ars": "ARS", "ppo": "PPO"}
"""Names of the learners that are compared, by the purpose of their trainings."""

SWEEP_RATES = (0.05, 0.01, 0.005)
SWEEP_PERTURBATIONS = (16, 24, 32)
SWEEP_ITERATIONS = 300
"""Nine settings that the paper tried on task 1 before it chose those of Table 1 (section 3.3)."""

NEAR = 0.2
"""Distance within which the paper calls a trial near its goal (section 4) [m]."""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One way to read what the paper leaves open; the defaults are the literal one.

    Parameters
    ----------
    start_spread : float
        Share of the joint ranges about the home pose from which starts are drawn, in training
        and in trials.
    reward : {"progress", "sign"}
        Whether a step is rewarded by the metres that it brings the tool closer, or by 1 or -1
        for closer or farther, divided by the horizon.
    sharing : {"none", "pair", "iteration"}
        Which rollouts of an ARS iteration face the same start and goal.
    """

    start_spread: float = 1.0
    reward: Scaling = "progress"
    sharing: Sharing = "none"

    @property
    def name(self) -> str:
        """Such as ``"spread1-progress-none"``."""
        return f"spread{self.start_spread:g}-{self.reward}-{self.sharing}"

    def problem(self, task: str) -> ReachProblem:
        """One of the paper's tasks, with the starts of the reading."""
        return PROBLEMS[task].replace(start_spread=self.start_spread)

    def weights(self, problem: ReachProblem) -> RewardWeights | None:
        """What learners are rewarded for; None for what the task rewards."""
        if self.reward == "progress":
            return None
        return replace(problem.task.reward, progress=0.0, closer=1.0 / problem.task.horizon)

    @property
    def for_ppo(self) -> "Reading":
        """The reading without what does not concern PPO."""
        return replace(self, sharing="none")


LITERAL = Reading()


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How trained policies are judged.

    Parameters
    ----------
    trials, seed : int
        Size and seed of the set of trials that the final policies face.
    snapshots : int
        How often the policy is judged in the course of a training.
    snapshot_trials, snapshot_seed : int
        Size and seed of the set of trials that it then faces.
    """

    trials: int = 200
    seed: int = 0
    snapshots: int = 50
    snapshot_trials: int = 100
    snapshot_seed: int = 1


@dataclass(frozen=True, kw_only=True)
class PlannedTraining:
    """One training of a study: what it is for, its settings, and the reading they follow."""

    purpose: Purpose
    config: ARSConfig | PPOConfig
    reading: Reading = LITERAL

    @property
    def name(self) -> str:
        """Unique within a study, and fit for a file name."""
        config = self.config
        parts: list[str] = [self.purpose]
        if self.purpose == "sweep" and isinstance(config, ARSConfig):
            parts += [f"rate{config.step_size:g}", f"perturb{config.directions}"]
        parts += [config.problem.name, f"seed{config.seed}"]
        return "-".join(parts if self.reading == LITERAL else [*parts, self.reading.name])

    @property
    def cost(self) -> float:
        """Rough duration, for scheduling and progress [s of a core]."""
        return self.config.cost

    def to_json(self) -> dict[str, Any]:
        """Everything that the run depends on, save the code."""
        return {
            "purpose": self.purpose,
            "config": to_plain(replace(self.config, problem=self.config.problem.pinned)),
            "reading": asdict(self.reading),
        }


@dataclass(frozen=True, kw_only=True)
class Study:
    """A set of trainings, ``"full"`` or ``"quick"``, and how they are judged."""

    name: str
    trainings: tuple[PlannedTraining, ...]
    protocol: Protocol

    @property
    def is_judged(self) -> bool:
        """Whether the trainings are long enough to judge the paper's claims by."""
        return self.name == "full"

    @property
    def warning(self) -> str:
        """A warning about trainings that judge no claim; else empty."""
        if self.is_judged:
            return ""
        return (
            f"A smoke run: each of {len(self.trainings)} trainings took a few iterations, to see "
            "that everything works. Its figures mean nothing, and no claim is judged."
        )

    def readings(self, purpose: Purpose = "ars") -> tuple[Reading, ...]:
        """Readings under which there are trainings for a purpose."""
        return tuple(dict.fromkeys(t.reading for t in self.trainings if t.purpose == purpose))


def full_study(*, ppo: bool = True) -> Study:
    """The whole paper: 36 trainings for the sweep, and 4 seeds a task under every reading."""
    readings = [
        Reading(start_spread=spread, reward=reward, sharing=sharing)
        for spread, reward, sharing in product((1.0, 0.1), get_args(Scaling), get_args(Sharing))
    ]
    trainings = [*_sweep(range(4)), *_ars(readings, range(4))]
    trainings += _ppo(readings, range(4)) if ppo else ()
    return Study(name="full", trainings=tuple(trainings), protocol=Protocol())


def quick_study(*, ppo: bool = True) -> Study:
    """A smoke version of `full_study`: everything is there, but nothing is trained to the end."""
    readings = (LITERAL, Reading(start_spread=0.1, reward="sign", sharing="iteration"))
    trainings = (
        *_sweep(range(2), iterations=6),
        *_ars(readings, range(2), iterations=10),
        *(_ppo((LITERAL,), range(2), iterations=2, n_epochs=2) if ppo else ()),
    )
    protocol = Protocol(trials=20, snapshots=3, snapshot_trials=10)
    return Study(name="quick", trainings=trainings, protocol=protocol)


def _sweep(seeds: Iterable[int], iterations: int = SWEEP_ITERATIONS) -> Iterator[PlannedTraining]:
    """The sweep on the paper's task 1, with half of the perturbations on top as in Table 1."""
    for rate, perturbations, seed in product(SWEEP_RATES, SWEEP_PERTURBATIONS, seeds):
        directions = {"directions": perturbations, "top_directions": perturbations // 2}
        settings = {"seed": seed, "step_size": rate, "iterations": iterations, **directions}
        config = recipe("ars", "paper", problem=LITERAL.problem("left"), **settings)
        yield PlannedTraining(purpose="sweep", config=config)


def _ars(
    readings: Iterable[Reading], seeds: Iterable[int], **settings: Any
) -> Iterator[PlannedTraining]:
    """Table 1."""
    for reading in readings:
        yield from _comparison("ars", reading, seeds, sharing=reading.sharing, **settings)


def _ppo(
    readings: Iterable[Reading], seeds: Iterable[int], **settings: Any
) -> Iterator[PlannedTraining]:
    """The comparison with PPO (section 4)."""
    for reading in dict.fromkeys(reading.for_ppo for reading in readings):
        yield from _comparison("ppo", reading, seeds, **settings)


def _comparison(
    learner: Literal["ars", "ppo"], reading: Reading, seeds: Iterable[int], **settings: Any
) -> Iterator[PlannedTraining]:
    """Trainings of a learner on all tasks under a reading."""
    for task, seed in product(PROBLEMS, seeds):
        problem = reading.problem(task)
        weights = reading.weights(problem)
        config = recipe(learner, "paper", problem=problem, seed=seed, reward=weights, **settings)
        yield PlannedTraining(purpose=learner, config=config, reading=reading)
