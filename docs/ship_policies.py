"""Renew what ships: ``python -m docs.ship_policies FOLDER`` takes the policies of a study.

FOLDER is that of ``kinarm-study policies --out FOLDER``. Of its finished trainings, those whose
names ship already replace the files in ``data/policies``; another group ships once its files lie
there. It says how many of them came out otherwise.
"""

import argparse
from pathlib import Path

import numpy as np

from kinarm.evaluation import Study
from kinarm.policies import Policy, load_policy, policy_names

SHIPPED = Path(__file__).parents[1] / "data" / "policies"


def are_equal(one: Policy, other: Policy) -> bool:
    """Whether two policies act by the same numbers, to the bit."""
    first, second = ((each.mean, each.std, *sum(each.layers, ())) for each in (one, other))
    return all(map(np.array_equal, first, second))


def main() -> None:
    """Renew the files."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the study")
    study, renewed, changed = Study.load(parser.parse_args().folder), 0, 0
    for run in study.finished:
        config = run.config
        name = f"{run.learner}-{config.recipe}-{config.problem.name}-seed{config.seed}"
        if name in policy_names():
            policy = study.policy(run)
            changed += not are_equal(policy, load_policy(name))
            policy.save(SHIPPED / f"{name}.npz")
            renewed += 1
    print(f"{renewed} of {len(policy_names())} policies are renewed, {changed} with other weights")


if __name__ == "__main__":
    main()
