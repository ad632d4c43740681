"""Messages written before the schemas had enumerations: each is read, and written the same again.

`golden_messages.txt` holds a message of each kind in hexadecimal digits. A change of a schema that
moves a byte of them breaks recordings and clients that exist.
"""

import json
from collections.abc import Callable
from pathlib import Path

import ark_fbs
import pytest

from race_server.core.messages import Button, EventKind, Flag, Phase, PoseFault, Source, Trust
from race_server.net.wire import (
    admin,
    alert,
    drive,
    ghosts,
    hint,
    journal,
    line,
    links,
    lobby,
    parking,
    peer,
    placement,
    programme,
    spectate,
    telemetry,
)
from race_server.net.wire import pose as poses
from race_server.net.wire.rays import encode_rays
from race_server.session.failsafe import FailsafeStage
from race_server.session.interventions import InterventionKind
from race_server.storage.recording.channels import CHANNELS, ChannelKind
from support.rays import decode_rays

GOLDEN = {
    name: bytes.fromhex(digits)
    for name, digits in (
        row.split()
        for row in Path(__file__).with_name("golden_messages.txt").read_text().splitlines()
    )
}


def observation(data: bytes) -> bytes:
    frame = drive.decode_observation(data)
    writer = drive.ObservationWriter(len(frame.values))
    return writer.write(frame.epoch, frame.tick, frame.acknowledged, frame.seat, frame.values)


def lap(data: bytes) -> bytes:
    return journal.encode_lap(*journal.decode_lap(data))


def digest(data: bytes) -> bytes:
    tick, text, is_last = journal.decode_digest(data)
    return journal.encode_digest(tick, text, is_last=is_last)


# Of each kind: read a message and write it again.
AGAIN: dict[str, Callable[[bytes], bytes]] = {
    "control": lambda data: drive.encode_control(drive.decode_control(data)),
    "pose": lambda data: poses.encode_pose(poses.decode_pose(data)),
    "alert": lambda data: alert.encode_alert(alert.decode_alert(data)),
    "alerts": lambda data: alert.encode_alerts(alert.decode_alerts(data)),
    "telemetry": lambda data: telemetry.encode_telemetry(telemetry.decode_telemetry(data)),
    "telemetries": lambda data: telemetry.encode_telemetries(telemetry.decode_telemetries(data)),
    "hint": lambda data: hint.encode_hint(*hint.decode_hint(data)),
    "peer": lambda data: peer.encode_peer(peer.decode_peer(data)),
    "observation": observation,
    "hud": lambda data: drive.encode_hud(drive.decode_hud(data)),
    "snapshot": lambda data: spectate.SnapshotWriter().write(spectate.decode_snapshot(data)),
    "events": lambda data: spectate.encode_events(*spectate.decode_events(data)),
    "standings": lambda data: spectate.encode_standings(spectate.decode_standings(data)),
    "links": lambda data: links.encode_links(links.decode_links(data)),
    "join": lambda data: lobby.encode_join(lobby.decode_join(data)),
    "seat": lambda data: lobby.encode_seat_act(lobby.decode_seat_act(data)),
    "decision": lambda data: admin.encode_decision(admin.decode_decision(data)),
    "log": lambda data: admin.encode_log(*admin.decode_log(data)),
    "rules": lambda data: lobby.encode_rules(*lobby.decode_rules(data)),
    "line": lambda data: line.encode_line(line.decode_line(data)),
    "course": lambda data: lobby.encode_course(lobby.decode_course(data)),
    "briefing": lambda data: lobby.encode_welcome(lobby.decode_welcome(data)),
    "lot": lambda data: parking.encode_lot(parking.decode_lot(data)),
    "order": lambda data: parking.encode_order(parking.decode_order(data)),
    "programme": lambda data: programme.encode_programme(programme.decode_programme(data)),
    "ghosts": lambda data: ghosts.encode_ghosts(*ghosts.decode_ghosts(data)),
    "rays": lambda data: encode_rays(decode_rays(data)),
    "start": lambda data: journal.encode_start(journal.decode_start(data)),
    "inputs": lambda data: journal.encode_inputs(*journal.decode_inputs(data)),
    "placements": lambda data: placement.encode_placements(*placement.decode_placements(data)),
    "acts": lambda data: journal.encode_acts(journal.decode_acts(data)),
    "granted": lambda data: journal.encode_granted(*journal.decode_granted(data)),
    "digest": digest,
    "lap": lap,
    "reply": lambda _: lobby.encode_reply("no"),
}


def test_there_is_a_message_of_each_kind() -> None:
    assert GOLDEN.keys() == AGAIN.keys()


@pytest.mark.parametrize("name", GOLDEN)
def test_a_message_from_before_is_read_and_written_with_the_same_bytes(name: str) -> None:
    assert AGAIN[name](GOLDEN[name]) == GOLDEN[name]


def test_numbers_from_before_have_the_names_of_today() -> None:
    hud = drive.decode_hud(GOLDEN["hud"])
    assert (hud.flag, hud.trust, hud.fault) == (Flag.YELLOW, Trust.DOUBTFUL, PoseFault.JUMP)
    assert drive.decode_control(GOLDEN["control"]).control.buttons is Button.USE_ITEM
    assert poses.decode_pose(GOLDEN["pose"]).pose.source is Source.BEACONS
    frame = spectate.decode_snapshot(GOLDEN["snapshot"])
    assert (frame.phase, frame.flag) == (Phase.RUNNING, Flag.YELLOW)
    kinds = [event.kind for event in spectate.decode_events(GOLDEN["events"])[1]]
    assert kinds == [EventKind.LAP, EventKind.GREEN]
    _, placed = placement.decode_placements(GOLDEN["placements"])
    assert (placed["trust"][0], placed["fault"][0]) == (Trust.SUSPENDED, PoseFault.JUMP)
    heard = links.decode_links(GOLDEN["links"]).links
    assert heard["silence"].tolist() == [FailsafeStage.STOPPED, FailsafeStage.FRESH]
    assert journal.decode_acts(GOLDEN["acts"])["kind"][0] == InterventionKind.FLAG


RECORDED = {
    "journal.RaceStart": "start",
    "journal.Inputs": "inputs",
    "journal.Placements": "placements",
    "journal.Acts": "acts",
    "journal.Granted": "granted",
    "journal.Digest": "digest",
    "journal.Lap": "lap",
    "spectate.Snapshot": "snapshot",
    "spectate.Programme": "programme",
    "spectate.Ghosts": "ghosts",
    "spectate.Events": "events",
    "spectate.Standings": "standings",
    "spectate.Lot": "lot",
    "spectate.Alerts": "alerts",
    "spectate.Telemetries": "telemetries",
}


@pytest.mark.parametrize(
    "kind", [kind for kind in CHANNELS if kind.encoding == "flatbuffer"], ids=lambda kind: kind.key
)
def test_the_schema_in_a_recording_is_all_that_its_messages_need(kind: ChannelKind) -> None:
    schema = ark_fbs.Schema.from_bfbs(kind.schema_data, root_type_override=kind.schema_name)
    assert schema.binary_to_json(GOLDEN[RECORDED[kind.schema]])


def test_a_reader_of_a_recording_sees_names_for_numbers() -> None:
    kind = next(kind for kind in CHANNELS if kind.schema == "spectate.Events")
    schema = ark_fbs.Schema.from_bfbs(kind.schema_data, root_type_override=kind.schema_name)
    events = json.loads(schema.binary_to_json(GOLDEN["events"]))["events"]
    assert [event["kind"] for event in events] == ["LAP", "GREEN"]
