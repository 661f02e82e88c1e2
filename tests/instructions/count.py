"""Count the instructions of a fixed workload: a guard of speed that no busy machine disturbs.

``python tests/instructions/count.py`` prints them, ``--record`` records them.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

RECORDED = Path(__file__).with_name("counts.json")
WORKLOAD = Path(__file__).with_name("workload.py")
TARGET = {
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL",
    "OPENBLAS_CORETYPE": "Haswell",
    "OMP_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
}
"""Compiled and run as for a plain processor: for the same counts on every machine of x86-64."""


def counted() -> dict[str, int]:
    """Instructions of each section of the workload."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, **TARGET}
        run = [sys.executable, "-P", str(WORKLOAD)]
        subprocess.run([*run, "--warm"], env=environment, check=True)
        valgrind = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--quiet"]
        options = [f"--callgrind-out-file={folder}/counts", "--smc-check=all-non-file"]
        subprocess.run([*valgrind, *options, *run], env=environment, check=True)
        return dict(map(read_count, sorted(Path(folder).glob("counts.*"))))


def read_count(path: Path) -> tuple[str, int]:
    """Name of a section, and its instructions."""
    text = path.read_text()
    name = re.search(r"^desc: Trigger: Client Request: (.*)$", text, re.MULTILINE)
    total = re.search(r"^(?:totals|summary): (\d+)", text, re.MULTILINE)
    if name is None or total is None:
        raise ValueError(f"{path.name} is no output of callgrind")
    return name[1], int(total[1])


def changes(recorded: dict[str, int], found: dict[str, int]) -> dict[str, float]:
    """Relative change of each section; a section that only one of them has changed by all."""
    names = {**recorded, **found}
    return {
        name: found[name] / recorded[name] - 1 if name in found and name in recorded else 1.0
        for name in names
    }


if __name__ == "__main__":
    counts = counted()
    if "--record" in sys.argv:
        RECORDED.write_text(json.dumps(counts, indent=1) + "\n")
    sys.stdout.write(json.dumps(counts, indent=1) + "\n")
