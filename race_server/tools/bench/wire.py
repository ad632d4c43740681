"""Encoding and decoding of messages, and the latency from control to effect over loopback."""

import os
import subprocess
import sys
import threading
import time
import timeit
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.messages import Button, Control, Flag, Phase
from race_server.live.server import RaceServer
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.drive import ControlFrame, decode_control, encode_control
from race_server.net.wire.lobby import Join
from race_server.net.wire.spectate import (
    HAZARD,
    KART,
    SnapshotFrame,
    SnapshotWriter,
    build_snapshot,
    decode_snapshot,
)
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from race_server.session.session import Session

COURSE = "covapsy-test-2023"


def bench_wire(*, seconds: float = 10.0) -> dict[str, Any]:
    """Return the figures of `race bench wire`."""
    return {**codec_times(), "latency": {str(n): latency(n, seconds) for n in (8, 64)}}


def codec_times() -> dict[str, float]:
    """Return microseconds to write a snapshot of 64 karts and to read 64 controls, one by one."""
    frame = SnapshotFrame(
        1, 1, 1, 0.0, Phase.RUNNING, Flag.GREEN, np.zeros(64, KART), np.ones(16, np.uint8),
        np.zeros(4, HAZARD),
    )  # fmt: skip
    writer = SnapshotWriter()
    snapshot = writer.write(frame)
    control = ControlFrame(1, 1, 1, Control(0.5, 0.5, 0.0, Button.USE_ITEM))
    message = encode_control(control)

    def read_all() -> None:
        for _ in range(64):
            decode_control(message)

    return {
        "encode_us": _microseconds(lambda: writer.write(frame)),
        "decode_us": _microseconds(lambda: decode_control(message)),
        "decode_64_inputs_us": _microseconds(read_all),
        "decode_snapshot_us": _microseconds(lambda: decode_snapshot(snapshot)),
        "encode_generated_us": _microseconds(lambda: build_snapshot(frame)),
    }


def _microseconds(call: Any) -> float:
    number = max(int(0.02 / max(timeit.timeit(call, number=3) / 3, 1e-7)), 1)
    return round(min(timeit.repeat(call, number=number, repeat=7)) / number * 1e6, 2)


@dataclass
class Probe:
    """Times of one client: when it sent each control, and when a snapshot acknowledged it."""

    sent: dict[int, float]
    delays: list[float]


def latency(karts: int, seconds: float) -> dict[str, Any]:
    """Return how long a control takes until a snapshot acknowledges it, with `karts` drivers.

    A separate process plays all drivers, each with its own session, at 60 controls a second.
    """
    course = load_course(COURSE)
    scenario = Scenario(course, karts=karts, rules=Rules(laps=0, countdown_s=0.0, limit_s=seconds))
    session = Session("bench", scenario)
    session.join("nobody", "track")
    session.start()
    session.observe()
    session.advance(1)
    session = Session("bench", replace(scenario))
    address = f"tcp/127.0.0.1:{17000 + os.getpid() % 20000}"
    with ServerLink(address, "bench", karts, real_time=True) as link:
        command = [sys.executable, "-m", "race_server.tools.bench.wire", address, str(karts)]
        clients = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            server = RaceServer(session, link)
            server.lobby.wait_for(karts)
            begun, cpu = time.perf_counter(), time.process_time()
            result = server.race()
            spent = (time.process_time() - cpu) / (time.perf_counter() - begun)
            output, _ = clients.communicate(timeout=30.0)
        finally:
            clients.kill()
    p50, p99, worst, count = (float(word) for word in output.split())
    return {
        "p50_ms": round(p50, 2),
        "p99_ms": round(p99, 2),
        "max_ms": round(worst, 2),
        "samples": int(count),
        "server_cpu": round(spent, 3),
        "missed_ticks": result.missed_ticks,
        "ticks": result.ticks,
    }


class LatencyClient:
    """One of the clients: sends a control each tick, and times its acknowledgement."""

    def __init__(self, address: str, seat: int) -> None:
        """Take a seat and get ready."""
        from race_server.live.client.seat import take_seat

        self.link = ClientLink(address, "bench", timeout_s=30.0)
        self.seat = take_seat(self.link, Join(f"probe {seat}", "track", seat))
        self.send = self.seat.send
        self.probe = Probe({}, [])
        self.epoch = self.tick = self.sequence = 0
        self.phase = Phase.LOBBY
        self.lock = threading.Lock()

    def hear(self, data: bytes) -> None:
        """Record when the newest snapshot acknowledges a control."""
        now = time.perf_counter()
        frame = decode_snapshot(data)
        self.epoch, self.tick, self.phase = frame.epoch, frame.tick, frame.phase
        rows = frame.karts[frame.karts["seat"] == self.seat.number]
        with self.lock:
            if len(rows):
                begun = self.probe.sent.pop(int(rows["acknowledged"][0]), None)
                if begun is not None:
                    self.probe.delays.append(now - begun)

    def beat(self) -> None:
        """Send the next control."""
        self.sequence += 1
        control = ControlFrame(self.epoch, self.sequence, self.tick, Control(throttle=0.2))
        with self.lock:
            self.probe.sent[self.sequence] = time.perf_counter()
        self.send(encode_control(control))


def clients(address: str, karts: int) -> None:
    """Play all drivers; eight of them watch the snapshots. Prints p50, p99, max [ms] and count."""
    drivers = [LatencyClient(address, seat) for seat in range(karts)]
    watchers = drivers[:: max(karts // 8, 1)]
    for driver in watchers:
        driver.link.listen(topics.SNAPSHOT, driver.hear)
    for driver in drivers:
        driver.seat.act(topics.READY)
    leader = drivers[0]
    while leader.phase is Phase.LOBBY:
        time.sleep(0.005)
    turn = 0
    start = time.perf_counter()
    while leader.phase is not Phase.FINISHED:
        for number, driver in enumerate(drivers):
            # Spread over the tick, as independent clients would be.
            due = start + TICK_S * (turn + number / karts)
            wait = due - time.perf_counter()
            if wait > 0.0:
                time.sleep(wait)
            driver.epoch, driver.tick = leader.epoch, leader.tick
            driver.beat()
        turn += 1
    delays = np.array([d for driver in watchers for d in driver.probe.delays]) * 1e3
    print(np.median(delays), np.percentile(delays, 99), delays.max(), len(delays))
    for driver in drivers:
        driver.link.close()


if __name__ == "__main__":
    clients(sys.argv[1], int(sys.argv[2]))
