"""kinarm: learn to reach with a simulated six-axis arm, and know how good it is."""

from pathlib import Path

import lazy_loader

from kinarm import _interrupts as _interrupts

__version__ = "2.0.0"

SEMANTICS = "10"
"""Version of every number that simulator and learners compute from settings and seeds.

It covers starts, goals, trials, rollouts and learning, and identifies finished
trainings; the oracle's is `kinarm.policies.oracle.ORACLE_SEMANTICS`. How code
is written does not matter.

Raise it in the commit that changes a number on purpose, and record the golden digests anew:
``python tests/golden/digests.py --record`` (which refuses others under the same version).
"""

# What there is stands in __init__.pyi, and is imported on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# A command starts in two thirds of the time without Gymnasium.
if not _interrupts.is_command():  # pragma: no branch - tests are no command, and start some
    from kinarm import envs as envs  # which registers the environments

_root = Path(__file__).resolve().parent.parent
if (_root / "pyproject.toml").is_file():  # pragma: no branch - tests/packaging runs a wheel
    # In a clone the sub-packages lie beside this folder.
    __path__.append(str(_root))
