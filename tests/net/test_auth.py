"""Who may do what on the network: access rules, limits, keys, logins, replays, the steward."""

import io
import json
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.cli.service import steward_token
from race_server.competition.launch import free_address
from race_server.core.messages import Event, EventKind, Phase
from race_server.credentials import badge_of, key_of, key_of_badge
from race_server.errors import KeysError, LinkError, Reason, SeatError, WireError
from race_server.live.client.seat import take_seat
from race_server.live.client.spectator import Spectator
from race_server.live.client.steward import StewardClient
from race_server.live.server import LOCKSTEP, REAL, RaceResult, RaceServer
from race_server.live.server.counters import Refusals
from race_server.live.server.steward import Steward
from race_server.logs import AGAIN, FIRST, MOST_SENDERS, QUIET_S, Log, RefusalLog
from race_server.net.auth.access import ANYONE, access_control, keys_allowed, roles_of
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import read_client_keys, read_server_keys
from race_server.net.auth.limits import rate_limit, size_filter
from race_server.net.auth.seat_owners import SeatOwners
from race_server.net.auth.settings import (
    SPARE_SESSIONS,
    ListenSettings,
    check_listen_settings,
    is_local,
    server_settings,
)
from race_server.net.auth.token import local_token, read_token
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.admin import (
    Decision,
    decode_decision,
    decode_log,
    encode_decision,
    encode_log,
)
from race_server.net.wire.lobby import (
    PROTOCOL,
    Join,
    SeatAct,
    check_reply,
    encode_join,
    encode_seat_act,
)
from race_server.net.wire.spectate import decode_events
from race_server.session import Session
from race_server.session.interventions import Intervention
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import races
from race_server.storage.results.store import Store
from race_server.storage.results.writer import Writer
from race_server.tools.drills.deny import drill_deny
from support.servers import running, wait_until, waiting
from support.sessions import session_on_ring

SEAT, OTHER, SPECTATOR, STEWARD = roles_of(2)


# Rules made of the table of topics


def test_a_seat_sends_and_lives_on_its_own_keys_only() -> None:
    allowed = keys_allowed("cup", SEAT)
    assert allowed["send"] == ["race/cup/in/0", "race/cup/pose/0", "race/cup/alert/0"]
    assert allowed["live"] == ["race/cup/alive/0/*"]
    assert "race/cup/obs/0" in allowed["listen"]
    assert "race/cup/q/join/0" in allowed["ask"]
    assert not [key for keys in allowed.values() for key in keys if "/1" in key or "any" in key]


def test_a_spectator_sends_nothing_and_asks_for_no_seat() -> None:
    allowed = keys_allowed("cup", SPECTATOR)
    assert set(allowed) == {"listen", "hear", "ask", "be answered"}
    assert all(key.startswith("race/cup/out/") for key in allowed["listen"])
    assert not [key for key in allowed["ask"] if "join" in key or "admin" in key]


def test_only_the_steward_may_ask_for_what_is_the_stewards() -> None:
    asks = {role.name: keys_allowed("cup", role)["ask"] for role in roles_of(2)}
    assert [name for name, keys in asks.items() if "race/cup/admin/act" in keys] == ["steward"]


def test_every_topic_that_clients_use_is_in_the_rules_of_a_closed_session() -> None:
    allowed = {key for keys in keys_allowed("cup", ANYONE).values() for key in keys}
    for topic in topics.TOPICS:
        place = topics.EVERY if topic.is_seats else -1
        assert topics.key_of(topic, "cup", place) in allowed


def test_what_no_rule_allows_is_denied_and_both_credentials_must_fit() -> None:
    control = access_control("cup", roles_of(2), passwords=True, certificates=True)
    assert control["default_permission"] == "deny"
    assert {rule["permission"] for rule in control["rules"]} == {"allow"}
    assert control["subjects"][1] == {
        "id": "seat-1",
        "usernames": ["cup-seat-1"],
        "cert_common_names": ["cup-seat-1"],
    }


