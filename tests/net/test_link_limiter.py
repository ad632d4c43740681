"""How many links and files the holders of keys, and strangers, may use of an open session."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from race_server.competition.launch import free_address, free_port
from race_server.errors import KeysError, LinkError, RaceError, Reason
from race_server.live.client.seat import take_seat
from race_server.live.client.steward import StewardClient
from race_server.live.server import REAL, RaceServer
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import (
    ClientKeys,
    read_client_keys,
    read_revoked,
    read_server_keys,
    revoke_keys,
)
from race_server.net.auth.settings import ListenSettings, check_listen_settings, places_of
from race_server.net.transport import ClientLink, ServerLink, link_limiter
from race_server.net.transport.sockets import close_connections
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.tools.drills.flood import drill_flood
from race_server.tools.drills.front import front_of, missing_front
from race_server.tools.drills.intruder import Intruder
from support.servers import running, wait_until, waiting
from support.sessions import session_on_ring

PLACES = {"cup-seat-0": 2, "cup-seat-1": 2, "cup-spectator": 1, "cup-steward": 4}


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    issue_keys(Order("cup", 2, spectators=1), tmp_path / "cup")
    return tmp_path / "cup"


@contextmanager
def opened(
    keys: Path, *, steward_address: str = "", address: str = "", fill: tuple[str, ...] = ()
) -> Iterator[RaceServer]:
    """Serve the lobby of two seats, or a race of drivers that fill them, until the block ends."""
    held = read_server_keys(keys, "cup", 2)
    address = address or free_address().replace("tcp", "tls")
    session = session_on_ring("cup", 2, laps=99)
    with ServerLink(address, "cup", 2, keys=held, steward_address=steward_address) as link:
        server = RaceServer(session, link, REAL, fill, token=held.token)
        with running(server) if fill else waiting(server, 2):
            yield server


def linked(server: RaceServer, keys: ClientKeys, address: str = "") -> ClientLink:
    return ClientLink(address or server.link.address, "cup", keys=keys, timeout_s=2.0)


def is_answered(link: ClientLink) -> bool:
    try:
        return bool(link.ask(topics.TABLE))
    except RaceError:
        return False


# Links of each key


def test_each_key_has_places_that_no_other_one_can_take(keys: Path) -> None:
    held = read_server_keys(keys, "cup", 2)
    assert places_of(ListenSettings("tls/127.0.0.1:7447", "cup", 2, held)) == PLACES


@pytest.mark.live
def test_the_steward_gets_in_while_one_seats_keys_open_links_without_end(keys: Path) -> None:
    own = read_client_keys(keys / "seat-0")
    with opened(keys) as server, contextlib.ExitStack() as stack:
        for _ in range(30):
            stack.enter_context(Intruder(server.link.address, own))
        wait_until(lambda: server.link.dropped[Reason.TOO_MANY_LINKS, 0] >= 20)
        with linked(server, read_client_keys(keys / "steward")) as link:
            assert StewardClient(link, read_client_keys(keys / "steward").token).log() == []
        with linked(server, read_client_keys(keys / "seat-1")) as link:
            assert take_seat(link, Join("ann", "track", 1)).number == 1


@pytest.mark.live
def test_revoked_keys_lose_seat_and_links_on_a_running_server_and_others_keep_theirs(
    keys: Path,
) -> None:
    own, other = read_client_keys(keys / "seat-0"), read_client_keys(keys / "seat-1")
    with opened(keys) as server, linked(server, own) as link, linked(server, other) as kept:
        take_seat(link, Join("eve", "track", 0))
        take_seat(kept, Join("ann", "track", 1))
        revoke_keys(keys, "seat-0")
        wait_until(lambda: 0 in server.session.seats.closed)
        assert not server.session.seats[0].is_taken
        wait_until(lambda: server.link.dropped[Reason.BARRED_LINK, 0] > 0)
        assert is_answered(kept)
        link.close()
        server.link.dropped.clear()
        with contextlib.suppress(LinkError), linked(server, own):
            wait_until(lambda: server.link.dropped[Reason.BARRED_LINK, 0] > 0)
        assert server.session.seats[1].is_taken


def test_revoked_keys_stay_revoked_and_only_those_that_there_are_can_be(keys: Path) -> None:
    assert read_revoked(keys / "server") == frozenset()
    revoke_keys(keys, "spectator")
    revoke_keys(keys / "server", "seat-1")
    assert read_revoked(keys / "server") == {"cup-spectator", "cup-seat-1"}
    with pytest.raises(KeysError, match="no keys of 'seat-2'; choose one of seat-0, seat-1"):
        revoke_keys(keys, "seat-2")
    with pytest.raises(KeysError, match="holds the keys of seat-0"):
        revoke_keys(keys / "seat-0", "seat-1")


@pytest.mark.live
def test_keys_of_a_driver_sent_away_are_let_in_again_when_its_seat_is_opened(keys: Path) -> None:
    own, steward = read_client_keys(keys / "seat-0"), read_client_keys(keys / "steward")
    with opened(keys) as server, linked(server, own) as link, linked(server, steward) as chief:
        take_seat(link, Join("eve", "track", 0))
        marshal = StewardClient(chief, steward.token)
        marshal.decide("kick", seat=0)
        wait_until(lambda: server.link.dropped[Reason.BARRED_LINK, 0] > 0)
        marshal.decide("open", seat=0)
        with linked(server, own) as again:
            assert take_seat(again, Join("eve", "track", 0)).number == 0


@pytest.mark.live
def test_only_the_steward_is_let_in_at_the_stewards_address(keys: Path) -> None:
    stewards = free_address().replace("tcp", "tls")
    steward = read_client_keys(keys / "steward")
    with opened(keys, steward_address=stewards) as server:
        with linked(server, read_client_keys(keys / "seat-0"), stewards):
            wait_until(lambda: server.link.dropped[Reason.STEWARD_ADDRESS, 0] > 0)
        with linked(server, steward, stewards) as link:
            assert StewardClient(link, steward.token).log() == []


def test_a_stewards_address_needs_certificates_and_a_second_port(keys: Path) -> None:
    held = read_server_keys(keys, "cup", 2)
    for public, stewards, message in (
        ("tcp/0.0.0.0:7447", "tls/0.0.0.0:7448", "knows by its certificate"),
        ("tls/0.0.0.0:7447", "tls/127.0.0.1:7447", "the steward needs another one"),
    ):
        settings = ListenSettings(public, "cup", 2, held, steward_address=stewards)
        with pytest.raises(LinkError, match=message):
            check_listen_settings(settings)


# Keys that end


@pytest.mark.live
def test_a_link_ends_with_its_certificate(tmp_path: Path) -> None:
    issue_keys(Order("cup", 2, spectators=1, days=2.0 / 86400.0), tmp_path / "cup")
    own = read_client_keys(tmp_path / "cup" / "spectator")
    with opened(tmp_path / "cup") as server, linked(server, own) as link:
        assert is_answered(link)
        wait_until(lambda: server.link.clients() == 0)
        with pytest.raises(KeysError, match="expired on"):
            read_client_keys(tmp_path / "cup" / "spectator")
        with pytest.raises(LinkError):
            ClientLink(server.link.address, "cup", keys=own, timeout_s=0.3)


@pytest.mark.live
def test_new_keys_replace_the_old_ones_when_the_session_is_served_again(
    keys: Path, tmp_path: Path
) -> None:
    issue_keys(Order("cup", 2, spectators=1), tmp_path / "new")
    old, new = (read_client_keys(folder / "seat-0") for folder in (keys, tmp_path / "new"))
    address = free_address().replace("tcp", "tls")
    for folder, good, bad in ((keys, old, new), (tmp_path / "new", new, old)):
        with opened(folder, address=address) as server:
            with linked(server, good) as link:
                assert is_answered(link)
            with pytest.raises(LinkError, match="do not trust"):
                ClientLink(address, "cup", keys=bad, timeout_s=0.3)


# Files


@pytest.mark.live
def test_the_public_door_is_paused_while_too_many_connections_wait(
    keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_limiter, "HANDSHAKES", 20)
    stewards = free_address().replace("tcp", "tls")
    own, steward = read_client_keys(keys / "spectator"), read_client_keys(keys / "steward")
    with opened(keys, steward_address=stewards) as server, contextlib.ExitStack() as stack:
        place = ("127.0.0.1", int(server.link.address.rpartition(":")[2]))
        limiter = server.link._link_limiter
        assert limiter is not None
        for _ in range(60):
            idle = stack.enter_context(socket.socket())
            idle.setblocking(False)
            idle.connect_ex(place)
        wait_until(lambda: limiter.is_paused)
        with linked(server, steward, stewards) as link:
            assert is_answered(link)
        with pytest.raises(LinkError):
            ClientLink(server.link.address, "cup", keys=own, timeout_s=0.3)


def test_a_process_gets_the_files_that_it_wants_but_no_more_than_it_may() -> None:
    program = (
        "import resource\n"
        "from race_server.net.open_files import raise_open_files\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (256, 1024))\n"
        "print(raise_open_files(512), raise_open_files(4096), raise_open_files(64))\n"
    )
    environment = {**os.environ, "RACE_SERVER_INTERPRET": "1"}
    command = [sys.executable, "-c", program]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["512", "1024", "1024"]


def test_a_connection_of_this_process_is_ended_by_its_other_end() -> None:
    with (
        socket.create_server(("127.0.0.1", free_port())) as listener,
        socket.create_connection(listener.getsockname()) as client,
    ):
        served, (host, port) = listener.accept()
        with served:
            assert close_connections({f"{host}:{port + 1}"}) == 0
            assert close_connections({f"{host}:{port}"}) == 1
            assert client.recv(1) == b""


# Requests


@pytest.mark.live
def test_a_spectator_is_answered_while_others_ask_without_end(keys: Path, tmp_path: Path) -> None:
    issue_keys(Order("cup", 2, spectators=4), tmp_path / "hall")
    own = read_client_keys(tmp_path / "hall" / "spectator")
    name = topics.key_of(topics.TABLE, "cup")
    hall = opened(tmp_path / "hall", fill=("pure_pursuit",))
    with hall as server, contextlib.ExitStack() as stack:
        crowd = [stack.enter_context(Intruder(server.link.address, own)) for _ in range(3)]
        stop = threading.Event()

        def ask_on() -> None:
            while not stop.wait(0.002):
                for intruder in crowd:
                    intruder.session.get(name, lambda _: None)

        with linked(server, own) as link:
            asking = threading.Thread(target=ask_on)
            asking.start()
            answers = [is_answered(link) for _ in range(15)]
            stop.set()
            asking.join()
        assert answers == [True] * 15


# The front


@pytest.mark.live
@pytest.mark.skipif(bool(missing_front()), reason=missing_front() or "it is there")
def test_a_front_keeps_junk_away_and_a_login_takes_less_than_a_second(keys: Path) -> None:
    server_port, stewards, public, steward_port = (free_port() for _ in range(4))
    own, steward = read_client_keys(keys / "spectator"), read_client_keys(keys / "steward")
    address, own_address = f"tls/127.0.0.1:{server_port}", f"tls/127.0.0.1:{stewards}"
    with (
        opened(keys, address=address, steward_address=own_address) as server,
        front_of(server_port, stewards, public, steward_port),
        contextlib.ExitStack() as stack,
    ):
        for _ in range(200):
            junk = stack.enter_context(socket.create_connection(("127.0.0.1", public)))
            junk.sendall(b"GET / HTTP/1.0\r\n\r\n")
        begun = time.monotonic()
        with linked(server, own, f"tls/127.0.0.1:{public}") as link:
            assert is_answered(link)
        with linked(server, steward, f"tls/127.0.0.1:{steward_port}") as link:
            assert is_answered(link)
        assert time.monotonic() - begun < 2.0


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.skipif(bool(missing_front()), reason=missing_front() or "it is there")
def test_the_drill_lets_clients_in_within_a_second_while_strangers_flood_it() -> None:
    document = drill_flood(200, 3.0)
    assert document["ok"], document["why"]
    assert document["login_s"] <= 1.0
