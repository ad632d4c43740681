"""Damaged and crafted messages on every inbound topic, while a race runs.

They are decoded twice: here, where each can be timed and every exception seen, and by a real
server in the middle of a race, whose clock must not notice. There they come from an outsider who
holds no seat and from an insider who does. Who may speak for a seat at all is another question:
what the outsider sends is never a whole control of this very race, which might be taken for the
driver's own.
"""

import random
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import zenoh

from race_server.drills.damage import Inbound, decode_all, inbound, mutated
from race_server.drills.damage import crafted as crafted_for
from race_server.drills.hall import SESSION, Figures, hall, milliseconds, quantile
from race_server.errors import LinkError, RaceError, WireError
from race_server.messages import Control, Phase
from race_server.seat import take_seat
from race_server.start import START_S
from race_server.transport import ClientLink
from race_server.wire import topics
from race_server.wire.drive import ControlFrame, decode_control, encode_control
from race_server.wire.lobby import Join
from race_server.wire.topics import key_of

TRACK, KARTS = "oval-report", 8
DRIVERS = ("pure_pursuit", "follow_gap", "avoider")
QUIET_S = 15.0  # of the same race before, as the yardstick
WORST_MS = 1.0
# Missed ticks that any machine with other work has now and then; the quiet part may show none.
SPARE = 0.001
# Who holds a seat and misuses it.
INSIDER = KARTS
# Of so many messages one is a request, one is empty, and one goes with a liveliness token.
ASK_EVERY, EMPTY_EVERY, TOKEN_EVERY = 10, 200, 500
FOREIGN_EPOCH = 0x40000000


