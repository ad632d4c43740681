"""Encode and decode requests and answers of the lobby."""

import itertools
import secrets
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.core.driver import Briefing
from race_server.core.vehicles import numbers_of, vehicle_from
from race_server.errors import SeatError, VehicleError, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.session import Briefing as BriefingTable
from race_server.net.wire.generated.session import Course as CourseTable
from race_server.net.wire.generated.session import JoinRequest, Reply, Rules, SeatRequest
from race_server.net.wire.parking import OrderFrame, build_order, read_order
from race_server.net.wire.rows import build_vector
from race_server.net.wire.strict import I16, U8, U16, U32, U64, root_of

# Must be equal on both ends; raised with every incompatible change.
PROTOCOL = 2
BRIEFING_ID, REPLY_ID, MOST_BRIEFING = b"RBRF", b"RRPL", 1 << 18
MOST_TEXTS = 256  # in a list: items, rules, figures of a vehicle
_DAMAGE = (
    *(struct.error, TypeError, ValueError, IndexError, AttributeError, KeyError),
    VehicleError,
)

Floats = NDArray[np.float64]


def new_secret() -> int:
    """Return a secret by which the server recognises a driver."""
    return secrets.randbits(63) | 1


_serials = itertools.count(1)


def new_serial() -> int:
    """Return a number larger than all before, by which the server detects copies of a request."""
    return next(_serials)


@dataclass(frozen=True, slots=True)
class Join:
    """A request for a seat."""

    driver: str
    preset: str
    wanted: int = -1
    secret: int = field(default_factory=new_secret)
    serial: int = field(default_factory=new_serial)  # larger with every request of this secret
    version: int = PROTOCOL
    tracked: bool = False  # a real kart


@dataclass(frozen=True, slots=True)
class SeatAct:
    """A request of a seat: to be ready, or to leave."""

    seat: int
    secret: int
    ready: bool = True
    serial: int = field(default_factory=new_serial)  # larger with every request of this secret


@dataclass(frozen=True, slots=True)
class Welcome:
    """The answer to a driver that gets a seat."""

    briefing: Briefing
    secret: int
    epoch: int
    lidar_rays: int
    order: OrderFrame | None = None  # only in a car park
    stays: bool = False  # an event: more races are to come


@dataclass(frozen=True)
class CourseSheet:
    """A course as clients receive it."""

    name: str
    title: str
    digest: str
    spacing: float
    line: Floats  # (N, 4)
    half_widths: Floats  # (N, 2)
    kerb: float
    borders: Floats  # (P, 4)
    gates: Floats  # (G,)
    grid: Floats  # (S, 3)
    boxes: Floats  # (I, 2)
    grass: float = 0.0
    obstacles: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # (O, 5)
    sectors: tuple[int, ...] = ()
    kart_length: float = 0.0
    kart_width: float = 0.0
    kart_ahead: float = 0.0
    slots: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # (S, 5)


def encode_join(join: Join) -> bytes:
    """Return a request for a seat as a message."""
    builder = flatbuffers.Builder(128)
    driver, preset = builder.CreateString(join.driver), builder.CreateString(join.preset)
    JoinRequest.Start(builder)
    JoinRequest.AddDriver(builder, driver)
    JoinRequest.AddPreset(builder, preset)
    JoinRequest.AddWanted(builder, join.wanted)
    JoinRequest.AddSecret(builder, join.secret)
    JoinRequest.AddVersion(builder, join.version)
    JoinRequest.AddSerial(builder, join.serial)
    JoinRequest.AddTracked(builder, join.tracked)
    builder.Finish(JoinRequest.End(builder), topics.JOIN.identifier)
    return bytes(builder.Output())


def decode_join(data: bytes) -> Join:
    """Return the request for a seat in a message.

    Raises:
        WireError: damaged, oversized or foreign.
    """
    table = root_of(data, topics.JOIN.identifier, topics.JOIN.most_bytes)
    place = table.field(2, 2)
    wanted = int(I16.unpack_from(data, place)[0]) if place else -1
    return Join(
        table.name(0),
        table.text(1, 16),
        wanted,
        secret=table.scalar(3, U64),
        serial=table.scalar(5, U32),
        version=table.scalar(4, U16),
        tracked=table.scalar(6, U8) != 0,
    )


