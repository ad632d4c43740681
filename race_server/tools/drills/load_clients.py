"""Many drivers and spectators in few processes, over zenoh: each has a separate session.

The process prints ``ready``, starts to count at the line ``mark`` on stdin, and prints its figures
at ``end``.
"""

import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from race_server.competition.launch import START_S
from race_server.core.messages import Control
from race_server.core.observation import Layout
from race_server.errors import LinkError, WireError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.net.wire.spectate import decode_snapshot
from race_server.tools.drills.server_process import SESSION

POLL_S = 0.004
THROTTLE = 0.15


def pilot(layout: Layout, values: Sequence[float]) -> Control:
    """Return a control that keeps a kart near the centre line; it takes hardly any time."""
    offset = values[layout.slices["lateral_offset"].start]
    error = values[layout.slices["heading_error"].start]
    steering = min(max(-0.6 * offset - 1.2 * error, -1.0), 1.0)
    return Control(steering=steering, throttle=THROTTLE)


class Stopwatch:
    """Times from sending a control to the first snapshot that shows it."""

    def __init__(self) -> None:
        """Start without times."""
        self._sent: dict[tuple[int, int], float] = {}
        self._delays: list[float] = []

    def mark(self) -> None:
        """Discard the times so far."""
        self._delays.clear()

    def sent(self, seat: int, sequence: int) -> None:
        """Record that a control is sent now."""
        self._sent[seat, sequence] = time.perf_counter()

    def shown(self, seat: int, sequence: int) -> None:
        """Record that a snapshot acknowledges a control."""
        begun = self._sent.pop((seat, sequence), None)
        if begun is not None:
            self._delays.append(time.perf_counter() - begun)

    def figures(self) -> dict[str, Any]:
        """Return median and 99th percentile [ms]."""
        delays = 1e3 * np.array(self._delays or [0.0])
        return {
            "input_to_effect_p50_ms": round(float(np.median(delays)), 2),
            "input_to_effect_p99_ms": round(float(np.percentile(delays, 99)), 2),
            "inputs_timed": len(self._delays),
        }


def connect(address: str) -> ClientLink:
    """Return a link as soon as the server answers."""
    return insist(partial(ClientLink, address, SESSION, timeout_s=1.0), time.monotonic() + START_S)


def drive_all(address: str, karts: int) -> None:
    """Drive all karts of a race."""
    watch, seats = Stopwatch(), []
    for number in range(karts):
        link = connect(address)
        ask = partial(take_seat, link, Join(f"driver {number}", "track", number))
        seats.append(insist(ask, time.monotonic() + START_S))
    spectator = connect(address)
    spectator.listen(topics.SNAPSHOT, partial(_note_snapshot, watch))
    for seat in seats:
        seat.act(topics.READY)
    ended = command(watch.mark)
    sequences = [0] * karts
    while not ended.is_set():
        for number, seat in enumerate(seats):
            sequences[number] = _answer(seat, sequences[number], watch)
        time.sleep(POLL_S)
    print(json.dumps(watch.figures()), flush=True)
    for seat in seats:
        seat.link.close()
    spectator.close()


def _answer(seat: ClientSeat, sequence: int, watch: Stopwatch) -> int:
    frame = seat.receive(0.0)
    if frame is None:
        return sequence
    sequence = max(sequence, frame.acknowledged) + 1
    watch.sent(seat.number, sequence)
    seat.answer(frame.epoch, sequence, frame.tick, pilot(seat.layout, frame.values.tolist()))
    return sequence


def _note_snapshot(watch: Stopwatch, data: bytes) -> None:
    try:
        karts = decode_snapshot(data).karts
    except WireError:
        return
    for seat, sequence in zip(karts["seat"].tolist(), karts["acknowledged"].tolist(), strict=True):
        watch.shown(seat, sequence)


def watch_all(address: str, spectators: int) -> None:
    """Watch a race as many spectators."""
    heard = [0] * spectators

    def count(place: int, _data: bytes) -> None:
        heard[place] += 1

    links = [connect(address) for _ in range(spectators)]
    for place, link in enumerate(links):
        link.listen(topics.SNAPSHOT, partial(count, place))
    before: list[int] = heard.copy()

    def mark() -> None:
        before[:] = heard

    command(mark).wait()
    print(json.dumps(heard_between(before, heard)), flush=True)
    for link in links:
        link.close()


def heard_between(before: Sequence[int], after: Sequence[int]) -> dict[str, Any]:
    """Return the mean and the least number of snapshots that a spectator received."""
    heard = [b - a for a, b in zip(before, after, strict=True)] or [0]
    return {"heard_mean": round(sum(heard) / len(heard), 1), "heard_least": min(heard)}


def command(mark: Callable[[], None]) -> threading.Event:
    """Print ``ready`` and take commands on stdin; the event is set at ``end``."""
    ended = threading.Event()

    def obey() -> None:
        for line in sys.stdin:
            if line.strip() == "mark":
                mark()
            else:
                break
        ended.set()

    threading.Thread(target=obey, daemon=True).start()
    print("ready", flush=True)
    return ended


if __name__ == "__main__":
    try:
        {"drivers": drive_all, "spectators": watch_all}[sys.argv[1]](sys.argv[2], int(sys.argv[3]))
    except LinkError as error:
        sys.exit(f"error: {error}")
