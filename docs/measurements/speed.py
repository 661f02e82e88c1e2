"""All that *How fast* shows: ``python -m docs.measurements.speed data/results/speed``.

It runs ``kinarm-bench --ppo``, `docs.measurements.limits` and `docs.measurements.peers` one after
the other, and writes ``speed.json``, what the first one measured, and ``SPEED.md``, all tables.
"""

import argparse
import json
import sys
from pathlib import Path

from docs.measurements import limits, peers
from kinarm._files import write_text
from kinarm.evaluation.bench import measure
from kinarm.evaluation.report.templating import template_environment
from kinarm.policies import load_policy

POLICY, REPETITIONS = "ars-tuned-both", 3


def main() -> None:
    """Measure, and keep the record."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    command = f"python -m docs.measurements.speed {folder}"
    document = {"command": command, **measure(POLICY, REPETITIONS, ppo=True)}
    write_text(folder / "speed.json", json.dumps(document, indent=1) + "\n")
    ours = template_environment().get_template("speed.md").render(document)
    begin, _, table = ours.partition("\n\n| what")
    parts = [begin, "## Peers\n", *peers.page(load_policy(POLICY), REPETITIONS)]
    parts += ["", *limits.page(POLICY, REPETITIONS), "## Everything\n", f"| what{table}"]
    write_text(folder / "SPEED.md", "\n".join(parts))
    sys.stdout.write("\n".join(parts))


if __name__ == "__main__":
    main()
