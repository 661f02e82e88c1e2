"""How kernels are compiled: without the GIL and without reordering of floating-point operations."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kinarm.kernels.caching import KernelCache
from kinarm.kernels.linking import HelperCompiler, KernelCompiler, LeanCompiler, compiled_once

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function that Python calls, into the disk cache where there can be one."""
    return _called_by_python(function)


def lean_kernel(function: Function) -> Function:
    """Compile such a function that works in lanes and allocates nothing, in less time."""
    return _called_by_python(function, _nrt=False, pipeline_class=LeanCompiler)


def _called_by_python(function: Function, **more: Any) -> Function:
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "no_cfunc_wrapper": True,
        "pipeline_class": KernelCompiler,
    } | more
    compiled: Any = njit(**options)(function)
    with suppress(RuntimeError):  # of Numba, if there is no folder that it can write to
        compiled._cache = KernelCache(function)
    return cast("Function", compiled)


def inlined(function: Function) -> Function:
    """Compile a helper that allocates nothing: several times faster without reference counts."""
    return _linked(function, forceinline=True, _nrt=False)


def helper(function: Function) -> Function:
    """Compile a long helper that allocates nothing: called, it is compiled only once."""
    return _linked(function, _nrt=False)


def _linked(function: Function, **more: Any) -> Function:
    """Compile what only kernels call, with no way there from Python, which would crash."""
    options: dict[str, Any] = {
        "error_model": "numpy",
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "pipeline_class": HelperCompiler,
    }
    return cast("Function", compiled_once(njit(**options, **more)(function)))
