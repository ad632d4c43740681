"""Browsers of a live race: which are admitted, what is sent, and that none disturbs others."""

import json
import re
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from urllib.error import HTTPError

import pytest
from websockets.frames import CloseCode, Frame, Opcode

from race_server.competition.launch import free_address
from race_server.core.messages import Control, Flag
from race_server.errors import GatewayError
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from race_server.net.wire.drive import ControlFrame, decode_hud, encode_control
from race_server.net.wire.links import decode_links
from race_server.net.wire.lobby import decode_course, decode_welcome
from race_server.net.wire.spectate import decode_events, decode_snapshot
from support.browsers import Browser
from support.rays import decode_rays
from support.served_race import ORIGIN, TOKENS, ServedRace, gated, racing, wait_for_race

pytestmark = pytest.mark.net

WATCH = {"role": "spectate", "rate": 60}
DRIVE = {"role": "drive", "token": "drive one", "seat": 1, "name": "Ada"}
# A page that was silent for this long may be replaced.
STALLED_S = 1.0
STEWARD = {"role": "steward", "token": "steward one", "name": "Eve"}


@pytest.fixture(scope="module", autouse=True)
def _private_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the steward's token of these races apart from those of other tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield


@pytest.fixture(scope="module")
def served() -> Iterator[ServedRace]:
    """Two scripted karts that race without end, and a gateway."""
    address = free_address()
    with racing(address) as server, gated(address) as served:
        served.server = server
        wait_for_race(served)
        yield served


@contextmanager
def lobby_with(timing: GatewayTiming) -> Iterator[ServedRace]:
    """Serve a lobby that waits for one driver, and a gateway."""
    address = free_address()
    with racing(address, drivers=1) as server, gated(address, timing=timing) as served:
        served.server = server
        wait_for_race(served)
        yield served


@pytest.fixture
def lobby() -> Iterator[ServedRace]:
    """A lobby that waits for one driver, and a gateway."""
    with lobby_with(GatewayTiming()) as served:
        yield served


def ask(served: ServedRace, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    request = urllib.request.Request(served.base + path, headers=headers)
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request) as answer:
            return answer.status, dict(answer.headers), answer.read().decode()
    except HTTPError as error:
        return error.code, dict(error.headers), error.read().decode()


def test_a_spectator_is_told_the_course_first_and_then_the_race_as_it_goes(
    served: ServedRace,
) -> None:
    with Browser(served.base, WATCH) as browser:
        welcome = browser.word("welcome")
        assert (welcome["role"], welcome["session"]) == ("spectate", "race")
        assert decode_course(browser.frame(b"RCRS")).name == "ring"
        first = decode_snapshot(browser.frame(b"RSNP"))
        assert [frame[4:8] for frame in browser.frames[:3]] == [b"RCRS", b"RRUL", b"RLIN"]
        second = decode_snapshot(browser.frame(b"RSNP"))
        assert len(second.karts) == 2
        assert second.tick > first.tick
        links = decode_links(browser.frame(b"RLNK")).links
        assert set(links["seat"]) == {0, 1}
        assert (links["age"] < 500).all()


def test_a_late_spectator_is_told_all_events_of_the_race(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        _, events = decode_events(browser.frame(b"REVT"))
    assert events[0].sequence == 1


def test_a_spectator_gets_as_many_snapshots_as_it_wants(served: ServedRace) -> None:
    with Browser(served.base, {**WATCH, "rate": 10}) as browser:
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(6)]
        assert ticks[5] - ticks[1] == pytest.approx(24, abs=2)
        browser.send({"type": "rate", "rate": 30})
        for _ in range(3):
            browser.frame(b"RSNP")
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(6)]
        assert ticks[5] - ticks[0] == pytest.approx(10, abs=2)


