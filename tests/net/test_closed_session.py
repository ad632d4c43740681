"""A session with keys, over the network: logins, forgeries, the drill."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Phase
from race_server.errors import KeysError, LinkError, SeatError
from race_server.live.client.seat import take_seat
from race_server.live.client.spectator import Spectator
from race_server.live.client.steward import StewardClient
from race_server.live.server import REAL, RaceServer
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import read_client_keys, read_server_keys
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import (
    PROTOCOL,
    Join,
    SeatAct,
    check_reply,
    encode_join,
    encode_seat_act,
)
from race_server.tools.drills.deny import drill_deny
from support.servers import waiting
from support.sessions import session_on_ring


@contextmanager
def opened(keys: Path, seats: int = 2, protocol: str = "tls") -> Iterator[tuple[str, RaceServer]]:
    address = free_address().replace("tcp", protocol)
    held = read_server_keys(keys, "cup", seats) if protocol == "tls" else None
    session = session_on_ring("cup", seats, laps=1)
    with ServerLink(address, "cup", seats, keys=held) as link:
        server = RaceServer(session, link, REAL, token="token")
        with waiting(server, seats):
            yield address, server


@pytest.mark.live
def test_an_open_session_lets_in_who_has_keys_and_says_why_others_are_out(
    keys: Path, tmp_path: Path
) -> None:
    own, watcher = read_client_keys(keys / "seat-1"), read_client_keys(keys / "spectator")
    issue_keys(Order("cup", 2), tmp_path / "cup")
    with opened(keys) as (address, server):
        with ClientLink(address, "cup", keys=own) as link:
            assert take_seat(link, Join("ann", "track", 1)).number == 1
            with pytest.raises(LinkError, match="the server does not allow this request"):
                link.ask(topics.JOIN, encode_join(Join("ann", "track", 0)), 0)
        with ClientLink(address, "cup", keys=watcher) as link:
            standings = Spectator(link).standings
            assert standings is not None
            assert standings.phase is Phase.LOBBY
        with pytest.raises(LinkError, match="the password is wrong"):
            ClientLink(address, "cup", keys=replace(own, password="guess"), timeout_s=0.3)
        strange = read_client_keys(tmp_path / "cup" / "seat-1")
        with pytest.raises(LinkError, match="that these keys do not trust"):
            ClientLink(address, "cup", keys=strange, timeout_s=0.3)
        with pytest.raises(KeysError, match="requires a certificate"):
            ClientLink(address, "cup")
        assert server.link.is_open


@pytest.mark.live
def test_copies_forgeries_and_other_versions_are_refused_with_a_reason(keys: Path) -> None:
    with opened(keys, protocol="tcp") as (address, _), ClientLink(address, "cup") as link:
        seat = take_seat(link, Join("ann", "track", 1))
        secret = seat.welcome.secret
        ready = encode_seat_act(SeatAct(1, secret))
        check_reply(link.ask(topics.READY, ready, 1))
        old = encode_join(Join("old", "track", 0, version=PROTOCOL - 1))
        for topic, data, place, message in (
            (topics.READY, ready, 1, "again: already at"),
            (topics.READY, encode_seat_act(SeatAct(1, secret)), 0, "claims seat 1, but came on"),
            (topics.JOIN, old, 0, f"speaks protocol {PROTOCOL}, the driver {PROTOCOL - 1}"),
        ):
            with pytest.raises(SeatError, match=message):
                check_reply(link.ask(topic, data, place))
        with pytest.raises(SeatError, match="the token does not fit"):
            StewardClient(link, "guess").log()
        assert (
            StewardClient(link, "token", "ann")
            .decide("close", seat=1)
            .endswith("ann: seat 1 closed")
        )


@pytest.mark.live
@pytest.mark.slow
def test_the_drill_finds_every_forbidden_act_denied_and_every_legal_one_allowed() -> None:
    document = drill_deny()
    assert document["ok"], document["why"]
    assert document["acts"] > 80