def test_each_key_has_a_rate_of_its_own_and_lockstep_has_none_for_controls() -> None:
    rates = {row["id"]: row["rules"] for row in rate_limit("cup", 2, real_time=True)}
    keys = [rule["key_expr"] for rule in rates["rate of in/{seat}"]]
    assert {"race/cup/in/0", "race/cup/in/1"} <= set(keys)
    assert not [key for key in keys if "*" in key]
    in_lockstep = {row["id"] for row in rate_limit("cup", 2, real_time=False)}
    # There a client asks for the events of each decision, however fast the world is.
    assert rates.keys() - in_lockstep == {
        "rate of in/{seat}",
        "rate of pose/{seat}",
        "rate of alert/{seat}",
        "rate of q/events",
    }


def test_whatever_a_client_sends_has_a_size() -> None:
    covered = {row["key_exprs"][0] for row in size_filter("cup")}
    assert {"race/cup/in/*", "race/cup/q/join/*", "race/cup/admin/act"} <= covered


@pytest.mark.parametrize(
    ("address", "local"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/[::1]:7447", True),
        ("tcp/localhost:7447", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/192.168.1.5:7447", False),
        ("tcp/127.0.0.1.example.org:7447", False),
        ("unixsock-stream/tmp/race", True),
    ],
)
def test_an_address_that_others_can_reach_needs_keys(address: str, *, local: bool) -> None:
    assert is_local(address) is local
    if not local:
        with pytest.raises(LinkError, match="without keys any of them could race"):
            check_listen_settings(ListenSettings(address, "race", 2))


# Badges


def test_the_key_tells_neither_badge_nor_secret() -> None:
    assert key_of(7) == key_of_badge(badge_of(7).encode())
    assert key_of(7).hex() != badge_of(7)


def test_only_the_badge_that_fits_holds_a_seat_whichever_comes_first() -> None:
    own, thief = badge_of(7).encode(), badge_of(8).encode()
    holders = SeatOwners(2)
    assert holders.note_link(1, own, is_there=True)
    assert not holders.news
    holders.admit(1, key_of(7))
    assert list(holders.news) == [(1, True)]
    assert holders.is_holder(1, own)
    assert not holders.is_holder(1, thief)
    assert not holders.note_link(1, thief, is_there=True)
    assert holders.note_link(1, thief, is_there=False)
    assert list(holders.news) == [(1, True)]


# Keys in folders


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys") / "cup"
    issue_keys(Order("cup", 2, spectators=1, hosts=("10.0.0.7",)), folder)
    return folder


def test_keys_are_for_their_owner_only_and_the_authority_is_thrown_away(keys: Path) -> None:
    for path in (keys, *keys.rglob("*")):
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path
    certificates = {path.parent.name for path in keys.rglob("key.pem")}
    assert certificates == {"server", "seat-0", "seat-1", "spectator", "steward"}


def test_certificates_name_the_role_and_the_server_its_hosts(keys: Path) -> None:
    x509 = pytest.importorskip("cryptography.x509")
    own = x509.load_pem_x509_certificate((keys / "seat-1" / "certificate.pem").read_bytes())
    assert own.subject.rfc4514_string() == "CN=cup-seat-1"
    server = x509.load_pem_x509_certificate((keys / "server" / "certificate.pem").read_bytes())
    names = server.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    hosts = {str(name.value) for name in names}
    assert hosts == {"10.0.0.7", "127.0.0.1", "::1", "localhost"}


def test_only_the_steward_is_handed_the_token(keys: Path) -> None:
    server = read_server_keys(keys, "cup", 2)
    assert read_client_keys(keys / "steward").token == server.token
    assert not read_client_keys(keys / "seat-0").token
    assert read_client_keys(keys / "seat-0").address == "tls/10.0.0.7:7447"


def test_keys_of_another_session_or_too_few_seats_are_refused(keys: Path) -> None:
    with pytest.raises(KeysError, match="are for session 'cup', not 'final'"):
        read_client_keys(keys / "seat-0", "final")
    with pytest.raises(KeysError, match="are for 2 seats, the race has 8"):
        read_server_keys(keys, "cup", 8)
    with pytest.raises(KeysError, match="is not empty"):
        issue_keys(Order("cup"), keys)


def test_keys_that_expired_or_do_not_belong_together_are_refused(tmp_path: Path) -> None:
    issue_keys(Order("cup", 2), tmp_path / "cup")
    own, other = tmp_path / "cup" / "seat-0", tmp_path / "cup" / "seat-1"
    (own / "key.pem").write_bytes((other / "key.pem").read_bytes())
    with pytest.raises(KeysError, match="do not belong together"):
        read_client_keys(own)
    about = json.loads((other / "keys.json").read_text()) | {"expires": "2001-01-01T00:00:00+00:00"}
    (other / "keys.json").write_text(json.dumps(about))
    with pytest.raises(KeysError, match="expired on 2001-01-01"):
        read_client_keys(other)
    (other / "keys.json").write_text("[]")
    with pytest.raises(KeysError, match="damaged"):
        read_client_keys(other)


def test_settings_without_keys_ask_for_no_credentials(keys: Path) -> None:
    closed = server_settings(ListenSettings("tcp/127.0.0.1:7447", "cup", 2))
    assert "transport/auth/usrpwd" not in closed
    assert closed["transport/shared_memory/enabled"] is False
    held = read_server_keys(keys, "cup", 2)
    opened = server_settings(ListenSettings("tls/0.0.0.0:7447", "cup", 2, held))
    assert opened["transport/link/tls"]["enable_mtls"] is True
    assert opened["transport/unicast/max_sessions"] == 2 * 2 + 1 + 4 + SPARE_SESSIONS


def test_the_token_of_a_closed_session_lies_there_while_it_is_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with local_token("tcp/127.0.0.1:7447", "cup") as token:
        assert read_token("tcp/127.0.0.1:7447", "cup") == token
        path = next(tmp_path.rglob("*.token"))
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(KeysError, match="no token of a steward"):
        read_token("tcp/127.0.0.1:7447", "cup")


def test_a_server_whose_token_cannot_be_written_races_without_a_steward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "file" / "folder"))
    said = io.StringIO()
    with Log(stream=said) as log, ExitStack() as stack:
        token = steward_token("tcp/127.0.0.1:7447", "cup", log, stack)
    assert token == ""
    assert said.getvalue().count("races have no steward") == 1
    with pytest.raises(SeatError, match="the token does not fit"):
        Steward(session_on_ring("cup"), token).check(Decision(token, "log"))


