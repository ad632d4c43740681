"""What a browser may say after its first message, as one table: every field of every message."""

from collections.abc import Callable
from functools import partial
from typing import Any

from race_server.errors import GatewayError
from race_server.live.gateway.handshake import (
    MAX_RATE,
    MAX_SEAT,
    read_bool,
    read_int,
    read_message,
    read_number,
    read_text,
)
from race_server.net.wire.admin import MOST_NOTE

Request = dict[str, Any]
Reader = Callable[[Request, str], Any]

# Bounds of a browser's clock [ms], of a penalty [s], of a tick, and of the speed of a recording, in
# times real time.
MAX_TIME, MAX_VALUE, MAX_TICK = 1e15, 1e6, 1 << 31
MIN_SPEED, MAX_SPEED = 0.1, 16.0
# Number of a protest.
MAX_PROTEST = 9999

# The messages for a player of a recording.
PLAYER_REQUESTS = ("play", "pause", "seek", "step")

_SEAT = partial(read_int, least=-1, most=MAX_SEAT, default=-1)
REQUESTS: dict[str, dict[str, Reader]] = {
    "ping": {"t": partial(read_number, least=-MAX_TIME, most=MAX_TIME, default=0.0)},
    "follow": {"seat": _SEAT, "rays": read_bool},
    "rate": {"rate": partial(read_number, least=1.0, most=MAX_RATE, default=MAX_RATE)},
    "play": {"speed": partial(read_number, least=MIN_SPEED, most=MAX_SPEED, default=1.0)},
    "pause": {},
    "seek": {"tick": partial(read_int, least=0, most=MAX_TICK, default=0)},
    "step": {"ticks": partial(read_int, least=-MAX_TICK, most=MAX_TICK, default=1)},
    "ready": {"ready": read_bool},
    "park": {"park": read_bool},
    "leave": {},
    "use": {},
    "act": {
        "id": partial(read_int, least=0, most=1 << 53, default=0),
        "act": partial(read_text, most=16),
        "seat": _SEAT,
        "value": partial(read_number, least=-MAX_VALUE, most=MAX_VALUE, default=0.0),
        "against": _SEAT,
        "protest": partial(read_int, least=0, most=MAX_PROTEST, default=0),
        "note": partial(read_text, most=MOST_NOTE),
    },
    "protest": {"against": _SEAT, "why": partial(read_text, most=MOST_NOTE)},
    "log": {},
}


def read_request(text: str | None) -> Request:
    """Return a message: its `type`, and every field of that type within its bounds.

    Raises:
        GatewayError: it is no JSON, of an unknown type, or a field of it is malformed.
    """
    message = read_message(text)
    kind = read_text(message, "type", 16)
    if kind not in REQUESTS:
        raise GatewayError("malformed", f"{kind!r} means nothing here")
    fields = {name: read(message, name) for name, read in REQUESTS[kind].items()}
    return {"type": kind, **fields}
