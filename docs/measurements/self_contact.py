"""How often arms touch themselves at random, with hulls, with pieces, and with their meshes.

``python -m docs.measurements.self_contact`` prints it for the named arms that have meshes.
"""

import sys

import coal

from kinarm import Arm, arm_names
from kinarm.contact_statistics import contact_on_bare_ground
from kinarm.evaluation.arm_facts import SelfContact
from kinarm.evaluation.report.templating import markdown_table

CONFIGURATIONS = 20_000


def pieces_of(name: str) -> dict[str, int]:
    """Into how many pieces the file of a named arm cuts meshes, by link."""
    return Arm.load(name).specification.completed().pieces or {}


def of_hulls(name: str) -> Arm:
    """A named arm with the hulls of its meshes, whatever its file cuts."""
    return Arm.load(name, pieces=dict.fromkeys(pieces_of(name), 1))


def row(name: str) -> list[str]:
    """Shares of an arm; a cell more tells how often pieces miss what meshes touch."""
    pieces = pieces_of(name)
    hulls, cut = (
        SelfContact(contact_on_bare_ground(arm), CONFIGURATIONS)
        for arm in (of_hulls(name), Arm.load(name))
    )
    missed = (cut.meshes & ~cut.simulated).sum()
    shares = [hulls.simulated.mean(), cut.meshes.mean(), cut.simulated.mean()]
    listed = ", ".join(f"{link} = {count}" for link, count in pieces.items())
    return [
        f"`{name}`",
        *(f"{share:.1%}" for share in shares),
        str(missed),
        listed and f"`{listed}`",
    ]


def main() -> None:
    """Print a row for each arm."""
    rows = []
    for name in arm_names():
        shapes = Arm.load(name).meshes.geometryObjects
        if any(isinstance(shape.geometry, coal.BVHModelBase) for shape in shapes):
            sys.stderr.write(f"{name}\n")
            rows.append(row(name))
    header = ("arm", "hulls", "meshes", "as cut", "missed", "pieces")
    print(markdown_table(header, rows))


if __name__ == "__main__":
    main()