def test_a_ping_comes_back_with_the_clock_of_the_server(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.frame(b"RSNP")
        browser.send({"type": "ping", "t": 12.5})
        pong = browser.word("pong")
        assert pong["t"] == 12.5
        # On one machine both read the same clock.
        assert pong["server_us"] == pytest.approx(time.monotonic_ns() / 1000, abs=500_000)


def test_rays_come_of_the_kart_that_is_followed_while_they_are_wanted(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.send({"type": "follow", "seat": 1, "rays": True})
        rays = decode_rays(browser.frame(b"RRAY"))
        assert rays.seat == 1
        assert len(rays.lidar) == 201
        assert 0.0 < rays.lidar.min() < 1.4  # no further from a border than the track is wide
        browser.send({"type": "follow", "seat": -1, "rays": False})
        browser.frame(b"RSTD")
        browser.frames.clear()
        browser.frame(b"RSTD")
        assert b"RRAY" not in [frame[4:8] for frame in browser.frames]


REFUSALS = [
    ({"role": "steward", "token": "wrong"}, "token", 4401),
    ({"role": "drive", "token": ""}, "token", 4401),
    ({"role": "king"}, "malformed", 4400),
    ("not json", "malformed", 4400),
    ("[" * 1000, "malformed", 4400),
    (b"\0\1\2\3", "malformed", 4400),
    ({**WATCH, "rate": "often"}, "malformed", 4400),
    ({**WATCH, "name": "x" * 2000}, "too-large", 4413),
    ({**WATCH, "resume": "never issued"}, "used", 4410),
    ({**WATCH, "source": "recording:../race"}, "no-recording", 4404),
    ({**DRIVE, "seat": 0}, "seat-taken", 4409),
]


@pytest.mark.parametrize(("hello", "code", "closes"), REFUSALS)
def test_a_wrong_hello_is_refused_with_a_word_and_a_sentence(
    served: ServedRace, hello: dict[str, object] | str | bytes, code: str, closes: int
) -> None:
    with Browser(served.base, hello) as browser:
        assert browser.refusal() == (code, closes)
        assert len(browser.words[-1]["reason"]) > 10


def test_who_says_nothing_is_refused(served: ServedRace) -> None:
    with (
        gated(served.address, timing=GatewayTiming(hello_s=0.2)) as impatient,
        Browser(impatient.base) as browser,
    ):
        assert browser.refusal() == ("late", 4408)


def test_pages_from_elsewhere_are_refused_and_named_ones_are_not(served: ServedRace) -> None:
    with Browser(served.base, WATCH, origin="https://evil.example") as browser:
        assert browser.refusal() == ("origin", 4403)
    for origin in (ORIGIN, served.base.rstrip("/")):
        with Browser(served.base, WATCH, origin=origin) as browser:
            browser.word("welcome")


def test_who_does_not_speak_the_subprotocol_is_refused(served: ServedRace) -> None:
    with Browser(served.base, WATCH, subprotocols=None) as browser:
        assert browser.refusal() == ("malformed", 4400)


def test_a_full_gateway_refuses_the_next(served: ServedRace) -> None:
    limits = GatewayLimits(browsers=1)
    with gated(served.address, limits=limits) as small, Browser(small.base, WATCH) as first:
        first.word("welcome")
        with Browser(small.base, WATCH) as second:
            assert second.refusal() == ("full", 4430)
        assert first.frame(b"RSNP")


class Stub:
    """A browser that is there and does nothing."""

    def __init__(self) -> None:
        self.outbox = self

    def check(self) -> None:
        pass


def test_one_address_has_room_for_some_browsers_and_this_machine_for_more(
    served: ServedRace,
) -> None:
    browsers = [(Stub(), host) for host in ("192.0.2.1", "127.0.0.1") for _ in range(16)]
    try:
        for browser, host in browsers:
            served.state.admit(browser, host)
        with pytest.raises(GatewayError, match="of your address"):
            served.state.admit(Stub(), "192.0.2.1")
        served.state.admit(late := Stub(), "127.0.0.1")
        browsers.append((late, "127.0.0.1"))
    finally:
        for browser, host in browsers:
            served.state.remove(browser, host)


def test_floods_and_bytes_of_spectators_end_only_their_own_socket(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as honest, Browser(served.base, WATCH) as flooding:
        for _ in range(60):
            flooding.send({"type": "ping", "t": 1})
        assert flooding.refusal() == ("too-fast", 4429)
        with Browser(served.base, WATCH) as rude:
            rude.send(b"\0" * 100)
            assert rude.refusal() == ("malformed", 4400)
        with Browser(served.base, WATCH) as wordy:
            wordy.send({"type": "ping", "more": "x" * 2000})
            assert wordy.refusal() == ("too-large", 4413)
        with Browser(served.base, WATCH) as huge:
            huge.word("welcome")
            huge.send("x" * 70_000)
            while huge.receive(2.0) is not None:
                pass
            assert huge.socket.close_code == 1009
        assert honest.frame(b"RSNP")


def ends_with(browser: Browser) -> int | None:
    """Return the code with which a browser's socket is closed, None where it is not."""
    with suppress(AssertionError):
        browser.until(lambda _: False, 5.0)
    return browser.socket.close_code


def test_a_token_that_is_no_text_is_refused_as_any_wrong_one_is(served: ServedRace) -> None:
    for role in ("drive", "steward"):
        with Browser(served.base, f'{{"role": "{role}", "token": "\\ud800"}}') as rude:
            assert rude.refusal() == ("token", 4401)


@pytest.mark.parametrize(
    ("pieces", "code"),
    [
        ([(Opcode.TEXT, b"\xff", True)], CloseCode.INVALID_DATA),
        (
            [(Opcode.TEXT, b"", False)] + [(Opcode.CONT, b"", False)] * 100,
            CloseCode.MESSAGE_TOO_BIG,
        ),
        ([(Opcode.PONG, b"x" * 100, True)] * 5000, CloseCode.POLICY_VIOLATION),
    ],
    ids=["no text", "pieces without end", "pongs without end"],
)
def test_what_browsers_never_send_ends_their_socket_and_is_not_told_at_length(
    served: ServedRace,
    caplog: pytest.LogCaptureFixture,
    pieces: list[tuple[Opcode, bytes, bool]],
    code: CloseCode,
) -> None:
    with Browser(served.base, WATCH) as honest, Browser(served.base, WATCH) as rude:
        rude.word("welcome")
        frames = [Frame(opcode, data, fin).serialize(mask=True) for opcode, data, fin in pieces]
        with suppress(OSError):
            rude.socket.socket.sendall(b"".join(frames))
        # Where more comes than is read the network may forget the reason.
        assert ends_with(rude) in {code, CloseCode.ABNORMAL_CLOSURE}
        assert honest.frame(b"RSNP")
    assert not [record for record in caplog.records if record.name.startswith("uvicorn")]


@pytest.mark.parametrize(
    "more",
    ["X-More: y\r\n" * 200, "Content-Length: 5\r\n", f"X-Long: {'y' * 20_000}\r\n"],
    ids=["many headers", "a body", "a long header"],
)
def test_a_request_for_a_websocket_that_cannot_be_read_is_over_at_once(
    served: ServedRace, more: str
) -> None:
    with connected(served) as line:
        line.sendall(
            f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'A' * 22}==\r\n{more}\r\n".encode()
        )
        while line.recv(4096):  # a line that stays open ends this by its timeout
            pass


def connected(served: ServedRace) -> socket.socket:
    """Return a connection that has said nothing yet."""
    host, _, port = served.base.removeprefix("http://").removesuffix("/").partition(":")
    return socket.create_connection((host, int(port)), timeout=5.0)


def answers_to(served: ServedRace, data: bytes) -> list[bytes]:
    """Return the statuses of all answers until the gateway ends the connection."""
    with connected(served) as line:
        line.sendall(data)
        heard = b"".join(iter(lambda: line.recv(4096), b""))
    return re.findall(rb"HTTP/1.1 (\d+)", heard)


HEALTH = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@pytest.mark.parametrize(
    "head",
    [
        b"Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"Content-Length: 3\r\n\r\nabc",
        b"Transfer-Encoding:\r\n chunked\r\n\r\n0\r\n\r\n",
        b"X: a\nContent-Length: 0\r\n\r\n",
        b"X: a\r\n\tb\r\n\r\n",
    ],
    ids=["both", "chunked", "length", "folded", "bare LF", "folded by a tab"],
)
def test_a_request_that_two_programs_could_read_differently_is_refused_with_all_that_follows(
    served: ServedRace, head: bytes
) -> None:
    assert answers_to(served, HEALTH + head + HEALTH + b"\r\n") == [b"400"]
    last = HEALTH + b"Connection: close\r\n\r\n"
    assert answers_to(served, HEALTH + b"\r\n" + last) == [b"200", b"200"]


def test_idle_connections_make_room_for_a_request_and_the_oldest_ends_first(
    served: ServedRace,
) -> None:
    with ExitStack() as stack:
        small = stack.enter_context(gated(served.address, limits=GatewayLimits(connections=4)))
        browser = stack.enter_context(Browser(small.base, WATCH))
        browser.word("welcome")
        idle = [stack.enter_context(connected(small)) for _ in range(6)]
        assert ask(small, "healthz")[0] == 200
        assert [line.recv(1) for line in idle[:3]] == [b""] * 3
        idle[-1].sendall(HEALTH + b"\r\n")
        assert idle[-1].recv(12) == b"HTTP/1.1 200"
        assert browser.frame(b"RSNP")  # admitted, so it is none of them


def test_a_connection_without_a_whole_request_ends_soon(served: ServedRace) -> None:
    timing = GatewayTiming(first_request_s=0.2)
    with gated(served.address, timing=timing) as impatient:
        with connected(impatient) as silent, connected(impatient) as slow:
            slow.sendall(HEALTH)
            assert (silent.recv(1), slow.recv(1)) == (b"", b"")
        with connected(impatient) as patient:
            patient.sendall(HEALTH + b"\r\n")
            time.sleep(0.4)
            patient.sendall(HEALTH + b"Connection: close\r\n\r\n")
            heard = b"".join(iter(lambda: patient.recv(4096), b""))
        assert heard.count(b"HTTP/1.1 200") == 2


def test_a_word_for_coming_back_is_good_for_one_time(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        word = browser.word("welcome")["resume"]
    with Browser(served.base, {"resume": word}) as again:
        assert again.word("welcome")["resume"] != word
        with Browser(served.base, {"resume": word}) as thief:
            assert thief.refusal() == ("used", 4410)
        assert again.frame(b"RSNP")


def test_a_steward_shows_a_flag_and_reads_the_log(served: ServedRace) -> None:
    assert served.server is not None
    with Browser(served.base, STEWARD) as steward:
        assert "flag" in steward.word("welcome")["may"]
        steward.send({"type": "act", "act": "flag", "seat": -1, "value": 1, "id": 7})
        assert steward.word("acted") == {"type": "acted", "id": 7, "accepted": True, "reason": ""}
        assert steward.until(
            lambda message: (
                message[4:8] == b"RSNP" and decode_snapshot(message).flag is Flag.YELLOW
                if isinstance(message, bytes)
                else False
            )
        )
        steward.send({"type": "act", "act": "flag", "value": 0, "id": 8})
        assert steward.word("acted")["accepted"]
        steward.send({"type": "act", "act": "penalty", "seat": 1, "value": 1e5, "id": 9})
        assert "600 s" in steward.word("acted")["reason"]
        steward.send({"type": "act", "act": "explode", "id": 10})
        assert not steward.word("acted")["accepted"]
        steward.send({"type": "log"})
        assert "Eve: yellow flag" in steward.word("log")["lines"][0]


def test_a_spectator_cannot_act(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.send({"type": "act", "act": "flag", "value": 2, "id": 1})
        assert browser.refusal() == ("malformed", 4400)


def test_all_answers_carry_the_headers_that_keep_a_page_to_itself(served: ServedRace) -> None:
    for path, expected in (("", 200), ("healthz", 200), ("assets/none.js", 404), ("etc", 404)):
        status, headers, _ = ask(served, path)
        assert status == expected
        assert headers["content-security-policy"].startswith("default-src 'self';")
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
    assert "browsers" in ask(served, "healthz")[2]


def test_nobody_calls_a_local_gateway_by_a_foreign_name(served: ServedRace) -> None:
    assert ask(served, "recordings", Host="evil.example")[0] == 403
    assert ask(served, "recordings", Host="race.example")[0] == 200


def test_small_messages_wait_for_no_others(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.word("welcome")
        (admitted,) = served.state.browsers
        line = admitted.outbox.connection.transport.get_extra_info("socket")
        assert line.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


# Driving


def control(sequence: int, throttle: float = 0.3) -> bytes:
    return encode_control(ControlFrame(1, sequence, 1, Control(throttle=throttle)))


def start_driving(driver: Browser) -> None:
    driver.send({"type": "ready", "ready": True})
    assert driver.word("ready")["accepted"]
    driver.until(
        lambda h: isinstance(h, bytes) and h[4:8] == b"RHUD" and not decode_hud(h).lights_s
    )


def own_kart(browser: Browser, seat: int = 1) -> tuple[float, int]:
    """Return speed and the newest number that the server took, as of now."""
    while browser.receive(0.0) is not None:
        pass
    karts = decode_snapshot(browser.frame(b"RSNP")).karts
    row = karts[karts["seat"] == seat]
    return float(row["speed"][0]), int(row["acknowledged"][0])


def test_a_seat_is_driven_from_a_browser_until_the_hand_is_off_the_wheel(lobby: ServedRace) -> None:
    with Browser(lobby.base, {**DRIVE, "rate": 60}) as driver:
        welcome = driver.word("welcome")
        assert (welcome["seat"], welcome["sequence"]) == (1, 0)
        briefing = decode_welcome(driver.frame(b"RBRF"))
        assert (briefing.briefing.seat, briefing.secret) == (1, 0)
        start_driving(driver)
        for sequence in range(1, 41):
            driver.send(control(sequence))
            time.sleep(0.02)
        speed, acknowledged = own_kart(driver)
        assert speed > 0.1
        assert acknowledged >= 38
        assert driver.word("notice") == {"type": "notice", "code": "dead-man"} | {
            "reason": driver.words[-1]["reason"]
        }
        time.sleep(1.5)
        assert own_kart(driver)[0] < speed
        driver.send(control(20))  # a copy counts no more
        driver.send(control(41))
        assert driver.word("notice")["code"] == "driving"


def test_a_driver_is_not_disturbed_by_who_stole_its_words_and_comes_back_with_them() -> None:
    with lobby_with(GatewayTiming(stalled_s=STALLED_S)) as lobby:
        drive_with_a_thief(lobby)


def drive_with_a_thief(lobby: ServedRace) -> None:
    with Browser(lobby.base, DRIVE) as driver:
        word = driver.word("welcome")["resume"]
        for stolen in (DRIVE, {"role": "drive", "resume": word}):
            driver.send({"type": "ping", "t": 1})
            with Browser(lobby.base, stolen) as thief:
                assert thief.refusal() == ("used", 4410)
        driver.send({"type": "ping", "t": 2})
        assert driver.word("pong")
    with Browser(lobby.base, {"role": "drive", "resume": word}) as back:
        welcome = back.word("welcome")
        assert welcome["seat"] == 1
        # A page whose network has gone is replaced by one that shows its token.
        time.sleep(1.2 * STALLED_S)
        with Browser(lobby.base, {"role": "drive", "resume": welcome["resume"]}) as again:
            assert again.word("welcome")["seat"] == 1
            assert back.refusal() == ("used", 4410)
            again.send({"type": "leave"})
            while again.receive(2.0) is not None:
                pass
        assert again.socket.close_code == 1000
    assert lobby.server is not None
    assert not lobby.server.session.seats[1].is_taken


def test_damaged_and_too_many_controls_are_refused(lobby: ServedRace) -> None:
    for data, code in ((control(1, throttle=3.0), "malformed"), (bytes(300), "too-large")):
        with Browser(lobby.base, DRIVE) as driver:
            driver.word("welcome")
            driver.send(data)
            assert driver.refusal()[0] == code
    with Browser(lobby.base, DRIVE) as driver:
        driver.word("welcome")
        for sequence in range(1, 300):
            driver.send(control(sequence))
        assert driver.refusal() == ("too-fast", 4429)


def test_a_driver_whose_page_does_not_come_back_loses_its_seat() -> None:
    with lobby_with(GatewayTiming(seat_grace_s=0.2)) as lobby:
        assert lobby.server is not None
        seats = lobby.server.session.seats
        with Browser(lobby.base, DRIVE) as driver:
            driver.word("welcome")
            assert seats[1].is_taken
        deadline = time.monotonic() + 5.0
        while seats[1].is_taken and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not seats[1].is_taken


def test_a_driver_who_is_sent_away_is_told_so() -> None:
    with (
        lobby_with(GatewayTiming(hud_timeout_s=0.3)) as lobby,
        Browser(lobby.base, DRIVE) as driver,
        Browser(lobby.base, STEWARD) as steward,
    ):
        driver.word("welcome")
        steward.send({"type": "act", "act": "kick", "seat": 1, "id": 1})
        assert steward.word("acted")["accepted"]
        assert driver.refusal() == ("seat-lost", 4411)
        assert "closed" in driver.words[-1]["reason"]


# Servers that come and go


def test_browsers_wait_for_a_race_and_go_on_with_the_next_one() -> None:
    address = free_address()
    with gated(address) as served, Browser(served.base, WATCH) as browser:
        assert browser.word("notice")["code"] == "no-race"
        with Browser(served.base, DRIVE) as driver:
            assert driver.refusal() == ("no-race", 4503)
        for _ in range(2):
            with racing(address):
                assert browser.word("notice")["code"] == "race"
                assert browser.frame(b"RSNP")
            assert browser.word("notice")["code"] == "no-race"
        assert decode_course(next(f for f in browser.frames if f[4:8] == b"RCRS")).name == "ring"


def test_a_gateway_for_one_race_ends_with_it() -> None:
    address = free_address()
    with gated(address, once=True, timing=GatewayTiming(race_gone_s=0.3)) as served:
        with racing(address):
            wait_for_race(served)
        served.thread.join(10.0)
        assert not served.thread.is_alive()


def test_with_a_token_for_spectators_nobody_else_watches_or_reads_the_list() -> None:
    tokens = replace(TOKENS, spectate="watch one")
    with gated(free_address(), tokens=tokens) as served:
        with Browser(served.base, WATCH) as browser:
            assert browser.refusal() == ("token", 4401)
        with Browser(served.base, {**WATCH, "token": "watch one"}) as browser:
            browser.word("welcome")
        assert ask(served, "recordings")[0] == 401
        assert json.loads(ask(served, "recordings", Authorization="Bearer watch one")[2]) == []


def test_the_command_prints_addresses_and_ends_when_it_is_told_to() -> None:
    command = [sys.executable, "-m", "race_server", "gateway", "--connect", free_address()]
    command += ["--port", "0", "--drivers", "1", "--recordings", "none", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        addresses = json.loads(process.stdout.readline())
        assert addresses["watch"].endswith("/#watch")
        drive, _, token = addresses["drive"][0].partition("#drive&token=")
        with Browser(drive, {"role": "drive", "token": token}) as driver:
            assert driver.refusal()[0] == "no-race"
        process.terminate()
        assert process.wait(10.0) == 0


def test_a_gateway_never_imports_numba() -> None:
    code = (
        "import os, sys; os.environ['RACE_SERVER_INTERPRET'] = '1';"
        "import race_server.live.gateway.service, race_server.scenario.race;"
        "sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