def encode_seat_act(act: SeatAct) -> bytes:
    """Return a seat's request as a message."""
    builder = flatbuffers.Builder(64)
    SeatRequest.Start(builder)
    SeatRequest.AddSeat(builder, act.seat)
    SeatRequest.AddSecret(builder, act.secret)
    SeatRequest.AddReady(builder, act.ready)
    SeatRequest.AddSerial(builder, act.serial)
    builder.Finish(SeatRequest.End(builder), topics.READY.identifier)
    return bytes(builder.Output())


def decode_seat_act(data: bytes) -> SeatAct:
    """Return the request of a seat in a message.

    Raises:
        WireError: damaged, oversized or foreign.
    """
    table = root_of(data, topics.READY.identifier, topics.READY.most_bytes)
    ready = table.scalar(2, U8) != 0
    return SeatAct(table.scalar(0, U16), table.scalar(1, U64), ready, table.scalar(3, U32))


def encode_reply(reason: str) -> bytes:
    """Return an answer as a message: accepted if `reason` is empty."""
    builder = flatbuffers.Builder(256)
    text = builder.CreateString(reason[:512])
    Reply.Start(builder)
    Reply.AddAccepted(builder, not reason)
    Reply.AddReason(builder, text)
    builder.Finish(Reply.End(builder), REPLY_ID)
    return bytes(builder.Output())


def check_reply(data: bytes) -> None:
    """Check that an answer accepts the request.

    Raises:
        SeatError: the server refused, with its reason.
        WireError: damaged or foreign.
    """
    table = root_of(data, REPLY_ID, 4096)
    if table.scalar(0, U8) == 0:
        raise SeatError(table.text(1, 2048))


def encode_welcome(welcome: Welcome) -> bytes:
    """Return a seat's briefing as a message."""
    builder = flatbuffers.Builder(2048)
    briefing, vehicle = welcome.briefing, welcome.briefing.vehicle
    numbers = numbers_of(vehicle)
    texts = {
        "Preset": builder.CreateString(briefing.preset),
        "Vehicle": builder.CreateString(vehicle.name),
        "Items": _texts(builder, briefing.items),
        "VehicleNames": _texts(builder, tuple(numbers)),
        "VehicleValues": builder.CreateNumpyVector(np.array(tuple(numbers.values()), "<f8")),
    }
    order = build_order(builder, welcome.order) if welcome.order else 0
    BriefingTable.Start(builder)
    BriefingTable.AddSeat(builder, briefing.seat)
    BriefingTable.AddSecret(builder, welcome.secret)
    BriefingTable.AddEpoch(builder, welcome.epoch)
    BriefingTable.AddLaps(builder, briefing.laps)
    BriefingTable.AddDecision(builder, briefing.decision_s)
    BriefingTable.AddLidarRays(builder, welcome.lidar_rays)
    BriefingTable.AddLidarField(builder, briefing.lidar_field)
    BriefingTable.AddLidarReach(builder, briefing.lidar_reach)
    if order:
        BriefingTable.AddOrder(builder, order)
    BriefingTable.AddStays(builder, welcome.stays)
    BriefingTable.AddWaits(builder, briefing.waits)
    for name, offset in texts.items():
        getattr(BriefingTable, f"Add{name}")(builder, offset)
    builder.Finish(BriefingTable.End(builder), BRIEFING_ID)
    return bytes(builder.Output())


def _texts(builder: Any, texts: Sequence[str]) -> int:
    return build_vector(builder, [builder.CreateString(text) for text in texts])


