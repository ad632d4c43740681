"""Encode and decode what spectators are sent of an event: what is on, what comes, who leads."""

import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import flatbuffers
import numpy as np

from race_server.core.bounds import MOST_ROUNDS
from race_server.core.messages import EventPhase
from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.spectate import Call as CallTable
from race_server.net.wire.generated.spectate import DeletedLap as DeletedLapTable
from race_server.net.wire.generated.spectate import Programme
from race_server.net.wire.generated.spectate import Protest as ProtestTable
from race_server.net.wire.generated.spectate import Team as TeamTable
from race_server.net.wire.rows import build_vector
from race_server.net.wire.strict import F64, I32, I64, U8, U16, U32, U64, Table, root_of

MOST_TEAMS, MOST_CALLS, MOST_DELETED, MOST_PROTESTS = 64, 16, 64, 64
MOST_ATTEMPTS = MOST_ROUNDS
# Characters of a text; the rest is cut off when it is written.
MOST_TEXT = 160

Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class DeletedLap:
    """A lap of an attempt that does not count; both are counted from 1."""

    attempt: int
    lap: int
    why: str


@dataclass(frozen=True, slots=True)
class TeamRow:
    """How a team fares in an event; times are in microseconds."""

    name: str
    seat: int
    place: int  # in the classification so far, from 1; 0: not classified
    points: int
    time_us: int  # that counts in the time trial that is on, or was last; 0: none yet
    attempts_us: tuple[int, ...] = ()  # in it; 0: failed
    attempts_left: int = 0  # in it, with the one that is driven
    deleted: tuple[DeletedLap, ...] = ()  # in it
    remark: str = ""
    can_change: bool = False  # its last result: others may protest against it


@dataclass(frozen=True, slots=True)
class ProtestRow:
    """A protest of a team, or a decision that the stewards took by themselves."""

    number: int
    title: str  # of the attempt or race
    by: str  # team; empty for the stewards
    against: str  # team
    why: str
    outcome: str  # empty while it is open


@dataclass(frozen=True, slots=True)
class Call:
    """An attempt or a race, with its teams, pole position first where that is known."""

    title: str
    teams: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ProgrammeFrame:
    """An event as it stands."""

    event: str
    title: str  # of its format
    phase: EventPhase
    now: Call | None  # what is called, driven or was driven last
    limit_s: float  # of it from the lights, 0 for none
    until_us: int  # of the server's clock: when the call or the review ends, 0 if unknown
    driven: int  # attempts and races so far
    drives: int  # of the whole event
    has_points: bool
    attempts: int  # of each team in the time trial that is on, 0 in races
    coming: tuple[Call, ...]  # of the same stage, or of the same round of races
    teams: tuple[TeamRow, ...]  # best place first
    stage: str  # name of the stage that `now` is of
    protests: tuple[ProtestRow, ...] = ()  # oldest first

    def as_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {**asdict(self), "phase": self.phase.name.lower()}


def encode_programme(frame: ProgrammeFrame) -> bytes:
    """Return an event as a message.

    Of a large event it holds only the newest deleted laps of each team, the newest protests and the
    calls that come next, as many of each as fit into what a client reads.
    """
    most = MOST_DELETED
    while len(data := _encoded(frame, most)) > topics.PROGRAMME.most_bytes and most:
        most //= 2
    return data


def _encoded(frame: ProgrammeFrame, most: int) -> bytes:
    """Return an event as a message. most: deleted laps of a team, protests, calls that come."""
    builder = flatbuffers.Builder(1024)
    teams = build_vector(
        builder, [_add_team(builder, row, most) for row in frame.teams[:MOST_TEAMS]]
    )
    next_calls = frame.coming[: min(most, MOST_CALLS)]
    coming = build_vector(builder, [_add_call(builder, one) for one in next_calls])
    kept = [_add_protest(builder, row) for row in _newest(frame.protests, min(most, MOST_PROTESTS))]
    protests = build_vector(builder, kept) if kept else 0
    now = _add_call(builder, frame.now) if frame.now else 0
    event, title, stage = (_text(builder, text) for text in (frame.event, frame.title, frame.stage))
    Programme.Start(builder)
    Programme.AddEvent(builder, event)
    Programme.AddTitle(builder, title)
    Programme.AddPhase(builder, int(frame.phase))
    if now:
        Programme.AddNow(builder, now)
    Programme.AddLimit(builder, frame.limit_s)
    Programme.AddUntilUs(builder, frame.until_us)
    Programme.AddDriven(builder, frame.driven)
    Programme.AddDrives(builder, frame.drives)
    Programme.AddHasPoints(builder, frame.has_points)
    Programme.AddAttempts(builder, frame.attempts)
    Programme.AddComing(builder, coming)
    Programme.AddTeams(builder, teams)
    Programme.AddStage(builder, stage)
    if protests:
        Programme.AddProtests(builder, protests)
    builder.Finish(Programme.End(builder), topics.PROGRAMME.identifier)
    return bytes(builder.Output())


def _newest(rows: tuple[Row, ...], most: int) -> tuple[Row, ...]:
    return rows[max(len(rows) - most, 0) :]


