"""The text messages of browsers, read strictly, and how a browser is refused."""

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from race_server.errors import GatewayError
from race_server.net.wire.strict import MOST_NAME
from race_server.printable import fault_of_name

SUBPROTOCOL = "race.1"
LIVE, RECORDING = "live", "recording:"
# Snapshots that a browser may ask for [1/s].
DEFAULT_RATE, MAX_RATE = 30.0, 60.0
MAX_SEAT = 63
# Of the range for applications, near the HTTP statuses that mean the same.
CLOSE_CODES = {
    "malformed": 4400,
    "token": 4401,
    "origin": 4403,
    "no-recording": 4404,
    "late": 4408,
    "seat-taken": 4409,
    "used": 4410,
    "seat-lost": 4411,
    "too-large": 4413,
    "slow": 4414,
    "too-fast": 4429,
    "full": 4430,
    "no-race": 4503,
}
# A closing frame has room for this much of a reason [bytes].
MAX_REASON = 120


class Role(StrEnum):
    """What a browser may do."""

    SPECTATE = "spectate"
    DRIVE = "drive"
    STEWARD = "steward"
    COMPANION = "companion"  # beside the driver of a seat: sees what that driver must see


@dataclass(frozen=True)
class Hello:
    """The first message of a browser: its role, and what it wants to see."""

    role: Role = Role.SPECTATE
    token: str = ""
    seat: int = -1
    name: str = ""
    source: str = LIVE
    rate: float = DEFAULT_RATE
    resume: str = ""

    @property
    def recording(self) -> str:
        """The name of the recording to play, empty for the live race."""
        return self.source.removeprefix(RECORDING) if self.source != LIVE else ""


def read_message(text: str | None) -> dict[str, Any]:
    """Return a text message as a dictionary.

    Raises:
        GatewayError: it is no JSON object.
    """
    if text is None:
        raise GatewayError("malformed", "bytes where words are expected; send JSON as text")
    try:
        message = json.loads(text)
    # A thousand brackets are a thousand recursive calls.
    except (ValueError, RecursionError) as error:
        raise GatewayError("malformed", f"no JSON: {str(error)[:80]}") from error
    if not isinstance(message, dict):
        raise GatewayError("malformed", "JSON, but no object")
    return message


def read_hello(text: str | None) -> Hello:
    """Return the first message of a browser.

    Raises:
        GatewayError: it is no JSON, or not what a first message holds.
    """
    message = read_message(text)
    role = read_text(message, "role", 16) or Role.SPECTATE
    if role not in set(Role):
        raise GatewayError("malformed", f"role {role!r} is unknown; choose {', '.join(Role)}")
    name = read_text(message, "name", MOST_NAME).strip()
    if fault := name and fault_of_name(name):
        raise GatewayError(
            "malformed", f"name has {fault}: use up to {MOST_NAME} printable characters"
        )
    source = read_text(message, "source", 160) or LIVE
    if source != LIVE and not source.startswith(RECORDING):
        raise GatewayError("malformed", f"source {source!r}: choose live or recording:NAME")
    return Hello(
        role=Role(role),
        token=read_text(message, "token", 128),
        seat=read_int(message, "seat", -1, MAX_SEAT, default=-1),
        name=name,
        source=source,
        rate=read_number(message, "rate", 1.0, MAX_RATE, default=DEFAULT_RATE),
        resume=read_text(message, "resume", 128),
    )


def read_text(message: dict[str, Any], name: str, most: int) -> str:
    """Return a text of at most `most` characters, empty where it is missing.

    Raises:
        GatewayError: it is no text, or longer, or has half a character, which UTF-8 has not.
    """
    value = message.get(name, "")
    if not isinstance(value, str) or len(value) > most:
        raise GatewayError("malformed", f"{name}: write up to {most} characters")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise GatewayError("malformed", f"{name}: half a character; write text") from error
    return value


def read_number(
    message: dict[str, Any], name: str, least: float, most: float, *, default: float
) -> float:
    """Return a number, moved into its bounds.

    Raises:
        GatewayError: it is no number.
    """
    value = message.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise GatewayError("malformed", f"{name}: write a number from {least:g} to {most:g}")
    return float(min(max(value, least), most))


def read_int(message: dict[str, Any], name: str, least: int, most: int, *, default: int) -> int:
    """Return a whole number within bounds.

    Raises:
        GatewayError: it is no whole number, or outside of them.
    """
    value = message.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise GatewayError("malformed", f"{name}: write a whole number from {least} to {most}")
    return value


def read_bool(message: dict[str, Any], name: str) -> bool:
    """Return true or false, false where it is missing.

    Raises:
        GatewayError: it is neither.
    """
    value = message.get(name, False)
    if not isinstance(value, bool):
        raise GatewayError("malformed", f"{name}: write true or false")
    return value


def refusal_text(error: GatewayError) -> str:
    """Return the message that a browser gets before its socket closes."""
    return json.dumps({"type": "refused", "code": error.code, "reason": str(error)})


def close_reason(error: GatewayError) -> str:
    """Return the reason as far as it fits into a closing frame."""
    return f"{error.code}: {error}".encode(errors="replace")[:MAX_REASON].decode(errors="ignore")
