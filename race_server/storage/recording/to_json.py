"""The messages of a recording as plain data, for people and programs that know no FlatBuffers."""

import json
from collections.abc import Callable
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from race_server.core.messages import PoseFault, Trust
from race_server.errors import WireError
from race_server.net.wire.alert import decode_alerts
from race_server.net.wire.ghosts import GhostFrame, decode_ghosts
from race_server.net.wire.journal import (
    decode_acts,
    decode_digest,
    decode_granted,
    decode_inputs,
    decode_lap,
    decode_start,
)
from race_server.net.wire.parking import BLOCK_NAMES, GOAL, TRAILER_NAMES, decode_lot
from race_server.net.wire.placement import decode_placements
from race_server.net.wire.programme import decode_programme
from race_server.net.wire.spectate import decode_events, decode_snapshot, decode_standings
from race_server.net.wire.telemetry import decode_telemetries
from race_server.session.interventions import InterventionKind
from race_server.storage.recording.channels import (
    ACTS,
    ALERTS,
    DIGEST,
    EVENTS,
    GHOSTS,
    GRANTED,
    INPUTS,
    LAPS,
    LOTS,
    PLACEMENTS,
    PROGRAMMES,
    SCENE,
    SNAPSHOTS,
    STANDINGS,
    START,
    TELEMETRY,
)
from race_server.storage.recording.reader import Line

Words = dict[str, Any]


def to_json(line: Line) -> Words:
    """Return a message as a dictionary of numbers, text and lists.

    Raises:
        WireError: it is damaged.
    """
    try:
        return _READERS[line.kind.key](line.data)
    # Texts that are no JSON, nested too deep, or of a foreign encoding, and names that are unknown.
    except (ValueError, RecursionError) as error:
        raise WireError(f"{line.kind.key}: {str(error)[:80]}") from error


def _start(data: bytes) -> Words:
    frame = decode_start(data)
    seats = [{"seat": row.number, "driver": row.driver} for row in frame.seats]
    return {
        "session": frame.session,
        "epoch": frame.epoch,
        "started_at": frame.started_at,
        "versions": json.loads(frame.versions),
        "seats": seats,
    }


def _inputs(data: bytes) -> Words:
    tick, rows = decode_inputs(data)
    names = ("steering", "throttle", "brake", "buttons", "sequence", "seat")
    inputs = [dict(zip(names, row[:6], strict=True)) for row in rows.tolist()]
    return {"tick": tick, "inputs": inputs}


def _placements(data: bytes) -> Words:
    tick, rows = decode_placements(data)
    names = rows.dtype.names or ()
    karts = [dict(zip(names, row, strict=True)) for row in rows.tolist()]
    for kart in karts:
        kart["trust"] = Trust(kart["trust"]).name.lower()
        kart["doubt"] = PoseFault(kart.pop("fault")).name.lower()
    return {"tick": tick, "placements": karts}


def _granted(data: bytes) -> Words:
    tick, key, serial = decode_granted(data)
    return {"tick": tick, "key": key.hex(), "serial": serial}


def _acts(data: bytes) -> Words:
    return {
        "acts": [
            {"tick": tick, "act": InterventionKind(kind).name.lower(), "kart": kart, "value": value}
            for value, tick, kind, kart in decode_acts(data).tolist()
        ]
    }


def _digest(data: bytes) -> Words:
    tick, digest, is_last = decode_digest(data)
    return {"tick": tick, "digest": digest, "is_last": is_last}


def _lap(data: bytes) -> Words:
    seat, number, time_us, tick = decode_lap(data)
    return {"tick": tick, "seat": seat, "lap": number, "time_us": time_us}


def _snapshot(data: bytes) -> Words:
    frame = decode_snapshot(data)
    names = frame.karts.dtype.names or ()
    karts = [dict(zip(names, row, strict=True)) for row in frame.karts.tolist()]
    words = {"tick": frame.tick, "phase": frame.phase.name.lower(), "karts": karts}
    if len(frame.trailers):
        rows = frame.trailers[TRAILER_NAMES].tolist()
        words["trailers"] = [dict(zip(TRAILER_NAMES, row, strict=True)) for row in rows]
    return words


def _events(data: bytes) -> Words:
    _, events = decode_events(data)
    return {"events": [{**asdict(event), "kind": event.kind.name.lower()} for event in events]}


def _standings(data: bytes) -> Words:
    return decode_standings(data).as_json()


def _lot(data: bytes) -> Words:
    frame = decode_lot(data)
    goals = [dict(zip(GOAL.names or (), row, strict=True)) for row in frame.goals.tolist()]
    rows = frame.blocks[BLOCK_NAMES].tolist()
    blocks = [dict(zip(BLOCK_NAMES, row, strict=True)) for row in rows]
    ways = [{"seat": way.seat, "points": way.points.tolist()} for way in frame.ways]
    words: Words = {"tick": frame.tick, "goals": goals, "blocks": blocks}
    return words | ({"ways": ways} if ways else {})


def _telemetry(data: bytes) -> Words:
    frame = decode_telemetries(data)
    karts = [{"seat": seat, **told.as_json()} for seat, told in frame.karts.items()]
    return {"tick": frame.tick, "karts": karts}


def _alerts(data: bytes) -> Words:
    frame = decode_alerts(data)
    return {
        "tick": frame.tick,
        "alerts": [{"seat": seat, **alert.as_json()} for seat, alert in frame.alerts.items()],
    }


def _programme(data: bytes) -> Words:
    return decode_programme(data).as_json()


def _ghosts(data: bytes) -> Words:
    _, ghosts = decode_ghosts(data)
    return {"ghosts": [_plain(ghost) for ghost in ghosts]}


def _plain(ghost: GhostFrame) -> Words:
    values = ((field.name, getattr(ghost, field.name)) for field in fields(ghost))
    return {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values}


_READERS: dict[str, Callable[[bytes], Words]] = {
    START.key: _start,
    INPUTS.key: _inputs,
    PLACEMENTS.key: _placements,
    GRANTED.key: _granted,
    ACTS.key: _acts,
    DIGEST.key: _digest,
    LAPS.key: _lap,
    SNAPSHOTS.key: _snapshot,
    EVENTS.key: _events,
    STANDINGS.key: _standings,
    LOTS.key: _lot,
    PROGRAMMES.key: _programme,
    GHOSTS.key: _ghosts,
    ALERTS.key: _alerts,
    TELEMETRY.key: _telemetry,
    SCENE.key: json.loads,
}
