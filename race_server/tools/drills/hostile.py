"""Damaged and crafted messages for every decoder, and on every inbound topic while a race runs.

They are decoded here, by the decoders of server, clients, gateway, recordings and results, where
each is timed and every exception is seen. Then those of inbound topics go to a real server in the
middle of a race, whose ticks must stay on time and whose drivers must keep their seats. The process
that sends them there is `attacker`.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Phase
from race_server.errors import RaceError, Reason
from race_server.tools.drills.damage import Toll, decode_all
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import (
    Figures,
    excess_of_missed,
    milliseconds,
    quantile,
    server_process,
    ticks_between,
)

SMALL = SmallDrill("--messages 20000", 26, "sent")

TRACK, KARTS = "oval-report", 8
DRIVERS = ("pure_pursuit", "follow_gap", "avoider")
QUIET_S = 15.0  # of the same race before, as the baseline
WORST_MS = 1.0
MOST_GROWTH = 8_000_000  # bytes of memory, of a decoder's messages after its first ones
# Seats of the attacker: one with a simulated kart, one with a real kart.
INSIDERS = 2
# Time of the attack in which an honest driver had no fresh control: some is normal.
SILENT_SHARE = 0.05
# Refusals that the attack must have caused, or it did not arrive.
MUST_MEET = (Reason.CONTROL_BADGE, Reason.POSE_BADGE)


def drill_hostile(
    messages: int, *, rate: int, seed: int = 1, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Send hostile messages to a racing server at `rate` a second and return the figures."""
    tolls = decode_all(messages, seed)
    faults = [fault for toll in tolls for fault in _faults_of(toll)]
    document: dict[str, Any] = {
        "decoded": sum(toll.decoded for toll in tolls),
        "accepted": sum(toll.accepted for toll in tolls),
        "worst_decode_ms": max(toll.worst_ns for toll in tolls) / 1e6,
        "decoders": [toll.as_row() for toll in tolls],
        "messages": messages,
        "rate": rate,
    }
    try:
        document |= _attack(messages, rate, seed, faults, tell)
    except RaceError as error:
        faults.append(str(error))
    return document_of(faults, **document, seed=seed)


def _faults_of(toll: Toll) -> Iterator[str]:
    """Yield what is wrong with how a decoder took its messages."""
    if foreign := set(toll.errors) - {toll.refuses}:
        yield f"{toll.decoder} raises {', '.join(sorted(foreign))}, not only {toll.refuses}"
    if toll.worst_ns > WORST_MS * 1e6:
        yield f"{toll.decoder} takes {toll.worst_ns / 1e6:.2f} ms, {WORST_MS:g} ms are allowed"
    if toll.growth_bytes > MOST_GROWTH:
        yield f"{toll.decoder} keeps {toll.growth_bytes / 1e6:.1f} MB"


def _attack(
    messages: int, rate: int, seed: int, faults: list[str], tell: Callable[[int], None]
) -> dict[str, Any]:
    """Attack a race and return its figures; append what is wrong to `faults`."""
    words = ["--track", TRACK, "--karts", str(KARTS + INSIDERS), "--laps", "1000"]
    with server_process([*words, "--record", "none"]) as place:
        for seat in range(KARTS):
            place.drive(DRIVERS[seat % len(DRIVERS)], seat)
        command = [sys.executable, "-m", "race_server.tools.drills.attacker", place.address]
        command += [str(number) for number in (messages, rate, seed, KARTS)]
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
    unmet = [reason for reason in MUST_MEET if not document["refused"].get(reason)]
    faults += [f"nothing was refused as {reason}: the attack did not arrive" for reason in unmet]
    return _compare(before, middle, after, faults) | {
        "sent": sent,
        "laps": sum(kart["laps"] for kart in document["karts"]),
        "refused": document["refused"],
    }


def _release(attacker: subprocess.Popen[str], tell: Callable[[int], None]) -> int:
    """Start the attacker and return the number of messages that it sent."""
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
    quiet, quiet_missed = ticks_between(before, middle)
    ticks, missed = ticks_between(middle, after)
    if excess := excess_of_missed((before, middle), (middle, after)):
        faults.append(excess)
    silent = _silent_s(middle, after)
    if silent > SILENT_SHARE * ticks / TICKS_PER_SECOND:
        faults.append(f"a driver had no fresh control for {silent:.1f} s: its seat was disturbed")
    name = "race_tick_duration_seconds"
    return {
        "silent_s_worst": round(silent, 2),
        "ticks": round(ticks),
        "missed_ticks": round(missed),
        "quiet_ticks": round(quiet),
        "quiet_missed_ticks": round(quiet_missed),
        "tick_p99_ms": milliseconds(quantile(middle, after, name, 0.99)),
        "quiet_tick_p99_ms": milliseconds(quantile(before, middle, name, 0.99)),
        "server_memory_mb": round(after["process_resident_memory_bytes"] / 1e6, 1),
    }


def _silent_s(before: Figures, after: Figures) -> float:
    """Return the longest time without a fresh control of an honest driver [s]."""
    names = [f'race_silent_seconds_total{{seat="{seat}"}}' for seat in range(KARTS)]
    return max(after.get(name, 0.0) - before.get(name, 0.0) for name in names)