def _add_team(builder: Any, row: TeamRow, most_deleted: int) -> int:
    laps = _newest(row.deleted, most_deleted)
    deleted = build_vector(builder, [_add_deleted(builder, lap) for lap in laps])
    attempts = builder.CreateNumpyVector(np.array(row.attempts_us[:MOST_ATTEMPTS], np.int64))
    name, remark = _text(builder, row.name), _text(builder, row.remark)
    TeamTable.Start(builder)
    TeamTable.AddName(builder, name)
    TeamTable.AddSeat(builder, row.seat)
    TeamTable.AddPlace(builder, row.place)
    TeamTable.AddPoints(builder, row.points)
    TeamTable.AddTimeUs(builder, row.time_us)
    TeamTable.AddAttemptsUs(builder, attempts)
    TeamTable.AddAttemptsLeft(builder, row.attempts_left)
    TeamTable.AddDeleted(builder, deleted)
    TeamTable.AddRemark(builder, remark)
    TeamTable.AddCanChange(builder, row.can_change)
    return int(TeamTable.End(builder))


def _add_protest(builder: Any, row: ProtestRow) -> int:
    words = (row.title, row.by, row.against, row.why, row.outcome)
    title, by, against, why, outcome = (_text(builder, text) for text in words)
    ProtestTable.Start(builder)
    ProtestTable.AddNumber(builder, row.number)
    ProtestTable.AddTitle(builder, title)
    ProtestTable.AddBy(builder, by)
    ProtestTable.AddAgainst(builder, against)
    ProtestTable.AddWhy(builder, why)
    ProtestTable.AddOutcome(builder, outcome)
    return int(ProtestTable.End(builder))


def _add_deleted(builder: Any, lap: DeletedLap) -> int:
    why = _text(builder, lap.why)
    DeletedLapTable.Start(builder)
    DeletedLapTable.AddAttempt(builder, lap.attempt)
    DeletedLapTable.AddLap(builder, lap.lap)
    DeletedLapTable.AddWhy(builder, why)
    return int(DeletedLapTable.End(builder))


def _add_call(builder: Any, call: Call) -> int:
    teams = build_vector(builder, [_text(builder, name) for name in call.teams[:MOST_TEAMS]])
    title = _text(builder, call.title)
    CallTable.Start(builder)
    CallTable.AddTitle(builder, title)
    CallTable.AddTeams(builder, teams)
    return int(CallTable.End(builder))


def _text(builder: Any, text: str) -> int:
    return int(builder.CreateString(text[:MOST_TEXT]))


def decode_programme(data: bytes) -> ProgrammeFrame:
    """Return the event in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.PROGRAMME.identifier, topics.PROGRAMME.most_bytes)
    room, phase = _Room(len(data)), table.scalar(2, U8)
    if phase > max(EventPhase):
        raise WireError(f"event of phase {phase}; at most {int(max(EventPhase))}")
    now = table.table(3)
    return ProgrammeFrame(
        event=room.text(table, 0),
        title=room.text(table, 1),
        phase=EventPhase(phase),
        now=room.call(now) if now else None,
        limit_s=table.number(4, F64),
        until_us=table.scalar(5, U64),
        driven=table.scalar(6, U32),
        drives=table.scalar(7, U32),
        has_points=bool(table.scalar(8, U8)),
        attempts=table.scalar(9, U16),
        coming=tuple(room.call(one) for one in table.tables(10, MOST_CALLS)),
        teams=tuple(room.team(one) for one in table.tables(11, MOST_TEAMS)),
        stage=room.text(table, 12),
        protests=tuple(room.protests(table)),
    )


class _Room:
    """What is read from a message is together no longer than it: parts may point at one place."""

    def __init__(self, size: int) -> None:
        self._left = size

    def _take(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise WireError("parts of an event lie in one another")

    def text(self, table: Table, slot: int) -> str:
        text = table.text(slot, 4 * MOST_TEXT)
        self._take(len(text))
        return text

    def call(self, table: Table) -> Call:
        names = table.texts(1, MOST_TEAMS)
        self._take(sum(map(len, names)) + U32.size * len(names))
        return Call(self.text(table, 0), names)

    def team(self, row: Table) -> TeamRow:
        first, count = row.vector(5, I64.size, MOST_ATTEMPTS)
        self._take(I64.size * count)
        return TeamRow(
            name=self.text(row, 0),
            seat=row.scalar(1, U16),
            place=row.scalar(2, U16),
            points=row.scalar(3, I32),
            time_us=row.scalar(4, I64),
            attempts_us=struct.unpack_from(f"<{count}q", row.data, first),
            attempts_left=row.scalar(6, U16),
            deleted=tuple(self._deleted(lap) for lap in row.tables(7, MOST_DELETED)),
            remark=self.text(row, 8),
            can_change=bool(row.scalar(9, U8)),
        )

    def protests(self, table: Table) -> Iterator[ProtestRow]:
        """Yield the protests; recordings from before there were any have none."""
        if not table.field(13, U32.size):
            return
        for row in table.tables(13, MOST_PROTESTS):
            self._take(U32.size)
            yield ProtestRow(row.scalar(0, U16), *(self.text(row, slot) for slot in range(1, 6)))

    def _deleted(self, lap: Table) -> DeletedLap:
        self._take(U32.size)
        return DeletedLap(lap.scalar(0, U32), lap.scalar(1, U32), self.text(lap, 2))
