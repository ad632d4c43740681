"""How much of a gateway one address, one network and one browser may use."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest

from race_server.errors import GatewayError
from race_server.live.gateway.connection_limiter import ConnectionLimiter, network_of
from race_server.live.gateway.limits import RateLimiter


@contextmanager
def entering(limiter: ConnectionLimiter) -> Iterator[Callable[[str], socket.socket]]:
    """Return what lets a connection of an address enter, and returns the end of the client."""
    with ExitStack() as stack:

        def enter(host: str) -> socket.socket:
            client, line = socket.socketpair()
            stack.enter_context(client)
            stack.enter_context(line)
            client.settimeout(0.0)
            limiter.enter(line, host)
            return client

        yield enter


def has_ended(client: socket.socket) -> bool:
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False


def test_where_there_is_no_room_the_oldest_connection_ends() -> None:
    with entering(ConnectionLimiter(3, 2)) as enter:
        first, second, third = (enter(f"192.0.2.{number}") for number in range(3))
        assert not has_ended(first)
        fourth = enter("192.0.2.9")
        assert [has_ended(line) for line in (first, second, third, fourth)] == [True, *[False] * 3]
        fourth.close()


def test_one_network_of_ipv6_has_room_for_some_and_this_machine_for_all() -> None:
    with entering(ConnectionLimiter(1024, 2)) as enter:
        neighbours = [enter(f"2001:db8:0:7::{number}") for number in range(1, 4)]
        assert [has_ended(line) for line in neighbours] == [True, False, False]
        assert not has_ended(enter("2001:db8:0:8::1"))
        assert not any(has_ended(enter("::1")) for _ in range(5))


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("a name", "a name"),
    ],
)
def test_an_address_counts_as_its_network(host: str, network: str) -> None:
    assert network_of(host) == network


def test_connections_leave_room_for_the_race_however_few_files_may_be_open() -> None:
    program = (
        "import resource\n"
        "from race_server.live.gateway.limits import GatewayLimits\n"
        "from race_server.live.gateway.service import room_for_connections as room\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (256, 1024))\n"
        "print(room(GatewayLimits()), *resource.getrlimit(resource.RLIMIT_NOFILE))\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "RACE_SERVER_INTERPRET": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.split() == ["512", "1024", "1024"]


def test_an_allowance_fills_up_again() -> None:
    now = [0.0]
    limiter = RateLimiter(10.0, "texts", burst_s=2.0, clock=lambda: now[0])
    for _ in range(20):
        limiter.spend()
    with pytest.raises(GatewayError, match="more than 10 texts a second"):
        limiter.spend()
    now[0] += 0.11
    limiter.spend()
