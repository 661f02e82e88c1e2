"""Numba's disk cache, as something that kernels can do without."""

from contextlib import suppress
from typing import Any


class ForgivingCache:
    """A cache of Numba's whose damage, or whose full disk, costs time and nothing else.

    Parameters
    ----------
    cache : numba.core.caching.FunctionCache
        The cache of a kernel.
    """

    def __init__(self, cache: Any) -> None:
        self._cache = cache

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Look machine code up; None if there is none or what there is cannot be read."""
        try:
            return self._cache.load_overload(signature, target)
        except Exception:  # a damaged file can raise anything
            with suppress(Exception):
                self._cache.flush()
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep machine code, if that is possible."""
        with suppress(OSError):
            self._cache.save_overload(signature, data)
