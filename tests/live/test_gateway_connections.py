"""Connections to a gateway: what is no request, what browsers never send, and who makes room."""

import re
import socket
import time
from contextlib import ExitStack, suppress

import pytest
from websockets.frames import CloseCode, Frame, Opcode

from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from support.browsers import WATCH, Browser
from support.served_race import ServedRace, ask, gated

pytestmark = pytest.mark.live

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("private_folders")]


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


def test_a_token_that_is_no_text_is_malformed(served: ServedRace) -> None:
    for role in ("drive", "steward"):
        with Browser(served.base, f'{{"role": "{role}", "token": "\\ud800"}}') as rude:
            assert rude.refusal() == ("malformed", 4400)


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


def test_small_messages_wait_for_no_others(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.word("welcome")
        (admitted,) = served.state.browsers
        line = admitted.outbox.connection.transport.get_extra_info("socket")
        assert line.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
