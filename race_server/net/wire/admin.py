"""Encode and decode the steward's requests and their answers."""

import itertools
from dataclasses import dataclass

import flatbuffers

from race_server.errors import Reason, SeatError, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.session import AdminLog, AdminRequest
from race_server.net.wire.lobby import check_reply
from race_server.net.wire.rows import build_vector
from race_server.net.wire.strict import F64, I16, MOST_NAME, U16, U64, UTF8_BYTES, Table, root_of

LOG_ID, REPLY_ID = b"RALG", b"RRPL"
MOST_LOG, MOST_LINES = 1 << 18, 1024
# What a message needs besides the text of its lines, and for each of them: its place, its length,
# the zero at its end, and up to three bytes to the next multiple of four.
_HEAD_BYTES, _LINE_BYTES = 64, 12
# Characters of the reason for a protest.
MOST_NOTE = 120


@dataclass(frozen=True, slots=True)
class Decision:
    """A request of a steward."""

    token: str
    act: str = ""
    seat: int = -1
    value: float = 0.0
    challenge: int = 0
    who: str = ""
    against: int = -1  # of a protest: seat of the team that it is against
    protest: int = 0  # its number
    note: str = ""


def encode_decision(decision: Decision) -> bytes:
    """Return a steward's request as a message.

    Raises:
        SeatError: its reason is too long.
    """
    if fault := _fault_of(decision.note):
        raise SeatError(fault, Reason.DECISION)
    builder = flatbuffers.Builder(128)
    token, act = builder.CreateString(decision.token), builder.CreateString(decision.act)
    who = builder.CreateString(decision.who[:MOST_NAME])
    note = builder.CreateString(decision.note) if decision.note else 0
    AdminRequest.Start(builder)
    AdminRequest.AddToken(builder, token)
    AdminRequest.AddAct(builder, act)
    AdminRequest.AddSeat(builder, decision.seat)
    AdminRequest.AddValue(builder, decision.value)
    AdminRequest.AddChallenge(builder, decision.challenge)
    AdminRequest.AddWho(builder, who)
    AdminRequest.AddAgainst(builder, decision.against)
    AdminRequest.AddProtest(builder, decision.protest)
    if note:
        AdminRequest.AddNote(builder, note)
    builder.Finish(AdminRequest.End(builder), topics.ACT.identifier)
    return bytes(builder.Output())


def decode_decision(data: bytes) -> Decision:
    """Return the steward's request in a message.

    Raises:
        WireError: damaged, oversized or foreign.
    """
    table = root_of(data, topics.ACT.identifier, topics.ACT.most_bytes)
    note = table.text(8, MOST_NOTE * UTF8_BYTES) if table.field(8, 4) else ""
    if fault := _fault_of(note):
        raise WireError(fault)
    return Decision(
        token=table.text(0, 64),
        act=table.text(1, 16),
        seat=_seat_in(table, 2),
        value=table.number(3, F64),
        challenge=table.scalar(4, U64),
        who=table.name(5, least=0),
        against=_seat_in(table, 6),
        protest=table.scalar(7, U16),
        note=note,
    )


def _fault_of(note: str) -> str:
    """Return what is wrong with a reason, "" for nothing."""
    if len(note) > MOST_NOTE:
        return f"the reason has {len(note)} characters: give at most {MOST_NOTE}"
    return "" if note.isprintable() else f"reason {note!r}: use printable characters"


def _seat_in(table: Table, slot: int) -> int:
    place = table.field(slot, I16.size)
    return int(I16.unpack_from(table.data, place)[0]) if place else -1


def encode_log(challenge: int, lines: list[str]) -> bytes:
    """Return the decisions so far, and the challenge for the next request, as a message.

    Of more than it has room for the oldest are left out.
    """
    builder = flatbuffers.Builder(1024)
    newest = lines[-MOST_LINES:]
    ends = itertools.accumulate(len(line.encode()) + _LINE_BYTES for line in reversed(newest))
    count = sum(end <= MOST_LOG - _HEAD_BYTES for end in ends)
    texts = [builder.CreateString(line) for line in newest[len(newest) - count :]]
    vector = build_vector(builder, texts)
    AdminLog.Start(builder)
    AdminLog.AddChallenge(builder, challenge)
    AdminLog.AddLines(builder, vector)
    builder.Finish(AdminLog.End(builder), LOG_ID)
    return bytes(builder.Output())


def decode_log(data: bytes) -> tuple[int, list[str]]:
    """Return the challenge for the next request, and the decisions so far.

    Raises:
        SeatError: the server refused, with its reason.
        WireError: damaged or foreign.
    """
    if data[4:8] == REPLY_ID:
        check_reply(data)
    table = root_of(data, LOG_ID, MOST_LOG)
    return table.scalar(0, U64), list(table.texts(1, MOST_LINES))
