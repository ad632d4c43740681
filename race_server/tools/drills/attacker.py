"""A process that floods a racing server with damaged, crafted and forged messages.

It plays three parts at once: an outsider without a seat, with invented badges; an insider with a
seat and its true badge, who sends controls; and an insider with a real kart, who sends poses. The
outsider's controls and poses may be valid ones of the present race: without the badge none of them
may count.
"""

import random
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import zenoh

from race_server.competition.launch import START_S
from race_server.core.alert import Alert, Danger, DangerStage
from race_server.core.messages import Control, Pose
from race_server.core.telemetry import Telemetry
from race_server.credentials import badge_of
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertFrame, decode_alert, encode_alert
from race_server.net.wire.drive import ControlFrame, decode_control, encode_control
from race_server.net.wire.lobby import Join
from race_server.net.wire.pose import PoseFrame, decode_pose, encode_pose
from race_server.net.wire.telemetry import TelemetryFrame, decode_telemetry, encode_telemetry
from race_server.net.wire.topics import key_of
from race_server.tools.drills.damage import crafted, mutated
from race_server.tools.drills.decoders import Inbound, inbound
from race_server.tools.drills.server_process import SESSION

# Of this many messages one is a request, one is empty, and one comes with a liveliness token.
ASK_EVERY, EMPTY_EVERY, TOKEN_EVERY = 10, 200, 500
# A share of the messages is left whole, a share is crafted, the others are damaged.
WHOLE, CRAFTED = 0.1, 0.1
# Sent with a forged message: no badge, malformed badges, and badges of no seat.
FALSE_BADGES = (b"", b"\0", b"0" * 32, b"\xff" * 60, badge_of(1).encode(), badge_of(2).encode())


@dataclass(frozen=True)
class Way:
    """A kind of message, and how it is sent."""

    kind: Inbound
    send: Callable[[bytes], object]


def attack(address: str, messages: int, rate: int, seed: int, honest: int) -> None:
    """Take two seats, wait for a line on stdin, and send messages; prints how many so far.

    honest: number of seats of honest drivers; the attacker's seats follow them.
    """
    insiders = [_take(address, honest, tracked=False), _take(address, honest + 1, tracked=True)]
    for insider in insiders:
        insider.act(topics.READY)
    sys.stdin.readline()
    chance = random.Random(seed)
    epoch = insiders[0].welcome.epoch + 1
    control, pose = _control_of(epoch), _pose_of(epoch)
    alert, told = _alert_of(epoch), _telemetry_of(epoch)
    with zenoh.open(_plain_config(address)) as outside:
        puts = [
            *_forgeries(outside, control, range(honest), chance),
            # Poses are received only for the seat of a real kart, which is the second insider's.
            *_forgeries(outside, pose, range(honest + 2), chance),
            *(Way(kind, insiders[0].send) for kind in (control, pose)),
            *(Way(kind, insiders[1].send) for kind in (pose, control)),
            *_forgeries(outside, alert, range(honest + 2), chance),
            Way(alert, insiders[1].sender(topics.ALERT)),
            *_forgeries(outside, told, range(honest + 2), chance),
            Way(told, insiders[1].sender(topics.TELEMETRY)),
        ]
        _send_all(puts, list(_asks(outside)), outside, messages, rate, chance)
    for insider in insiders:
        insider.link.close()


def _take(address: str, number: int, *, tracked: bool) -> ClientSeat:
    deadline = time.monotonic() + START_S
    link = insist(partial(ClientLink, address, SESSION, timeout_s=1.0), deadline)
    join = Join(f"mallory {number}", "track", number, tracked=tracked)
    return insist(partial(take_seat, link, join), deadline)


