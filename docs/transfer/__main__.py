"""``python -m docs.transfer``: what policies of one task are worth for others."""

import argparse
import json
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docs.transfer.document import transfer_document
from docs.transfer.figures import learning_curves
from docs.transfer.page import transfer_page
from docs.transfer.study import TransferStudy
from kinarm.evaluation import save_figure
from kinarm.evaluation.experiments.executors import LocalExecutor


def write_all(document: Mapping[str, Any], out: Path) -> Path:
    """Write document, tables and figure; return the file of the tables."""
    out.write_text(json.dumps(document, indent=1) + "\n")
    picture, _ = save_figure(learning_curves(document), out.parent, out.stem)
    page = out.with_name(f"{out.stem.upper()}.md")
    page.write_text(transfer_page(document, picture.name))
    return page


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser("python -m docs.transfer", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="file of the document, .json")
    parser.add_argument("--folder", type=Path, required=True, help="where trainings are kept")
    parser.add_argument("--seeds", type=int, default=4, help="trainings of each kind")
    parser.add_argument("--jobs", type=int, default=1, help="trainings at a time")
    given = parser.parse_args()
    study = TransferStudy(seeds=given.seeds)
    runs = study.run(given.folder, LocalExecutor(given.jobs))
    command = f"python -m docs.transfer {shlex.join(sys.argv[1:])}"
    print(f"written: {write_all(transfer_document(study, runs, command), given.out)}")


if __name__ == "__main__":
    main()