def drill_hostile(
    messages: int, *, rate: int, seed: int = 1, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Send so many hostile messages to a racing server, so many a second; return the figures."""
    toll = decode_all(messages, seed)
    worst_ms = toll.worst_ns / 1e6
    faults = []
    if foreign := set(toll.errors) - {"WireError"}:
        faults.append(f"decoders raise {', '.join(sorted(foreign))}")
    if worst_ms > WORST_MS:
        faults.append(f"the slowest decode takes {worst_ms:.2f} ms, {WORST_MS:g} ms are allowed")
    document: dict[str, Any] = {
        "decoded": toll.decoded,
        "accepted": toll.accepted,
        "exceptions": dict(toll.errors),
        "worst_decode_ms": round(worst_ms, 4),
        "messages": messages,
        "rate": rate,
    }
    try:
        document |= _attack(messages, rate, seed, faults, tell)
    except RaceError as error:
        faults.append(str(error))
    return {"ok": not faults, "why": "; ".join(faults), **document, "seed": seed}


def _attack(
    messages: int, rate: int, seed: int, faults: list[str], tell: Callable[[int], None]
) -> dict[str, Any]:
    """Attack a race and return what became of it; what should not be goes into `faults`."""
    words = ["--track", TRACK, "--karts", str(KARTS + 1), "--laps", "1000"]
    with hall([*words, "--record", "none"]) as place:
        for seat in range(KARTS):
            place.drive(DRIVERS[seat % len(DRIVERS)], seat)
        command = [sys.executable, "-m", "race_server.drills.hostile", place.address]
        command += [str(messages), str(rate), str(seed)]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as attacker:
            try:
                place.wait_for(Phase.RUNNING)
                before = place.figures()
                time.sleep(QUIET_S)
                middle = place.figures()
                sent = _release(attacker, tell)
                after = place.figures()
            finally:
                attacker.kill()
        document = place.stop()
        said = place.text()
    if "Traceback" in said or "callback error" in said:
        faults.append("the server or a driver has printed an exception")
    return _compare(before, middle, after, faults) | {
        "sent": sent,
        "laps": sum(kart["laps"] for kart in document["karts"]),
        "refused": document["refused"],
    }


def _release(attacker: subprocess.Popen[str], tell: Callable[[int], None]) -> int:
    """Let the attacker begin and return how many messages it has sent in the end."""
    assert attacker.stdin is not None
    assert attacker.stdout is not None
    attacker.stdin.write("go\n")
    attacker.stdin.flush()
    sent = 0
    for line in attacker.stdout:
        sent = int(line)
        tell(sent)
    return sent


def _compare(before: Figures, middle: Figures, after: Figures, faults: list[str]) -> dict[str, Any]:
    quiet, quiet_missed = _ticks(before, middle)
    ticks, missed = _ticks(middle, after)
    allowed = (quiet_missed / max(quiet, 1.0) + SPARE) * ticks
    if missed > allowed:
        faults.append(f"{missed:.0f} of {ticks:.0f} ticks were missed, {allowed:.0f} are allowed")
    name = "race_tick_duration_seconds"
    return {
        "ticks": round(ticks),
        "missed_ticks": round(missed),
        "quiet_ticks": round(quiet),
        "quiet_missed_ticks": round(quiet_missed),
        "tick_p99_ms": milliseconds(quantile(middle, after, name, 0.99)),
        "quiet_tick_p99_ms": milliseconds(quantile(before, middle, name, 0.99)),
        "server_memory_mb": round(after["process_resident_memory_bytes"] / 1e6, 1),
    }


def _ticks(before: Figures, after: Figures) -> tuple[float, float]:
    driven, missed = "race_ticks_total", "race_ticks_missed_total"
    return after[driven] - before[driven], after[missed] - before[missed]


# The attacker, a process of its own


def attack(address: str, messages: int, rate: int, seed: int) -> None:
    """Take a seat, wait for a word on stdin, and send hostile messages; says how many so far."""
    deadline = time.monotonic() + START_S
    while True:
        try:
            link = ClientLink(address, SESSION, timeout_s=1.0)
            seat = take_seat(link, Join("mallory", "track", INSIDER))
            break
        except LinkError:
            if time.monotonic() > deadline:
                raise
    seat.act(topics.READY)
    sys.stdin.readline()
    with link, zenoh.open(_plain_config(address)) as outside:
        own = Inbound(topics.CONTROL, _control_of(seat.welcome.epoch + 1), decode_control)
        puts = [*_puts(outside, seat.welcome.epoch + 1), (own, seat.send)]
        asks = list(_asks(outside))
        _send_all(puts, asks, outside, messages, rate, random.Random(seed))


def _plain_config(address: str) -> zenoh.Config:
    """Return what anybody would connect with who has read zenoh's manual."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{address}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return config


Way = tuple[Inbound, Callable[[bytes], None]]


def _control_of(epoch: int) -> bytes:
    return encode_control(ControlFrame(epoch, 1, 1, Control(0.2, 0.2)))


def _puts(outside: zenoh.Session, epoch: int) -> Iterator[Way]:
    """Yield how an outsider can send to each seat. epoch: that of the race."""
    kind = Inbound(topics.CONTROL, _control_of(FOREIGN_EPOCH), decode_control)
    for seat in range(KARTS):
        put = outside.declare_publisher(key_of(kind.topic, SESSION, seat)).put
        yield kind, partial(_put_foreign, put, epoch)


def _put_foreign(put: Callable[[bytes], None], epoch: int, message: bytes) -> None:
    """Send a message unless damage has made it a control of the race."""
    try:
        put(message if decode_control(message).epoch != epoch else b"")
    except WireError:
        put(message)


def _asks(outside: zenoh.Session) -> Iterator[Way]:
    """Yield how anybody can make requests."""
    for kind in inbound():
        if kind.topic in topics.QUERIES:
            yield kind, _asker(outside, key_of(kind.topic, SESSION, 0))
    for topic in (topics.COURSE, topics.RULES, topics.RECENT, topics.TABLE):
        # These carry nothing, so anything is too much.
        yield Inbound(topic, bytes(64), bytes), _asker(outside, key_of(topic, SESSION))


def _asker(outside: zenoh.Session, key: str) -> Callable[[bytes], None]:
    def ask(message: bytes) -> None:
        outside.get(key, _ignore, payload=message or None, timeout=1.0)

    return ask


def _ignore(_reply: zenoh.Reply) -> None:
    """Nobody waits for the answer."""


def _send_all(
    puts: list[Way],
    asks: list[Way],
    outside: zenoh.Session,
    messages: int,
    rate: int,
    chance: random.Random,
) -> None:
    kinds = [kind for kind, _ in (*puts, *asks) if kind.topic.most_bytes]
    special = {id(kind): list(crafted_for(kind)) for kind in kinds}
    begun, told = time.monotonic(), 0.0
    for number in range(messages):
        kind, send = chance.choice(asks if number % ASK_EVERY == 0 else puts)
        prepared = special.get(id(kind))
        if number % EMPTY_EVERY == 0:
            message = b""
        elif prepared and chance.random() < 0.1:
            message = chance.choice(prepared)
        else:
            message = mutated(kind.sample, chance)
        if number % TOKEN_EVERY == 0:
            _show_token(outside, chance)
        send(message)
        now = time.monotonic()
        if now - told > 0.5:
            told = now
            print(number + 1, flush=True)
        ahead = begun + number / rate - now
        if ahead > 0.002:
            time.sleep(ahead)
    print(messages, flush=True)


def _show_token(outside: zenoh.Session, chance: random.Random) -> None:
    """Show a token of the insider's seat or of one that cannot be, and take it away."""
    seat = chance.choice((INSIDER, 4_000_000_000, -2))
    key = key_of(topics.ALIVE, SESSION, seat).replace("*", "x")
    outside.liveliness().declare_token(key).undeclare()


if __name__ == "__main__":
    attack(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
