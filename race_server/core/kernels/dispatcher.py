"""A compiled function that costs an entry from Python only where Python calls it.

The entry turns Python objects into numbers and pointers. For a world of sixty arrays it is larger
than most kernels, and most kernels are called by other kernels alone: without it they compile in
half the time.
"""

from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import Any

import numba
from numba.core.registry import CPUDispatcher

from race_server.core.kernels.disk_cache import DiskCache, InnerDiskCache
from race_server.core.kernels.inner_library import InnerCompiler

_Dispatcher: Any = CPUDispatcher  # numba is untyped


class Kernel(_Dispatcher):  # type: ignore[misc]
    """A function as other kernels call it; called from Python it compiles `entry` as well."""

    def __init__(self, function: Any, settings: dict[str, Any], cache: str) -> None:
        """Take a function with the options of numba. cache: folder of what is compiled."""
        numba.config.CACHE_DIR = cache  # type: ignore[attr-defined]  # untyped setting
        self._settings = {"nopython": True, **settings}
        inner = {**self._settings, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        super().__init__(function, targetoptions=inner, pipeline_class=InnerCompiler)
        self._cache = InnerDiskCache(function)

    @cached_property
    def entry(self) -> Any:
        """The same function as Python calls it."""
        inner: Any = self.py_func
        parts = (inner.__code__, inner.__globals__, inner.__name__, inner.__defaults__)
        outer = FunctionType(*parts, inner.__closure__)
        outer.__module__, outer.__doc__ = inner.__module__, inner.__doc__
        outer.__qualname__ = f"{inner.__qualname__}_entry"  # names the file in the cache
        dispatcher = _Dispatcher(outer, targetoptions=self._settings)
        dispatcher._cache = DiskCache(outer)
        return dispatcher

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the entry. numba would look the types up here first, and find nothing."""
        return self.entry(*arguments, **named)

    def entry_for(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Return what Python calls with arguments of the types of these."""
        typeof: Any = numba.typeof
        signature = tuple(typeof(argument) for argument in arguments)
        self.entry.compile(signature)
        found: Callable[..., Any] = self.entry.overloads[signature].entry_point
        return found

    def add_overload(self, compiled: Any) -> None:
        """Keep what was compiled, out of reach of a call from Python: it has no entry."""
        self.overloads[tuple(compiled.signature.args)] = compiled
