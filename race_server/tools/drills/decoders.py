"""Every decoder of bytes that come from outside, with a whole message for each."""

import json
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import flatbuffers
import numpy as np
from mcap.opcode import Opcode

from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.driver import Briefing
from race_server.core.level import Level
from race_server.core.messages import (
    Control,
    Event,
    EventKind,
    EventPhase,
    Flag,
    Phase,
    Pose,
    PoseFault,
    RayHit,
    Source,
    Standing,
    Status,
    Trust,
)
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.peer import Peer
from race_server.core.telemetry import Health, SensorState, Telemetry
from race_server.core.vehicle_presets import TT02
from race_server.errors import GatewayError, RaceError, RecordingError, ResultsError, SeatError
from race_server.errors import WireError as Damage
from race_server.live.gateway.handshake import read_hello
from race_server.live.gateway.limits import GatewayLimits
from race_server.live.gateway.requests import REQUESTS, read_request
from race_server.net.wire import (
    admin,
    alert,
    drive,
    ghosts,
    journal,
    line,
    links,
    lobby,
    parking,
    peer,
    placement,
    pose,
    programme,
    spectate,
    telemetry,
    topics,
)
from race_server.net.wire.topics import Topic
from race_server.storage.recording.channels import SCENE
from race_server.storage.recording.chunks import MESSAGE, read_chunk
from race_server.storage.recording.reader import Line
from race_server.storage.recording.to_json import to_json
from race_server.storage.results.queries import decode_trace
from race_server.tools.drills.bombs import MEGABYTE, chunk, crowd, record, zeros_in_zstd

TEXT_BYTES = GatewayLimits().text_bytes
# The longest message that is made for a decoder which takes longer ones.
MOST_MADE = 1 << 16
TOLD = Telemetry(
    *(99, 1.0, 2.0, 0.5, 3.0, 0.1, Source.BEACONS, DangerStage.EASE, Cause.SENSOR),
    Health((SensorState.WELL,) * 7 + (SensorState.SILENT,), 0.01, 0.05, 0.75),
)
SEEN = Alert(
    99,
    Danger(DangerStage.FULL, RayHit.PERSON, 0.25, 4.5, 0.75, 6.5, Advice.BRAKE),
    Cause.OBSTACLE | Cause.LINK,
)


@dataclass(frozen=True)
class Decoder:
    """What takes a message apart, and the one error by which it refuses."""

    name: str
    sample: bytes  # whole
    decode: Callable[[bytes], Any]
    most_bytes: int
    identifier: bytes = b""  # of a FlatBuffer
    refuses: type[RaceError] = Damage
    crafted: tuple[bytes, ...] = ()  # to mislead this decoder


@dataclass(frozen=True)
class Inbound:
    """A topic on which clients send to the server."""

    topic: Topic
    sample: bytes  # whole
    decode: Callable[[bytes], Any]

    @property
    def decoder(self) -> Decoder:
        """What the server takes its messages apart with."""
        most, identifier = self.topic.most_bytes, self.topic.identifier
        return Decoder(self.topic.key, self.sample, self.decode, most, identifier)


def inbound() -> tuple[Inbound, ...]:
    """Return all inbound topics that carry a message."""
    control = drive.ControlFrame(1, 7, 90, Control(0.25, 0.5, 0.0))
    placed = Pose(99, 1.0, 2.0, 0.5, 3.0, deviation=0.1, quality=0.9)
    act = lobby.encode_seat_act(lobby.SeatAct(3, 12345))
    decision = admin.encode_decision(
        admin.Decision("0" * 32, "penalty", 3, 5.0, 1 << 40, "mallory")
    )
    join = lobby.encode_join(lobby.Join("mallory", "lidar", 2, 99))
    return (
        Inbound(topics.CONTROL, drive.encode_control(control), drive.decode_control),
        Inbound(topics.POSE, pose.encode_pose(pose.PoseFrame(1, 7, 3, placed)), pose.decode_pose),
        Inbound(topics.ALERT, alert.encode_alert(alert.AlertFrame(1, 7, SEEN)), alert.decode_alert),
        Inbound(
            topics.TELEMETRY,
            telemetry.encode_telemetry(telemetry.TelemetryFrame(1, 7, TOLD)),
            telemetry.decode_telemetry,
        ),
        Inbound(topics.JOIN, join, lobby.decode_join),
        Inbound(topics.READY, act, lobby.decode_seat_act),
        Inbound(topics.LEAVE, act, lobby.decode_seat_act),
        Inbound(topics.ACT, decision, admin.decode_decision),
        Inbound(topics.ACTS, decision, admin.decode_decision),
    )


