"""How kernels are compiled: without the GIL and without reordering of floating-point operations."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
UNCALLED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of what only kernels call: without a way there from Python, which would crash."""

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function that Python calls, into the disk cache where there can be one."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        return cast("Function", njit(cache=True, **options)(function))
    except RuntimeError:
        return cast("Function", njit(**options)(function))


def inlined(function: Function) -> Function:
    """Compile a helper that allocates nothing: several times faster without reference counts."""
    options: dict[str, Any] = {
        "error_model": "numpy",
        "forceinline": True,
        "_nrt": False,
        **UNCALLED,
    }
    return cast("Function", njit(**options)(function))


def helper(function: Function) -> Function:
    """Compile a long helper that allocates nothing: called, it is compiled only once."""
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False, **UNCALLED}
    return cast("Function", njit(**options)(function))


def unit(function: Function) -> Function:
    """Compile a function that allocates what it returns, for kernels."""
    return cast("Function", njit(error_model="numpy", **UNCALLED)(function))
