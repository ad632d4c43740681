"""Encode and decode how real karts are: up from one kart, and out of all of them."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import flatbuffers
import numpy as np

from race_server.core.alert import Cause, DangerStage
from race_server.core.messages import Source
from race_server.core.telemetry import Health, Sensor, SensorState, Telemetry
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Telemetry as TelemetryStruct
from race_server.net.wire.generated.drive import TelemetryMessage
from race_server.net.wire.generated.spectate import KartTelemetry, Telemetries
from race_server.net.wire.rows import build_rows
from race_server.net.wire.strict import U32, root_of

TELEMETRY = struct.Struct("<QII8fI3B1x")
ROW = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "heading", "speed", "deviation")),
        *((name, "<f4") for name in ("heading_deviation", "link", "battery")),
        ("sensors", "<u4"),
        ("seat", "<u2"),
        *((name, "u1") for name in ("stage", "cause", "source")),
        ("", "V3"),  # pads to a multiple of four
    ]
)
NAMES = list(ROW.names or ())[:-1]  # without what pads
# Beyond any course, kart and race.
_HIGHEST = (1e5, 1e5, 2.0 * math.pi, 200.0, 1e5, 1e3, 1e6, 1.0)
_EVERY_CAUSE = int(~Cause.NONE)
LEAST = 0.001  # [m]: a deviation of 0 says that the place is not known
BITS, MOST_KARTS = 4, 64

Numbers = tuple[float, ...]  # eight of them, the sensors, and three codes


@dataclass(frozen=True, slots=True)
class TelemetryFrame:
    """The telemetry of one kart with its epoch and sequence."""

    epoch: int
    sequence: int
    telemetry: Telemetry


@dataclass(frozen=True, slots=True)
class TelemetriesFrame:
    """How all real karts are, by seat."""

    epoch: int
    tick: int
    karts: Mapping[int, Telemetry]  # their stamps are not sent


def _numbers(told: Telemetry) -> tuple[Numbers, int, tuple[int, int, int]]:
    """Return what is sent: numbers, sensors, codes; what is not known as 0 or below."""
    health = told.health
    deviation = 0.0 if told.deviation is None else max(told.deviation, LEAST)
    limits = _HIGHEST[4:7]
    link = -1.0 if health.link_s is None else health.link_s
    most = (
        min(value, high)
        for value, high in zip((deviation, health.heading_deviation, link), limits, strict=True)
    )
    battery = -1.0 if health.battery is None else health.battery
    numbers = (told.x, told.y, told.heading, told.speed, *most, battery)
    sensors = sum(int(state) << BITS * sensor for sensor, state in enumerate(health.sensors))
    return numbers, sensors, (int(told.stage), int(told.cause), int(told.source))


def _telemetry_of(stamp_us: int, numbers: Numbers, sensors: int, codes: Numbers) -> Telemetry:
    """Return what some numbers tell.

    Raises:
        WireError: not finite, out of range, or a code that is unknown.
    """
    # Comparisons with NaN are false, so NaN is refused here too.
    if not all(-most <= value <= most for value, most in zip(numbers, _HIGHEST, strict=True)):
        raise WireError(f"telemetry out of range: {numbers}", Reason.OUT_OF_RANGE)
    x, y, heading, speed, deviation, heading_deviation, link, battery = numbers
    stage, cause, source = (int(code) for code in codes)
    states = [sensors >> BITS * sensor & 0xF for sensor in Sensor]
    is_known = stage <= max(DangerStage) and source <= max(Source)
    is_known &= max(states) <= max(SensorState) and not cause & ~_EVERY_CAUSE
    if not is_known or deviation < 0.0 or heading_deviation < 0.0:
        raise WireError(f"telemetry with unknown codes {codes}, {sensors}", Reason.OUT_OF_RANGE)
    health = Health(
        tuple(map(SensorState, states)),
        heading_deviation,
        link if link >= 0.0 else None,
        battery if battery >= 0.0 else None,
    )
    return Telemetry(
        *(stamp_us, x, y, heading, speed, deviation or None),
        *(Source(source), DangerStage(stage), Cause(cause), health),
    )


def encode_telemetry(frame: TelemetryFrame) -> bytes:
    """Return the telemetry of one kart as a message."""
    builder = flatbuffers.Builder(128)
    numbers, sensors, codes = _numbers(frame.telemetry)
    head = frame.telemetry.stamp_us, frame.epoch, frame.sequence
    fields: tuple[float, ...] = (*head, *numbers, sensors, *codes)
    TelemetryMessage.Start(builder)
    place = TelemetryStruct.CreateTelemetry(builder, *fields)
    TelemetryMessage.AddTelemetry(builder, place)
    builder.Finish(TelemetryMessage.End(builder), topics.TELEMETRY.identifier)
    return bytes(builder.Output())


def decode_telemetry(data: bytes) -> TelemetryFrame:
    """Return the telemetry in a message.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.TELEMETRY.identifier, topics.TELEMETRY.most_bytes)
    stamp_us, epoch, sequence, *rest = table.packed(0, TELEMETRY, "telemetry")
    told = _telemetry_of(stamp_us, tuple(rest[:8]), rest[8], tuple(rest[9:]))
    return TelemetryFrame(epoch, sequence, told)


def encode_telemetries(frame: TelemetriesFrame) -> bytes:
    """Return how all real karts are as a message."""
    told = []
    for seat, each in frame.karts.items():
        numbers, sensors, codes = _numbers(each)
        told.append((*numbers, sensors, seat, *codes))
    rows = np.array(told, ROW[NAMES])
    builder = flatbuffers.Builder(64 + ROW.itemsize * len(rows))
    create = KartTelemetry.CreateKartTelemetry
    vector = build_rows(builder, Telemetries.StartKartsVector, create, rows)
    Telemetries.Start(builder)
    Telemetries.AddEpoch(builder, frame.epoch)
    Telemetries.AddTick(builder, frame.tick)
    Telemetries.AddKarts(builder, vector)
    builder.Finish(Telemetries.End(builder), topics.TELEMETRIES.identifier)
    return bytes(builder.Output())


def decode_telemetries(data: bytes) -> TelemetriesFrame:
    """Return how all real karts are from a message.

    Raises:
        WireError: damaged, foreign, or out of range.
    """
    table = root_of(data, topics.TELEMETRIES.identifier, topics.TELEMETRIES.most_bytes)
    first, count = table.vector(2, ROW.itemsize, MOST_KARTS)
    karts = {}
    for row in np.frombuffer(data, ROW, count, first)[NAMES].tolist():
        karts[row[9]] = _telemetry_of(0, row[:8], row[8], row[10:])
    return TelemetriesFrame(table.scalar(0, U32), table.scalar(1, U32), karts)