def decoders() -> tuple[Decoder, ...]:
    """Return all decoders: of server, clients, gateway, recordings and results."""
    return (
        *(kind.decoder for kind in inbound()),
        *_of_clients(),
        *_of_races(),
        *_of_the_gateway(),
        *_of_recordings(),
    )


def _client(
    message: bytes,
    decode: Callable[[bytes], Any],
    most: int = MOST_MADE,
    table: str = "",
    lists: tuple[str, ...] = (),
) -> Decoder:
    """Return a decoder of clients. table, lists: of texts, if a message of it has such."""
    head = message[4:8]
    made = (_one_text_again_and_again(table, lists, head),) if table else ()
    name = decode.__name__.removeprefix("decode_")
    return Decoder(f"client: {name}", message, _or_refused(decode), most, head, crafted=made)


def _of_clients() -> Iterator[Decoder]:
    """Yield what takes the answers to a client's requests apart."""
    briefing = Briefing(1, TT02, 3, "lidar", 0.05, ("boost", "oil"), 3.5)
    yield _client(
        lobby.encode_welcome(lobby.Welcome(briefing, 99, 2, 201)),
        lobby.decode_welcome,
        lobby.MOST_BRIEFING,
        "Briefing",
        ("Items", "VehicleNames"),
    )
    yield _client(lobby.encode_reply("no"), lobby.check_reply, 4096)
    yield _client(
        lobby.encode_rules({"laps": "3", "items": "on"}, ["oil"]),
        lobby.decode_rules,
        MOST_MADE,
        "Rules",
        ("Names", "Values", "Items"),
    )
    sheet = lobby.CourseSheet(
        *("oval", "Oval", "0af1", 0.5, np.ones((3, 4)), np.ones((3, 2)), 0.1, np.ones((2, 4))),
        *(np.arange(2.0), np.ones((1, 3)), np.zeros((0, 2)), 0.5, np.ones((1, 5)), (1, 0)),
        *(2.06, 1.3, 0.087),
    )
    yield _client(lobby.encode_course(sheet), lobby.decode_course)
    steps = np.arange(3.0)
    path = line.LineSheet(0.1, steps, steps, steps, steps, lap=6.5, note="é")
    yield _client(line.encode_line(path), line.decode_line)
    yield _client(
        admin.encode_log(7, ["green", "penalty"]),
        admin.decode_log,
        MOST_MADE,
        "AdminLog",
        ("Lines",),
    )


