"""What documents of evaluations say."""


def relative_success(row):
    """Success over that of the oracle, as a row of a document says."""
    return row["metrics"]["relative_success"]["value"]


def faced(document) -> list[tuple[str, str]]:
    return [(row["policy"], row["problem"]) for row in document["results"]]
