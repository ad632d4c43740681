"""numba's disk cache, with one process at a time compiling a function.

Processes that begin together on a new machine (a server and its drivers, the jobs of a time trial,
tests) would all compile the same kernels for a minute. The first one does; the others wait for it,
and load what it left.
"""

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core import caching

from race_server.core.kernels.inner_library import InnerCacheImpl

try:
    import fcntl
except ImportError:  # Windows: every process compiles for itself
    fcntl = None  # type: ignore[assignment]


_FunctionCache: Any = caching.FunctionCache  # numba is untyped


class DiskCache(_FunctionCache):  # type: ignore[misc]
    """The cache of one function.

    A function is locked from a miss until it is saved, at the latest until the process ends. No
    two processes can wait for each other, because no function calls one that calls it.
    """

    _lock: int | None = None  # file descriptor

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is compiled for a signature; None if this process is to compile it."""
        found = super().load_overload(sig, target_context)
        if found is None and self._lock is None:
            self._wait()
            found = super().load_overload(sig, target_context)
            if found is not None:
                self._release()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save what was compiled, for those that wait too."""
        try:
            super().save_overload(sig, data)
        finally:
            self._release()

    def _wait(self) -> None:
        # Where nothing may be written nothing is shared either.
        with suppress(OSError):
            self._impl.locator.ensure_cache_path()
            path = Path(self._cache_path, f"{self._impl.filename_base}.lock")
            self._lock = os.open(path, os.O_CREAT | os.O_RDWR)
            if fcntl is not None:
                fcntl.flock(self._lock, fcntl.LOCK_EX)

    def _release(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


class InnerDiskCache(DiskCache):
    """The cache of a function that only other kernels call."""

    _impl_class = InnerCacheImpl
