"""Bounds on connections that are no browser yet: where there is no room, the oldest idle one goes.

They are counted as they are accepted, before TLS and HTTP. A client that opens a thousand and sends
nothing on them only takes the places of these.
"""

import ipaddress
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from race_server.live.gateway.origins import is_loopback

# One customer of a provider has all addresses of such a network.
IPV6_PREFIX = 64


def network_of(host: str) -> str:
    """Return what an address counts as: itself, and for IPv6 its network of 64 bits."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, IPV6_PREFIX), strict=False))


def is_always_idle() -> bool:
    """Return True: a connection that has not said anything waits for nothing."""
    return True


@dataclass(eq=False)
class _Place:
    """A connection that is counted."""

    line: socket.socket
    number: int  # of its file
    network: str
    is_idle: Callable[[], bool] = is_always_idle


class ConnectionLimiter:
    """Counts open connections, in total and by network."""

    def __init__(self, total: int, per_network: int) -> None:
        """Begin with none. per_network: of a network that is not this machine."""
        self._total, self._per_network = total, per_network
        self._places: dict[int, _Place] = {}  # by file number, oldest first

    def enter(self, line: socket.socket, host: str) -> None:
        """Count a new connection; end the oldest idle one where there are too many.

        Where no other one is idle the new one ends.
        """
        new = _Place(line, line.fileno(), network_of(host))
        self._places.pop(new.number, None)  # of a connection that has ended
        self._places[new.number] = new
        if len(self._places) > self._total:
            self._end_oldest(list(self._places.values()), self._total)
        if not is_loopback(host):
            own = [place for place in self._places.values() if place.network == new.network]
            self._end_oldest(own, self._per_network)

    def _end_oldest(self, places: list[_Place], most: int) -> None:
        """End the oldest idle of some connections, if more than `most` of them are open."""
        for place in places:
            if place.line.fileno() < 0:
                self._forget(place)
        still = [place for place in places if place.line.fileno() >= 0]
        if len(still) > most:
            # The newest has said nothing yet, so one is idle in any case.
            oldest = next(place for place in still if place.is_idle())
            self._forget(oldest)
            with suppress(OSError):  # the other end was quicker
                oldest.line.shutdown(socket.SHUT_RDWR)

    def _forget(self, place: _Place) -> None:
        if self._places.get(place.number) is place:
            del self._places[place.number]

    def watch(self, transport: Any, is_idle: Callable[[], bool]) -> None:
        """Have a counted connection say whether it is idle. transport: of asyncio."""
        place = self._places.get(_number_of(transport))
        if place is not None:
            place.is_idle = is_idle

    def leave(self, transport: Any) -> None:
        """Count a connection no longer. transport: of asyncio."""
        self._places.pop(_number_of(transport), None)


def _number_of(transport: Any) -> int:
    """Return the file number of a transport's connection, -1 where it is closed."""
    line = transport.get_extra_info("socket")
    return -1 if line is None else int(line.fileno())


class BoundedSocket(socket.socket):
    """A listening socket whose connections are counted as they are accepted."""

    limiter: ConnectionLimiter | None = None

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection and count it."""
        line, address = super().accept()
        if self.limiter is not None:
            self.limiter.enter(line, address[0])
        return line, address
