"""The `kernel` decorator: compiled by numba, cached under a digest of every kernel's source.

numba's own cache looks only at the file of the cached function, so a change in a helper of
another file would leave old machine code running. Here the cache folder is named after a digest
of all sources that a kernel can reach and of every setting that changes the machine code.

With ``RACE_SERVER_INTERPRET=1`` kernels stay plain Python and numba is not imported at all. A
driver's own process runs in this way, because it must never wait for a compiler.
"""

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

from race_server.core.kernels.sources import kernel_sources

Function = TypeVar("Function", bound=Callable[..., object])

INTERPRET = os.environ.get("RACE_SERVER_INTERPRET", "") == "1"

_KEPT_CACHES = 4


def cache_root() -> Path:
    """Return the folder for everything that this program may rebuild."""
    chosen = os.environ.get("RACE_SERVER_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "race-server"


@cache
def source_digest() -> str:
    """Return a digest of all kernel sources and of what else decides the machine code."""
    digest = hashlib.sha256()
    for name, path in kernel_sources().items():
        digest.update(name.encode())
        digest.update(path.read_bytes())
    settings = (version("numba"), version("numpy"), sys.version, _bounds_checked())
    digest.update(repr(settings).encode())
    return digest.hexdigest()[:16]


def _bounds_checked() -> bool:
    return os.environ.get("NUMBA_BOUNDSCHECK", "0") not in {"", "0"}


@cache
def kernel_cache() -> Path:
    """Return the folder of the compiled kernels; a temporary one where nothing may be written."""
    folder = cache_root() / "kernels" / source_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # An old cache folder is wanted again once an older version runs again.
        os.utime(folder)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="race-server-kernels-"))
    _drop_old_caches(folder.parent)
    return folder


def _drop_old_caches(parent: Path) -> None:
    folders = sorted(parent.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
    for folder in folders[_KEPT_CACHES:]:
        shutil.rmtree(folder, ignore_errors=True)


def is_compiled() -> bool:
    """Return whether an earlier run left compiled kernels behind."""
    return any(kernel_cache().rglob("*.nbi"))


def kernel(function: Function) -> Function:
    """Compile `function` with numba on its first call, without the interpreter lock.

    Division by zero gives infinity as in numpy; no fast-math, so that results repeat to the bit.
    Kernels are inlined into one another and count no references: a kernel may not make arrays.
    """
    return _compiled(function, inlined=True)


def large_kernel(function: Function) -> Function:
    """Compile `function` as `kernel` does, but as a routine that others call.

    For what is called from several places, and rarely enough that a call costs nothing: inlined
    everywhere it would make compiling slow.
    """
    return _compiled(function, inlined=False)


def written_out(function: Function) -> Function:
    """Compile `function` only where it is called, as if it were written there.

    For what returns a record inside a tuple, which numba cannot return from a compiled function.
    And for what only calls something large: a kernel is optimised together with all that it calls,
    so that each rung of a ladder of calls costs seconds of compiling.
    """
    return _compiled(function, inlined=True, inline="always")


def _compiled(function: Function, *, inlined: bool, **more: Any) -> Function:
    if INTERPRET:
        return function
    from race_server.core.kernels.dispatcher import Kernel

    settings: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "boundscheck": _bounds_checked(),
        "forceinline": inlined,
        "_nrt": False,
        **more,
    }
    return cast("Function", Kernel(function, settings, str(kernel_cache())))


def bind(function: Callable[..., None], *arguments: Any) -> Callable[[], None]:
    """Return a call of a kernel with these very arguments, whose types are looked up only once.

    numba looks up the types of all arguments at every call: for a world of sixty arrays that
    takes longer than to step one kart. The arrays must stay the same; their contents may change.
    """
    if INTERPRET:
        return partial(function, *arguments)
    kernel_object: Any = function
    return partial(kernel_object.entry_for(arguments), *arguments)
