"""Renew what ships: ``python -m docs.ship_policies FOLDER`` takes the policies of a study.

FOLDER is that of ``kinarm-study policies --out FOLDER``. Of its finished trainings, those whose
names ship already replace the files in ``data/policies``; another group ships once its files lie
there.
"""

import argparse
from pathlib import Path

from kinarm.evaluation import Study
from kinarm.policies import policy_names

SHIPPED = Path(__file__).parents[1] / "data" / "policies"


def main() -> None:
    """Renew the files."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the study")
    study, renewed = Study.load(parser.parse_args().folder), 0
    for run in study.finished:
        config = run.config
        name = f"{run.learner}-{config.recipe}-{config.problem.name}-seed{config.seed}"
        if name in policy_names():
            study.policy(run).save(SHIPPED / f"{name}.npz")
            renewed += 1
    print(f"{renewed} of {len(policy_names())} policies are renewed")


if __name__ == "__main__":
    main()