# The steward


def racing(karts: int = 2) -> Session:
    session = session_on_ring("cup", karts, laps=1)
    for seat in range(karts):
        session.join(f"driver {seat}", "track", wanted=seat, secret=seat + 1)
    session.start()
    return session


def told(steward: Steward, act: str, seat: int = -1, value: float = 0.0) -> None:
    steward.decide(Decision("token", act, seat, value, steward.challenge, "ann"))


def test_nobody_is_steward_without_the_token() -> None:
    for token, shown in (("token", "guess"), ("token", ""), ("", "")):
        steward = Steward(racing(), token)
        with pytest.raises(SeatError, match="only the steward may do that"):
            steward.decide(Decision(shown, "flag", challenge=steward.challenge))


def test_a_decision_counts_once() -> None:
    steward = Steward(racing(), "token")
    decision = Decision("token", "penalty", 1, 5.0, steward.challenge)
    steward.decide(decision)
    with pytest.raises(SeatError, match="taken already"):
        steward.decide(decision)
    assert len(steward.lines) == 1


def test_a_penalty_is_added_and_logged_as_an_act() -> None:
    session = racing()
    session.journal.is_recorded = True
    told(Steward(session, "token"), "penalty", 1, 2.5)
    assert session.world.racers[0, 1].penalty_us == 2_500_000
    acts = [act for act in session.journal.entries if isinstance(act, Intervention)]
    assert [(act.kart, act.value) for act in acts] == [(1, 2.5)]


