"""A long run: is anything left, and does memory grow?

``python -m tests.campaign.endurance --minutes 60 --out data/results/evidence/endurance.json``
does everything in turns, takes a census after every round, and ends with 1 if something
grew or failed.
"""

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from subprocess import SubprocessError
from typing import Any
from unittest import mock

import numpy as np

from kinarm._files import write_text
from kinarm.policies.provenance import package_versions

WARM_UP = 0.2
"""Share of the rounds before memory counts."""

GROWTH = 16.0
"""Largest growth of the memory that counts as flat: median of the last fifth, less that of the
fifth after the warm-up [MB]."""

LEAST_ROUNDS = 2

ARENAS = "MALLOC_ARENA_MAX"
"""Where glibc may keep an arena for every thread, memory grows with threads that are gone."""


def run_long(minutes: float, out: Path) -> dict[str, Any]:
    """Do everything in turns for some time; the document is kept up to date.

    Parameters
    ----------
    minutes : float
        How long [min]; at least two rounds are done.
    out : Path
        The document, ``.json``.
    """
    with tempfile.TemporaryDirectory(prefix="kinarm-endurance-") as name:
        temporary, outputs = Path(name) / "temporary", Path(name) / "outputs"
        temporary.mkdir()
        outputs.mkdir()
        own = {"TMPDIR": str(temporary), "KINARM_CACHE": str(Path(name) / "cache")}
        with mock.patch.dict(os.environ, own), mock.patch("tempfile.tempdir", str(temporary)):
            return _rounds(minutes, out, [temporary, outputs])


def _rounds(minutes: float, out: Path, folders: list[Path]) -> dict[str, Any]:
    # Imported where the folders are known.
    from tests.campaign.census import take_census
    from tests.campaign.errands import ERRANDS, LongRun

    began, rows, incidents = time.monotonic(), [], []
    run = LongRun(folders[1])
    try:
        while len(rows) < LEAST_ROUNDS or time.monotonic() - began < 60 * minutes:
            for errand in ERRANDS:
                try:
                    errand(run)
                except (AssertionError, OSError, TimeoutError, SubprocessError) as error:
                    said = f"{errand.__name__}, round {run.round}: {error!r}"
                    incidents.append(said)
                    sys.stderr.write(f"{said}\n")
                    run.clear()
            run.round += 1
            census = take_census(folders, run.sessions)
            elapsed = (time.monotonic() - began) / 60
            rows.append({"minutes": round(elapsed, 2), **census._asdict()})
            document = _document(rows, run.done, incidents, minutes)
            write_text(out, json.dumps(document, indent=1) + "\n")
            if sys.stderr.isatty() or run.round % 10 == 1:
                sys.stderr.write(f"round {run.round}, {elapsed:.1f} min: {census}\n")
    finally:
        run.close()
    return document


def _document(
    rows: list[dict[str, Any]], done: dict[str, int], incidents: list[str], minutes: float
) -> dict[str, Any]:
    return {
        "kind": "kinarm endurance",
        "command": f"python -m tests.campaign.endurance --minutes {minutes:g}",
        "machine": {"system": platform.platform(), "processors": os.cpu_count()},
        "versions": package_versions(),
        "rounds": len(rows),
        "done": dict(done),
        "incidents": list(incidents),
        **judged(rows),
        "samples": rows,
    }


def judged(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What grew between the end of the warm-up and the end of the run.

    Parameters
    ----------
    rows : sequence of dict
        Censuses in the order in which they were taken.
    """
    from tests.campaign.census import COUNTED

    warm = rows[int(WARM_UP * len(rows)) :]
    fifth = max(len(rows) // 5, 1)
    memory = [row["resident"] for row in warm]
    growth = float(np.median(memory[-fifth:]) - np.median(memory[:fifth]))
    grown = [name for name in COUNTED if warm[-1][name] > warm[0][name]]
    if growth > GROWTH:
        grown.append("resident")
    return {
        "warm_up_rounds": len(rows) - len(warm),
        "memory_growth_mb": round(growth, 2),
        "memory_bound_mb": GROWTH,
        "grown": grown,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; 1 if something grew, or an errand failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="how long")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.json")
    options = parser.parse_args(arguments)
    if ARENAS not in os.environ:
        os.environ[ARENAS] = "1"
        given = sys.argv[1:] if arguments is None else arguments
        os.execv(sys.executable, [sys.executable, "-m", "tests.campaign.endurance", *given])
    document = run_long(options.minutes, options.out)
    verdict = ", ".join(document["grown"]) or "nothing"
    growth = document["memory_growth_mb"]
    sys.stdout.write(f"{document['rounds']} rounds; grew: {verdict}; memory {growth:+.1f} MB\n")
    return int(bool(document["grown"] or document["incidents"]))


if __name__ == "__main__":
    sys.exit(main())
