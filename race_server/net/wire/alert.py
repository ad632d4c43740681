"""Encode and decode what real karts see and do: up from one kart, and out of all of them."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import flatbuffers
import numpy as np

from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.messages import RayHit
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Alert as AlertStruct
from race_server.net.wire.generated.drive import AlertMessage
from race_server.net.wire.generated.spectate import Alerts, KartAlert
from race_server.net.wire.rows import build_rows
from race_server.net.wire.strict import U32, root_of

ALERT = struct.Struct("<QII4f4B4x")
ROW = np.dtype(
    [
        *((name, "<f4") for name in ("bearing", "distance", "time", "needed")),
        ("seat", "<u2"),
        *((name, "u1") for name in ("stage", "cause", "kind", "advice")),
        ("", "V2"),  # pads to a multiple of four
    ]
)
NAMES = list(ROW.names or ())[:-1]  # without what pads
# Beyond any sensor and any brake.
MOST_METRES, MOST_S, MOST_BRAKING = 1e3, 60.0, 1e4
_HIGHEST = (math.pi, MOST_METRES, MOST_S, MOST_BRAKING)
_EVERY_CAUSE = int(~Cause.NONE)
LEAST = 0.001  # [m], [s]: 0 says that there is none
MOST_KARTS = 64


@dataclass(frozen=True, slots=True)
class AlertFrame:
    """An alert of one kart with its epoch and sequence."""

    epoch: int
    sequence: int
    alert: Alert


@dataclass(frozen=True, slots=True)
class AlertsFrame:
    """What all real karts say, by seat."""

    epoch: int
    tick: int
    alerts: Mapping[int, Alert]  # their stamps are not sent


Numbers = tuple[float, float, float, float, int, int, int, int]


def _numbers(alert: Alert) -> Numbers:
    """Return what is sent of an alert; what is infinitely far is told as 0."""
    danger = alert.danger
    distance = max(danger.distance, LEAST) if danger.distance < MOST_METRES else 0.0
    time_s = max(danger.time_s, LEAST) if danger.time_s < MOST_S else 0.0
    needed = min(danger.needed, MOST_BRAKING)
    codes = int(danger.stage), int(alert.cause), int(danger.kind), int(danger.advice)
    return (danger.bearing, distance, time_s, needed, *codes)


def _alert_of(stamp_us: int, numbers: Numbers) -> Alert:
    """Return the alert that some numbers tell.

    Raises:
        WireError: not finite, out of range, or a code that is unknown.
    """
    values, (stage, cause, kind, advice) = numbers[:4], numbers[4:]
    # Comparisons with NaN are false, so NaN is refused here too.
    within = all(-most <= value <= most for value, most in zip(values, _HIGHEST, strict=True))
    if not within or min(values[1:]) < 0.0:
        raise WireError(f"alert out of range: {values}", Reason.OUT_OF_RANGE)
    known = stage <= max(DangerStage) and kind <= max(RayHit) and advice <= max(Advice)
    if not known or cause & ~_EVERY_CAUSE:
        raise WireError(f"alert with unknown codes {numbers[4:]}", Reason.OUT_OF_RANGE)
    bearing, distance, time_s, needed = values
    danger = Danger(
        DangerStage(stage),
        RayHit(kind),
        bearing,
        distance or math.inf,
        time_s or math.inf,
        needed,
        Advice(advice),
    )
    return Alert(stamp_us, danger, Cause(cause))


def encode_alert(frame: AlertFrame) -> bytes:
    """Return an alert as a message."""
    builder = flatbuffers.Builder(128)
    head = frame.alert.stamp_us, frame.epoch, frame.sequence
    AlertMessage.Start(builder)
    AlertMessage.AddAlert(builder, AlertStruct.CreateAlert(builder, *head, *_numbers(frame.alert)))
    builder.Finish(AlertMessage.End(builder), topics.ALERT.identifier)
    return bytes(builder.Output())


def decode_alert(data: bytes) -> AlertFrame:
    """Return the alert in a message.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.ALERT.identifier, topics.ALERT.most_bytes)
    stamp_us, epoch, sequence, *numbers = table.packed(0, ALERT, "alert")
    return AlertFrame(epoch, sequence, _alert_of(stamp_us, tuple(numbers)))


def encode_alerts(frame: AlertsFrame) -> bytes:
    """Return the alerts of all real karts as a message."""
    numbers = {seat: _numbers(alert) for seat, alert in frame.alerts.items()}
    told = [(*each[:4], seat, *each[4:]) for seat, each in numbers.items()]
    rows = np.array(told, ROW[NAMES])
    builder = flatbuffers.Builder(64 + ROW.itemsize * len(rows))
    vector = build_rows(builder, Alerts.StartKartsVector, KartAlert.CreateKartAlert, rows)
    Alerts.Start(builder)
    Alerts.AddEpoch(builder, frame.epoch)
    Alerts.AddTick(builder, frame.tick)
    Alerts.AddKarts(builder, vector)
    builder.Finish(Alerts.End(builder), topics.ALERTS.identifier)
    return bytes(builder.Output())


def decode_alerts(data: bytes) -> AlertsFrame:
    """Return the alerts of all real karts from a message.

    Raises:
        WireError: damaged, foreign, or out of range.
    """
    table = root_of(data, topics.ALERTS.identifier, topics.ALERTS.most_bytes)
    first, count = table.vector(2, ROW.itemsize, MOST_KARTS)
    rows = np.frombuffer(data, ROW, count, first)
    alerts = {}
    for row in rows[NAMES].tolist():
        alerts[row[4]] = _alert_of(0, (*row[:4], *row[5:]))
    return AlertsFrame(table.scalar(0, U32), table.scalar(1, U32), alerts)