def test_who_was_sent_away_comes_back_only_when_the_seat_is_opened() -> None:
    session = racing()
    steward = Steward(session, "token")
    told(steward, "kick", 1)
    with pytest.raises(SeatError, match="seat 1 is closed: the steward sent its driver away"):
        session.join("driver 1", "track", wanted=1, secret=2)
    session.reopen()
    told(steward, "open", 1)
    assert session.join("driver 1", "track", wanted=1, secret=2).number == 1


def test_a_closed_seat_is_not_given_away() -> None:
    session = session_on_ring("cup", karts=2)
    told(Steward(session, "token"), "close", 0)
    assert session.join("first", "track").number == 1
    with pytest.raises(SeatError, match="all 2 seats are taken or closed"):
        session.join("second", "track")


def test_what_makes_no_sense_is_said() -> None:
    steward = Steward(session_on_ring("cup", karts=2), "token")
    for act, message in (
        ("flag", "no race is on"),
        ("dance", "cannot 'dance'; choose one of flag"),
    ):
        with pytest.raises(SeatError, match=message):
            told(steward, act)


def test_who_owns_a_seat_takes_it_up_once_its_old_link_is_gone() -> None:
    session = racing()
    with pytest.raises(SeatError, match="a client is logged in with its keys already"):
        session.join("again", "track", wanted=1, secret=99, owns=True)
    session.drop(1)
    with pytest.raises(SeatError, match="the race has begun"):
        session.join("stranger", "track", wanted=1, secret=99)
    assert session.join("again", "track", wanted=1, secret=99, owns=True).number == 1
    assert session.seats[1].fits(99)


def test_a_refusal_is_counted_each_time_and_told_once_for_each_seat() -> None:
    stream = io.StringIO()
    refusals = Refusals(Log(stream=stream))
    for seat in (2, 2, -1, 2, -1):
        refusals.record(Reason.AGAIN, seat)
    assert refusals[Reason.AGAIN] == 5
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["event"] for line in lines] == ["refused for the first time"] * 2
    assert [line.get("seat") for line in lines] == [2, None]


def test_a_sender_that_is_refused_without_end_is_one_line_a_minute_and_hides_no_other() -> None:
    stream, now = io.StringIO(), [0.0]
    told = RefusalLog(Log(stream=stream), clock=lambda: now[0])
    for tenth in range(1800):  # for two minutes from its first line on, ten a second
        now[0] = tenth * QUIET_S / 600
        told.record("again", 3, seat=3)
    told.record("again", 4, seat=4)
    told.record("foreign", 3, seat=3)
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [(line["event"], line["seat"], line.get("times")) for line in lines] == [
        (FIRST, 3, None),
        (AGAIN, 3, 600),
        (AGAIN, 3, 600),
        (FIRST, 4, None),
        (FIRST, 3, None),
    ]


def test_senders_without_end_share_a_line_until_the_oldest_is_forgotten() -> None:
    stream, now = io.StringIO(), [0.0]
    told = RefusalLog(Log(stream=stream), clock=lambda: now[0])
    for number in range(3 * MOST_SENDERS):
        told.record("token", f"192.0.2.{number}", address=f"192.0.2.{number}")
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert len(lines) == MOST_SENDERS + 1
    assert lines[-1]["sender"] == f"one of more than {MOST_SENDERS}"
    now[0] = QUIET_S
    told.record("token", "198.51.100.1", address="198.51.100.1")
    assert "198.51.100.1" in stream.getvalue()