def _of_races() -> Iterator[Decoder]:
    """Yield what takes apart what clients hear during a race."""
    seen = drive.ObservationWriter(40).write(1, 2, 3, 4, np.ones(40, "f4"))
    yield _client(bytes(seen), drive.decode_observation)
    hud = drive.HudFrame(
        *(1, 2, 3.5, 1.0, 0.5, 2, 0.25, np.array([(1, 0.5)], drive.EFFECT)),
        *(7, 0.5, 2**40, 1.5, Flag.YELLOW, Trust.DOUBTFUL, PoseFault.JUMP),
    )
    yield _client(drive.encode_hud(hud), drive.decode_hud, topics.HUD.most_bytes)
    row = np.array([(-1, 0, 3, 0, 0, b""), (50, 7, 0, 2, 5, b"")], links.LINK)
    frame = links.LinksFrame(2, 600, row)
    yield _client(links.encode_links(frame), links.decode_links, topics.LINKS.most_bytes)
    said = alert.encode_alerts(alert.AlertsFrame(2, 600, {3: SEEN}))
    yield _client(said, alert.decode_alerts, topics.ALERTS.most_bytes)
    told = telemetry.encode_telemetries(telemetry.TelemetriesFrame(2, 600, {3: TOLD}))
    yield _client(told, telemetry.decode_telemetries, topics.TELEMETRIES.most_bytes)
    other = Peer(99, 1.0, 2.0, 0.5, 3.0, 0.1, 0.2, 4.0, 0.02, 0.01, 1.9, 1.3)
    near = peer.encode_peer(peer.PeerFrame(2, other, 3, 77))
    yield _client(near, peer.decode_peer, topics.PEER.most_bytes)
    order = ParkingOrder(Slot(1.0, 2.0, 0.5, 3.0, 2.0), Level(), np.ones((4, 4)), np.ones((2, 5)))
    asked = parking.encode_order(parking.OrderFrame(2, 1, order))
    yield _client(asked, parking.decode_order, topics.ORDER.most_bytes)
    lot = parking.LotFrame(2, 600, np.zeros(3, parking.GOAL), np.zeros(4, parking.BLOCK))
    yield _client(parking.encode_lot(lot), parking.decode_lot, topics.LOT.most_bytes)
    team = programme.TeamRow("é", 1, 1, 5, 9, (9, 0), 1, (programme.DeletedLap(1, 2, "why"),))
    call = programme.Call("Heat 1", ("é", "me"))
    shown = programme.ProgrammeFrame(
        *("cup", "Cup", EventPhase.ON_TRACK, call, 60.0, 7, 1, 4, True, 2),
        *((call,), (team, team), "Heat"),
    )
    yield _client(
        programme.encode_programme(shown),
        programme.decode_programme,
        topics.PROGRAMME.most_bytes,
    )
    samples = [np.arange(3, dtype=np.float32)] * 4
    ghost = ghosts.GhostFrame("é", 1, True, False, 9, *samples)
    yield _client(ghosts.encode_ghosts(2, (ghost,)), ghosts.decode_ghosts, topics.GHOSTS.most_bytes)
    snapshot = spectate.SnapshotFrame(
        *(7, 2, 600, 0.5, Phase.RUNNING, Flag.YELLOW, np.zeros(3, spectate.KART)),
        *(np.array([1, 0, 1], np.uint8), np.zeros(2, spectate.HAZARD)),
        trailers=np.zeros(2, parking.TRAILER),
    )
    snapshot_message = bytes(spectate.SnapshotWriter().write(snapshot))
    yield _client(snapshot_message, spectate.decode_snapshot, topics.SNAPSHOT.most_bytes)
    events = [Event(1, 60, EventKind.LAP, 3, 2, 17), Event(2, 61, EventKind.GREEN, -1, -1, 0)]
    yield _client(spectate.encode_events(5, events), spectate.decode_events)
    standing = Standing(4, "me", 1, 3, Status.FINISHED, 10, 9, 30, 0, 1, 50, 2, (11, 10, 9))
    standings = spectate.StandingsFrame(
        1, 600, 180, Phase.RUNNING, Flag.GREEN, 3, "oval", (standing,)
    )
    yield _client(spectate.encode_standings(standings), spectate.decode_standings)


def _one_text_again_and_again(name: str, fields: tuple[str, ...], identifier: bytes) -> bytes:
    """Return a message of a table whose lists of texts all point at one long text."""
    table = import_module(f"race_server.net.wire.generated.session.{name}")
    builder = flatbuffers.Builder(MOST_MADE)
    text, offsets = builder.CreateString("x" * 4000), []
    for field in fields:
        getattr(table, f"Start{field}Vector")(builder, 250)
        for _ in range(250):
            builder.PrependUOffsetTRelative(text)
        offsets.append(builder.EndVector())
    table.Start(builder)
    for field, offset in zip(fields, offsets, strict=True):
        getattr(table, f"Add{field}")(builder, offset)
    builder.Finish(table.End(builder), identifier)
    return bytes(builder.Output())


