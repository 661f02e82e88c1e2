"""What studies cost beside their trainings: ``python -m docs.measurements.studies``, some minutes.

The figures of *Run large studies on a cluster*, by one and by two processes.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from kinarm.evaluation import Study

TRIALS = {"count": 200, "per_decade": 0}
TABLE_1: dict[str, Any] = {"trials": TRIALS}
"""The paper's settings."""
PPO: dict[str, Any] = {
    "learner": "ppo",
    "recipe": "paper",
    "trials": TRIALS,
    "fixed": {"iterations": 300},
}
"""Trainings half as long as the recipe's."""
SHORT: dict[str, Any] = {
    "trials": TRIALS,
    "fixed": {"iterations": 1, "directions": 2, "top_directions": 1},
}
"""Trainings that take no time, to see what planning, keeping and reading them takes."""


def timed(experiment: dict[str, Any], folder: Path, seeds: int, jobs: int) -> tuple[float, Study]:
    """Carry out a study in a folder of its own, and tell how long that took [s]."""
    began = time.perf_counter()
    name = f"study-{len(list(folder.iterdir()))}"
    study = Study({"name": name, "seeds": seeds, **experiment}, folder / name).run(jobs=jobs)
    return time.perf_counter() - began, study


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="of the trainings (1)")
    share = parser.parse_args().share
    few, many, most = (max(2, round(share * count)) for count in (24, 200, 1000))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        timed(SHORT, folder, 2, jobs=2)  # loads and compiles
        one, study = timed(TABLE_1, folder, few, jobs=1)
        spent = sum(trained.clock.processor_seconds for trained in study)
        print(f"share of a study that is no training: {1 - spent / one:.1%}")
        two, _ = timed(TABLE_1, folder, few, jobs=2)
        print(f"two processes over one, Table 1: {one / two:.2f} x")
        one, two = (timed(PPO, folder, max(2, round(share * 4)), jobs)[0] for jobs in (1, 2))
        print(f"two processes over one, PPO: {one / two:.2f} x")
        seconds, _ = timed(TABLE_1, folder, many, jobs=2)
        print(f"{many} trainings of Table 1: {seconds:.0f} s")
        seconds, short = timed(SHORT, folder, most, jobs=2)
        print(f"short trainings carried out and kept: {most / seconds:.0f} a second")
        began = time.perf_counter()
        planned = Study({"name": "planned", "seeds": 5000, **SHORT}, folder / "planned").runs
        seconds = time.perf_counter() - began
        print(f"trainings planned: {len(planned) / seconds:,.0f} a second")
        began = time.perf_counter()
        loaded = len(Study.load(short.store.folder).rows())
        size = sum(short.store.path("runs", run).stat().st_size for run in short.runs) / most
        seconds = time.perf_counter() - began
        print(f"reading {loaded} trainings of {size / 1e3:.0f} kB each: {seconds:.2f} s")


if __name__ == "__main__":
    main()
