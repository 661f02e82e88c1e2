"""Checks of a problem before a training: reachable goals, free starts, contact, symmetry."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_statistics import ContactStatistics, random_configurations
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.mirror import mirror_findings
from kinarm.policies.oracle import OracleSolutions, Progress
from kinarm.world import World

OFTEN = 3
"""Pairs that are named as those that touch most often."""


@dataclass(frozen=True, eq=False)
class ProblemCheck:
    """What is known of a problem.

    Attributes
    ----------
    trials : TrialSet
        Trials of it.
    solutions : OracleSolutions
        What the oracle knows about them.
    contact : ContactStatistics
        What touches at random configurations.
    free_starts : ndarray of bool, shape (n_samples,)
        Whether nothing touches, at configurations that the task may start at.
    mirror : dict
        See `mirror_findings`.
    """

    trials: TrialSet
    solutions: OracleSolutions
    contact: ContactStatistics
    free_starts: NDArray[np.bool_]
    mirror: dict[str, str]

    @classmethod
    def of(
        cls, world: World, trials: int = 200, seed: int = 0, on_progress: Progress | None = None
    ) -> "ProblemCheck":
        """Check a problem.

        Parameters
        ----------
        world : World
            The world of the problem.
        trials, seed : int
            How many trials the oracle faces, and their seed.
        on_progress : callable, optional
            Called with the number of trials solved so far and in all.

        Raises
        ------
        ProblemError
            If the arm touches something at all random configurations, or cannot start.
        """
        contact = ContactStatistics.sample(world.contact_model)
        contact.check_movable(world.arm.name)
        faced = TrialSet.draw(world.problem, trials, seed)
        return cls(
            trials=faced,
            solutions=oracle_bounds(faced, on_progress),
            contact=contact,
            free_starts=~world.screen(_random_starts(world))[1],
            mirror=mirror_findings(world),
        )

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Trials in which a motion reaches the goal."""
        return self.solutions.reachable

    @property
    def out_of_reach(self) -> NDArray[np.bool_]:
        """Trials in which no motion does within the horizon, proven."""
        return self.solutions.steps_lower_bound > self.trials.problem.task.horizon

    @cached_property
    def home_contact(self) -> tuple[str, str] | None:
        """What touches at home, if anything does."""
        world = self.trials.simulator.world
        return world.contact_model.contact_pair(world.arm.home)

    @property
    def shares(self) -> dict[str, Estimate]:
        """Shares of the trials that are reached, proven out of reach, and undecided."""
        reached, out = self.reached, self.out_of_reach
        return {
            "reached": Estimate.share(reached),
            "out_of_reach": Estimate.share(out),
            "undecided": Estimate.share(~(reached | out)),
        }

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        problem, solutions = self.trials.problem, self.solutions
        left_out = self.trials.simulator.world.contact_model.left_out
        missed = np.flatnonzero(~self.reached)
        return {
            "problem": problem.to_json(),
            "digest": problem.digest,
            "goals": {
                "trials": len(self.trials),
                "seed": self.trials.seed,
                **{name: estimate.to_json() for name, estimate in self.shares.items()},
                "not_reached": [
                    {
                        "trial": int(trial),
                        "goal": self.trials.goals[trial].tolist(),
                        "reason": str(solutions.reasons[trial]),
                    }
                    for trial in missed
                ],
            },
            "starts": {
                "configurations": len(self.free_starts),
                "free": Estimate.share(self.free_starts).to_json(),
                "home_contact": self.home_contact and list(self.home_contact),
            },
            "contact": {
                "configurations": len(self.contact.free),
                "free": Estimate.share(self.contact.free).to_json(),
                "touching": [[*pair, share] for pair, share in self.contact.shares.items()],
                "left_out": [[*pair, reason] for pair, reason in left_out.items()],
            },
            "mirror": self.mirror,
        }

    def lines(self) -> dict[str, str]:
        """The same in words, by what it is about."""
        contact, count = self.contact, len(self.contact.free)
        goals = (f"{name.replace('_', ' ')} {percent(e)}" for name, e in self.shares.items())
        often = [(pair, share) for pair, share in contact.shares.items() if 0 < share < 1][:OFTEN]
        always, never = map(len, (contact.always, contact.never))
        faults = [f"{name} ({reason})" for name, reason in self.mirror.items() if reason]
        home = self.home_contact
        return {
            "goals": f"{', '.join(goals)}; of {len(self.trials)} trials",
            "starts": f"free {percent(Estimate.share(self.free_starts))} of {count}; at home "
            + (f"{' touches '.join(home)}" if home else "nothing touches"),
            "contact": f"{len(contact.pairs)} pairs are tested; at {count} configurations "
            f"{always} always and {never} never touch",
            "always": "; ".join(" and ".join(pair) for pair in contact.always) or "none",
            "often": "; ".join(f"{' and '.join(pair)} {share:.1%}" for pair, share in often)
            or "none",
            "mirror": f"no: {'; '.join(faults)}" if faults else "yes: the problem is its own image",
        }


def percent(estimate: Estimate) -> str:
    """A share and its interval, in per cent."""
    if estimate.value is None or estimate.ci95 is None:
        return "unknown"
    low, high = estimate.ci95
    return f"{100 * estimate.value:.1f} % ({100 * low:.1f}..{100 * high:.1f})"


def _random_starts(world: World) -> NDArray[np.float64]:
    """Configurations that the task may start at, whether something touches or not."""
    task, home = world.problem.task, world.arm.home
    if task.starts:
        return np.array(task.starts)
    q = random_configurations(world.contact_model, 2000, seed=1)
    starts: NDArray[np.float64] = home + task.start_spread * (q - home)
    return starts
