"""Numba's disk cache, keyed by all that is compiled into a kernel, and dispensable.

Numba takes machine code for fresh as long as the file that defines a kernel is as it was. Helpers
and constants from other files are compiled in, too: here the key is a hash of all of them.
"""

import hashlib
import sys
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import llvmlite
import numpy as np
from numba.core.caching import FunctionCache


class KernelCache(FunctionCache):
    """Machine code of a kernel on disk; if it is damaged or cannot be kept, this costs only time.

    Two processes with the same sources, and the same versions of Numba and llvmlite, share it.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Look machine code up; None if there is none or what there is cannot be read."""
        try:
            self._cache_file._source_stamp = self._key
            return super().load_overload(sig, target_context)
        except Exception:  # a damaged file can raise anything
            with suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code, if that is possible."""
        with suppress(OSError):
            super().save_overload(sig, data)

    @cached_property
    def _key(self) -> str:
        # Only now is all there that the kernel's module defines.
        return compiled_in(self._py_func.__module__)


@cache
def compiled_in(module: str) -> str:
    """Hash of what the kernels of a module are made of.

    This is the source of the module and of all those whose helpers it takes, directly or not, and
    of those that make them compile; and what these take from others: numbers, and the fields of
    named tuples.
    """
    parts: dict[str, object] = {"llvmlite": llvmlite.__version__}
    _collect(module, parts)
    return hashlib.sha256(repr(sorted(parts.items())).encode()).hexdigest()


def _collect(module: str, parts: dict[str, object]) -> None:
    """Add what kernels of a module are made of, by its name."""
    source = Path(sys.modules[module].__file__ or "").read_bytes()
    parts[module] = hashlib.sha256(source).hexdigest()
    for name, value in vars(sys.modules[module]).items():
        home = getattr(value, "__module__", None) or ""
        if isinstance(value, int | float | np.generic):
            parts[f"{module}.{name}"] = repr(value)
        elif hasattr(value, "_fields"):
            parts[f"{home}.{name}"] = value._fields
        if home not in parts and (".kernels" in home or hasattr(value, "py_func")):
            _collect(home, parts)
