"""Encode and decode the steward's requests and their answers."""

import struct
from dataclasses import dataclass

import flatbuffers

from race_server.net.wire import topics
from race_server.net.wire.generated.session import AdminLog, AdminRequest
from race_server.net.wire.lobby import check_reply
from race_server.net.wire.strict import MOST_NAME, root_of

I16, U64, F64 = struct.Struct("<h"), struct.Struct("<Q"), struct.Struct("<d")
LOG_ID, REPLY_ID = b"RALG", b"RRPL"
MOST_LOG, MOST_LINES = 1 << 18, 1024


@dataclass(frozen=True, slots=True)
class Decision:
    """A request of a steward."""

    token: str
    act: str = ""
    seat: int = -1
    value: float = 0.0
    challenge: int = 0
    who: str = ""


def encode_decision(decision: Decision) -> bytes:
    """Return a steward's request as a message."""
    builder = flatbuffers.Builder(128)
    token, act = builder.CreateString(decision.token), builder.CreateString(decision.act)
    who = builder.CreateString(decision.who[:MOST_NAME])
    AdminRequest.Start(builder)
    AdminRequest.AddToken(builder, token)
    AdminRequest.AddAct(builder, act)
    AdminRequest.AddSeat(builder, decision.seat)
    AdminRequest.AddValue(builder, decision.value)
    AdminRequest.AddChallenge(builder, decision.challenge)
    AdminRequest.AddWho(builder, who)
    builder.Finish(AdminRequest.End(builder), topics.ACT.identifier)
    return bytes(builder.Output())


def decode_decision(data: bytes) -> Decision:
    """Return the steward's request in a message.

    Raises:
        WireError: damaged, oversized or foreign.
    """
    table = root_of(data, topics.ACT.identifier, topics.ACT.most_bytes)
    place = table.field(2, 2)
    return Decision(
        token=table.text(0, 64),
        act=table.text(1, 16),
        seat=int(I16.unpack_from(data, place)[0]) if place else -1,
        value=table.number(3, F64),
        challenge=table.scalar(4, U64),
        who=table.name(5, least=0),
    )


def encode_log(challenge: int, lines: list[str]) -> bytes:
    """Return the decisions so far, and the challenge for the next request, as a message."""
    builder = flatbuffers.Builder(1024)
    texts = [builder.CreateString(line) for line in lines[-MOST_LINES:]]
    AdminLog.StartLinesVector(builder, len(texts))
    for text in reversed(texts):
        builder.PrependUOffsetTRelative(text)
    vector = builder.EndVector()
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
