"""A small study, and what its folder holds."""

SMALL = {
    "name": "small",
    "problems": ["right"],
    "seeds": 2,
    "trials": {"count": 12, "first": 200, "per_decade": 3},
    "fixed": {"iterations": 3, "directions": 4, "top_directions": 2},
    "grid": {"step_size": [0.02, 0.2]},
}


def contents(folder):
    """All files of the trainings and bounds of a study, by name."""
    paths = [*folder.glob("runs/*"), *folder.glob("bounds/*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}