def decode_welcome(data: bytes) -> Welcome:
    """Return the briefing in a message.

    Raises:
        SeatError: the answer is a refusal.
        WireError: damaged or foreign.
    """
    if data[4:8] == REPLY_ID:
        check_reply(data)
    table = root_of(data, BRIEFING_ID, MOST_BRIEFING)
    items, names = table.texts(8, MOST_TEXTS), table.texts(10, MOST_TEXTS)
    try:
        root = BriefingTable.Briefing.GetRootAs(data)
        numbers = dict(zip(names, root.VehicleValuesAsNumpy().tolist(), strict=True))
        vehicle = vehicle_from(root.Vehicle().decode(), numbers)
        briefing = Briefing(
            seat=root.Seat(),
            vehicle=vehicle,
            laps=root.Laps(),
            preset=root.Preset().decode(),
            decision_s=root.Decision(),
            items=items,
            lidar_field=root.LidarField(),
            lidar_reach=root.LidarReach(),
            waits=bool(root.Waits()),
        )
        order = read_order(asked) if (asked := table.table(13)) else None
        seat = root.Secret(), root.Epoch(), root.LidarRays()
        return Welcome(briefing, *seat, order, bool(root.Stays()))
    except _DAMAGE as error:
        raise WireError(f"briefing is damaged: {error}") from error


# Arrays of a course and the count of numbers in a row.
_COURSE_SHAPES = {
    "line": 4,
    "half_widths": 2,
    "borders": 4,
    "gates": 1,
    "grid": 3,
    "boxes": 2,
    "obstacles": 5,
    "slots": 5,
}
_COURSE_NUMBERS = ("spacing", "kerb", "grass", "kart_length", "kart_width", "kart_ahead")


def encode_course(sheet: CourseSheet) -> bytes:
    """Return a course as a message."""
    builder = flatbuffers.Builder(65536)
    offsets = {
        name: builder.CreateString(getattr(sheet, name)) for name in ("name", "title", "digest")
    }
    for name in _COURSE_SHAPES:
        if name == "slots" and not len(sheet.slots):
            continue  # a race track, as it was written before there were car parks
        array = np.ascontiguousarray(getattr(sheet, name), "<f8").ravel()
        offsets[name] = builder.CreateNumpyVector(array)
    offsets["sectors"] = builder.CreateNumpyVector(np.array(sheet.sectors, "<u4"))
    CourseTable.Start(builder)
    for name, offset in offsets.items():
        getattr(CourseTable, f"Add{_camel(name)}")(builder, offset)
    for name in _COURSE_NUMBERS:
        getattr(CourseTable, f"Add{_camel(name)}")(builder, getattr(sheet, name))
    builder.Finish(CourseTable.End(builder), topics.COURSE.identifier)
    return bytes(builder.Output())


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def decode_course(data: bytes) -> CourseSheet:
    """Return the course in a message.

    Raises:
        WireError: damaged or foreign, or not finite.
    """
    table = root_of(data, topics.COURSE.identifier, 1 << 24)
    first, count = table.vector(13, U32.size, MOST_TEXTS)
    try:
        root = CourseTable.Course.GetRootAs(data)
        arrays: dict[str, Any] = {}
        for name, columns in _COURSE_SHAPES.items():
            empty = getattr(root, f"{_camel(name)}Length")() == 0
            array = np.zeros(0) if empty else getattr(root, f"{_camel(name)}AsNumpy")()
            arrays[name] = array if columns == 1 else array.reshape(-1, columns)
            if not np.isfinite(array).all():
                raise WireError(f"{name} of a course are not all finite")
        return CourseSheet(
            name=root.Name().decode(),
            title=root.Title().decode(),
            digest=root.Digest().decode(),
            sectors=tuple(np.frombuffer(data, "<u4", count, first).tolist()),
            **{name: getattr(root, _camel(name))() for name in _COURSE_NUMBERS},
            **arrays,
        )
    except _DAMAGE as error:
        raise WireError(f"course is damaged: {error}") from error


def encode_rules(rules: dict[str, str], items: Sequence[str]) -> bytes:
    """Return the rule book as a message."""
    builder = flatbuffers.Builder(2048)
    names = _texts(builder, list(rules))
    values = _texts(builder, list(rules.values()))
    known = _texts(builder, items)
    Rules.Start(builder)
    Rules.AddNames(builder, names)
    Rules.AddValues(builder, values)
    Rules.AddItems(builder, known)
    builder.Finish(Rules.End(builder), topics.RULES.identifier)
    return bytes(builder.Output())


def decode_rules(data: bytes) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the rule book in a message, and the names of the items.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.RULES.identifier, 65536)
    names, values, items = (table.texts(slot, MOST_TEXTS) for slot in range(3))
    return dict(zip(names, values, strict=False)), items