def _or_refused(decode: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    """Return a decoder for which a server's refusal is an answer like any other."""

    def decode_answer(data: bytes) -> Any:
        try:
            return decode(data)
        except SeatError as refusal:
            return refusal

    return decode_answer


def _of_the_gateway() -> Iterator[Decoder]:
    """Yield what takes a browser's texts apart; its controls are those of any driver."""
    words: dict[str, Any] = {"role": "drive", "token": "x" * 22, "seat": 3, "name": "Ada"}
    hello = {**words, "source": "recording:cup", "rate": 30, "resume": "y" * 22}
    odd: tuple[Any, ...] = (None, True, -1, 1e999, 10**400, "x" * 900, "\ud800", [], {}, [[]] * 99)
    nested = (b"[" * TEXT_BYTES, b'{"type":' * 100, b"9" * TEXT_BYTES, b"1e99999", b"NaN", b"null")
    strange = (json.dumps({**hello, name: value}).encode() for name in hello for value in odd)
    yield _text_decoder("browser: hello", hello, read_hello, (*nested, *strange))
    for kind, fields in REQUESTS.items():
        request = {"type": kind, **{name: read({}, name) for name, read in fields.items()}}
        odd_ones = (
            json.dumps({**request, name: value}).encode() for name in request for value in odd
        )
        yield _text_decoder(f"browser: {kind}", request, read_request, (*nested, *odd_ones))


def _text_decoder(
    name: str, message: dict[str, Any], read: Callable[[str], Any], crafted: tuple[bytes, ...]
) -> Decoder:
    def decode(data: bytes) -> Any:
        # The protocol refuses bytes that are no text, and longer ones, before it asks us.
        return read(data[:TEXT_BYTES].decode(errors="replace"))

    sample = json.dumps(message).encode()
    return Decoder(name, sample, decode, TEXT_BYTES, refuses=GatewayError, crafted=tuple(crafted))


def _of_recordings() -> Iterator[Decoder]:
    seat = journal.SeatRow(1, "Ada", "lidar", b"k" * 32, is_local=False)
    start = journal.StartFrame(
        *("cup", 1, "real", 3, "2026-01-02T03:04:05+00:00", '{"numpy": "2"}', "{}", bytes(200)),
        (seat, seat),
    )
    inputs, acts = np.zeros(2, journal.INPUT), np.zeros(2, journal.ACT)
    rows = np.zeros(2, placement.PLACED)
    message = record(Opcode.MESSAGE, MESSAGE.pack(1, 0, 5, 5) + b"hello")
    whole = record(Opcode.CHANNEL, bytes(4) + b"\x0a\0\0\0race/cup/x") + message * 20
    for name, data, decode, most in (
        ("start", journal.encode_start(start), journal.decode_start, MOST_MADE),
        ("inputs", journal.encode_inputs(60, inputs), journal.decode_inputs, MOST_MADE),
        ("acts", journal.encode_acts(acts), journal.decode_acts, MOST_MADE),
        ("placements", placement.encode_placements(60, rows), placement.decode_placements, 1 << 13),
        ("granted", journal.encode_granted(60, b"k" * 32, 7), journal.decode_granted, 256),
        ("digest", journal.encode_digest(60, "0" * 64, is_last=True), journal.decode_digest, 256),
        ("lap", journal.encode_lap(1, 2, 17_000_000, 60), journal.decode_lap, 256),
    ):
        yield Decoder(f"journal: {name}", data, decode, most, data[4:8])
    yield Decoder(
        "recording: scene", b'{"deletions": [], "entities": []}',
        lambda data: to_json(Line(SCENE, 0, data)), MOST_MADE,
        crafted=(b"[" * 9999, b"\xff", b"9" * 9999),
    )  # fmt: skip
    bombs = (chunk(zeros_in_zstd(MEGABYTE), MEGABYTE), chunk(bytes(99), 1 << 62), crowd())
    yield Decoder(
        "recording: chunk", chunk(whole, len(whole), ""), read_chunk, MOST_MADE,
        refuses=RecordingError, crafted=bombs,
    )  # fmt: skip
    numbers = zlib.compress(np.arange(60, dtype="<f4").tobytes())
    yield Decoder(
        "results: trace", numbers, lambda data: decode_trace('["x", "y"]', data), MOST_MADE,
        refuses=ResultsError,
    )  # fmt: skip