def test_a_stewards_messages_survive_the_wire() -> None:
    decision = Decision("token", "penalty", 3, 2.5, 1 << 62, "ann")
    assert decode_decision(encode_decision(decision)) == decision
    assert decode_log(encode_log(5, ["one", "two"])) == (5, ["one", "two"])
    with pytest.raises(WireError):
        decode_decision(encode_decision(replace(decision, value=float("nan"))))


# Over the network


@pytest.mark.net
def test_a_penalty_after_the_finish_changes_order_result_file_and_is_announced(
    tmp_path: Path,
) -> None:
    address, path = free_address(), tmp_path / "results.sqlite"
    session = session_on_ring("cup", karts=2, laps=1, countdown_s=0.1, items=False)
    amended: list[RaceResult] = []
    heard: list[Event] = []
    with (
        Writer(Store(path), print) as writer,
        ServerLink(address, "cup", 2) as link,
        ClientLink(address, "cup") as steward,
    ):
        steward.listen(topics.EVENTS, lambda data: heard.extend(decode_events(data)[1]))
        drivers = ("pure_pursuit", "follow_gap")
        server = RaceServer(
            session,
            link,
            LOCKSTEP,
            drivers,
            Keeper(writer),
            token="token",
            amended=amended.append,
        )
        result = server.run(0)
        assert result is not None
        server.reopen()
        with waiting(server, drivers=2):
            winner, second = (row.seat for row in result.standings)
            line = StewardClient(steward, "token").decide("penalty", seat=winner, value=60.0)
    assert line.endswith(f"seat {winner}, {drivers[winner]}, after the race")
    (changed,) = amended
    assert [row.seat for row in changed.standings] == [second, winner]
    assert changed.standings[1].race_time_us == result.standings[0].race_time_us + 60_000_000
    assert changed.standings[0].gap_us == 0 < changed.standings[1].gap_us
    assert changed.digest == result.digest
    assert changed.events[-1].kind is EventKind.PENALTY
    assert changed.events[-1] in heard
    (race,) = races(path)
    assert [row["seat"] for row in race["entries"]] == [second, winner]
    assert race["entries"][1]["penalty_us"] == 60_000_000


def test_once_the_next_race_begins_a_result_stands() -> None:
    session = racing()
    session.phase = Phase.LOBBY
    with pytest.raises(SeatError, match="no race is on"):
        told(Steward(session, "token"), "penalty", 1, 5.0)


@contextmanager
def opened(keys: Path, seats: int = 2, protocol: str = "tls") -> Iterator[tuple[str, RaceServer]]:
    address = free_address().replace("tcp", protocol)
    held = read_server_keys(keys, "cup", seats) if protocol == "tls" else None
    session = session_on_ring("cup", seats, laps=1)
    with ServerLink(address, "cup", seats, keys=held) as link:
        server = RaceServer(session, link, REAL, token="token")
        with waiting(server, seats):
            yield address, server


@pytest.mark.net
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


@pytest.mark.net
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
            .decide("close", seat=0)
            .endswith("ann: seat 0 closed")
        )


@pytest.mark.net
def test_the_steward_stops_the_clock_and_starts_the_race_anew() -> None:
    session = session_on_ring("cup", karts=1, laps=1, limit_s=30.0)
    address = free_address()
    with ServerLink(address, "cup", 1) as link:
        server = RaceServer(session, link, REAL, ("pure_pursuit",), token="token")
        with running(server), ClientLink(address, "cup") as client:
            marshal = StewardClient(client, "token")
            wait_until(lambda: session.tick > 5)
            marshal.decide("pause")
            tick = session.tick
            time.sleep(0.2)
            assert session.tick == tick
            marshal.decide("resume")
            wait_until(lambda: session.tick > tick)
            marshal.decide("restart")
            wait_until(lambda: session.epoch == 2)
            assert session.seats[0].is_taken


@pytest.mark.net
@pytest.mark.slow
def test_the_drill_finds_every_forbidden_act_denied_and_every_legal_one_allowed() -> None:
    document = drill_deny()
    assert document["ok"], document["why"]
    assert document["acts"] > 80
