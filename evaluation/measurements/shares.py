"""Where time goes: the shares of modules and libraries in a run of Python's thread."""

import cProfile
import pstats
import sys
from collections.abc import Callable

LIBRARIES = ("torch", "stable_baselines3", "numpy", "scipy")


def time_shares(run: Callable[[], object], least: float = 0.03) -> dict[str, float]:
    """Shares of time by place, largest first; those below ``least`` are summed up.

    The profiler does not see into Pinocchio and Coal: they count for the module that calls them.
    """
    profile = cProfile.Profile()
    profile.runcall(run)
    modules = {getattr(module, "__file__", None): name for name, module in sys.modules.items()}
    seconds: dict[str, float] = {}
    for (file, _, name), entry in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        place = _place(modules.get(file), name)
        seconds[place] = seconds.get(place, 0.0) + entry[2]
    total = sum(seconds.values())
    ordered = sorted(seconds.items(), key=lambda item: -item[1])
    shares = {place: time / total for place, time in ordered if time >= least * total}
    return {**shares, "everything else": 1.0 - sum(shares.values())}


def _place(module: str | None, function: str) -> str:
    """What a function belongs to."""
    if module and module.startswith("kinarm"):
        return "compiled kernels" if ".kernels." in module else module
    for library in LIBRARIES:
        if (module or function).startswith(library) or (not module and library in function):
            return library
    return "Python"
