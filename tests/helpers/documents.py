"""What documents of evaluations say."""

import json
from pathlib import Path


def relative_success(row):
    """Success over that of the oracle, as a row of a document says."""
    return row["metrics"]["relative_success"]["value"]


def faced(document) -> list[tuple[str, str]]:
    return [(row["policy"], row["problem"]) for row in document["results"]]


def outcomes_of(path: Path, policy: str) -> dict[str, list]:
    """How the trials of a policy ended, as the document in a file says."""
    rows = json.loads(path.read_text())["results"]
    return next(row["outcomes"] for row in rows if row["policy"] == policy)
