"""The TCP sockets of this process, whichever library opened them: closed, counted, paused.

zenoh has no call that closes a link or stops accepting. Both can be done one level below, by the
process that owns the sockets. Elsewhere than on Linux a listening socket cannot be paused.
"""

import ctypes
import os
import socket
import stat
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_FILES = Path("/dev/fd")
# linux/asm-generic/socket.h
_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27
# A program of one instruction that keeps no byte of any packet: BPF_RET | BPF_K, 0.
_DROP_ALL = struct.pack("HBBI", 0x06, 0, 0, 0)


def count_files() -> int:
    """Return how many files this process has open."""
    return len(os.listdir(_FILES))  # noqa: PTH208 - not one object for each of thousands


def close_connections(peers: set[str]) -> int:
    """End the connections whose other ends are `peers` and return how many there were.

    peers: places such as ``127.0.0.1:4711`` and ``[::1]:4711``.
    """
    closed = 0
    for own in _sockets():
        with suppress(OSError):  # a socket that is not connected has no other end
            if _place(own.getpeername()) in peers:
                own.shutdown(socket.SHUT_RDWR)
                closed += 1
    return closed


def listeners(port: int) -> list[socket.socket]:
    """Return copies of the sockets that listen on a port, to be closed by the caller."""
    found = []
    for own in _sockets():
        is_tcp = own.family in {socket.AF_INET, socket.AF_INET6} and own.type == socket.SOCK_STREAM
        listens = is_tcp and own.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
        if listens and own.getsockname()[1] == port:
            # Not `own.dup()`: it would let zenoh's own copy block.
            found.append(socket.socket(fileno=os.dup(own.fileno())))
    return found


def pause_listener(listener: socket.socket, *, is_paused: bool) -> None:
    """Let the system drop what opens a connection to a listening socket, or let it pass again.

    Connections that are open are not touched.
    """
    if sys.platform != "linux":
        return
    if is_paused:
        program = ctypes.create_string_buffer(_DROP_ALL)
        where = struct.pack("HL", 1, ctypes.addressof(program))
        listener.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, where)
    else:
        with suppress(OSError):  # none was attached
            listener.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)


def _sockets() -> Iterator[socket.socket]:
    """Yield copies of this process's sockets, each closed when the next one is asked for."""
    for name in os.listdir(_FILES):  # noqa: PTH208 - as above
        try:
            # A copy: the number may stand for another file by the time that it is used.
            copy = os.dup(int(name))
        except OSError:  # closed meanwhile, or no file is left for the copy
            continue
        if not stat.S_ISSOCK(os.fstat(copy).st_mode):
            os.close(copy)
            continue
        with socket.socket(fileno=copy) as own:
            yield own


def _place(address: tuple[object, ...] | str) -> str:
    if isinstance(address, str) or not address:
        return ""
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in str(host) else f"{host}:{port}"
