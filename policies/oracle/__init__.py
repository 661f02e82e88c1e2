"""The oracle: what any policy could reach at best, proven and found."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.policies.oracle.inverse import inverse_kinematics
    from kinarm.policies.oracle.oracle import ORACLE_SEMANTICS, Oracle, Progress
    from kinarm.policies.oracle.solution import OracleSolution, OracleSolutions

__all__ = [
    "ORACLE_SEMANTICS",
    "Oracle",
    "OracleSolution",
    "OracleSolutions",
    "Progress",
    "inverse_kinematics",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "inverse": ("inverse_kinematics",),
        "oracle": ("ORACLE_SEMANTICS", "Oracle", "Progress"),
        "solution": ("OracleSolution", "OracleSolutions"),
    },
)