def _plain_config(address: str) -> zenoh.Config:
    """Return the plain zenoh configuration of a client without keys."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{address}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return config


def _control_of(epoch: int) -> Inbound:
    control = encode_control(ControlFrame(epoch, 1 << 30, 1, Control(0.2, 0.2)))
    return Inbound(topics.CONTROL, control, decode_control)


def _pose_of(epoch: int) -> Inbound:
    pose = encode_pose(PoseFrame(epoch, 1 << 30, 0, Pose(1, 1.0, 1.0, 0.5, 2.0)))
    return Inbound(topics.POSE, pose, decode_pose)


def _telemetry_of(epoch: int) -> Inbound:
    told = encode_telemetry(TelemetryFrame(epoch, 1 << 30, Telemetry(1)))
    return Inbound(topics.TELEMETRY, told, decode_telemetry)


def _alert_of(epoch: int) -> Inbound:
    alert = encode_alert(AlertFrame(epoch, 1 << 30, Alert(1, Danger(DangerStage.FULL))))
    return Inbound(topics.ALERT, alert, decode_alert)


def _forgeries(
    outside: zenoh.Session, kind: Inbound, seats: Iterable[int], chance: random.Random
) -> Iterator[Way]:
    """Yield the messages by which an outsider can impersonate each of some seats."""
    for seat in seats:
        put = outside.declare_publisher(key_of(kind.topic, SESSION, seat)).put
        yield Way(kind, partial(_put_forged, put, chance))


def _put_forged(put: Callable[..., None], chance: random.Random, message: bytes) -> None:
    put(message, attachment=chance.choice(FALSE_BADGES))


def _asks(outside: zenoh.Session) -> Iterator[Way]:
    """Yield the requests that any client can send."""
    for kind in inbound():
        if kind.topic in topics.QUERIES:
            yield Way(kind, _asker(outside, key_of(kind.topic, SESSION, 0)))
    for topic in (topics.COURSE, topics.RULES, topics.RECENT, topics.TABLE):
        # These carry no payload, so any payload is too large.
        yield Way(Inbound(topic, bytes(64), bytes), _asker(outside, key_of(topic, SESSION)))


def _asker(outside: zenoh.Session, key: str) -> Callable[[bytes], None]:
    def ask(message: bytes) -> None:
        outside.get(key, _ignore, payload=message or None, timeout=1.0)

    return ask


def _ignore(_reply: zenoh.Reply) -> None:
    """Ignore the answer."""


def _send_all(
    puts: list[Way],
    asks: list[Way],
    outside: zenoh.Session,
    messages: int,
    rate: int,
    chance: random.Random,
) -> None:
    special = {
        way.kind.topic.key: list(crafted(way.kind.decoder))
        for way in (*puts, *asks)
        if way.kind.topic.most_bytes
    }
    begun, told = time.monotonic(), 0.0
    for number in range(messages):
        way = chance.choice(asks if number % ASK_EVERY == 0 else puts)
        empty = number % EMPTY_EVERY == 0
        message = b"" if empty else _message(way.kind, special, chance)
        if number % TOKEN_EVERY == 0:
            _show_token(outside, chance)
        way.send(message)
        now = time.monotonic()
        if now - told > 0.5:
            told = now
            print(number + 1, flush=True)
        ahead = begun + number / rate - now
        if ahead > 0.002:
            time.sleep(ahead)
    print(messages, flush=True)


def _message(kind: Inbound, special: dict[str, list[bytes]], chance: random.Random) -> bytes:
    draw, prepared = chance.random(), special.get(kind.topic.key)
    if draw < WHOLE:
        return kind.sample
    if prepared and draw < WHOLE + CRAFTED:
        return chance.choice(prepared)
    return mutated(kind.sample, chance)


def _show_token(outside: zenoh.Session, chance: random.Random) -> None:
    """Declare and undeclare a token with a false badge, of another seat or an impossible one."""
    seat = chance.choice((0, 1, 4_000_000_000, -2))
    badge = chance.choice(("x", "0" * 32, badge_of(1)))
    key = key_of(topics.ALIVE, SESSION, seat, badge)
    outside.liveliness().declare_token(key).undeclare()


if __name__ == "__main__":
    attack(sys.argv[1], *(int(word) for word in sys.argv[2:6]))
