"""What browsers say in words, read strictly."""

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from race_server.errors import GatewayError
from race_server.live.gateway.limits import MOST_TEXT

SUBPROTOCOL = "race.1"
LIVE, RECORDING = "live", "recording:"
DEFAULT_HZ, MOST_HZ = 30.0, 60.0
MOST_SEAT = 63


class Role(StrEnum):
    """What a browser may do."""

    SPECTATE = "spectate"
    DRIVE = "drive"
    STEWARD = "steward"


@dataclass(frozen=True)
class Hello:
    """The first message of a browser: who it is and what it wants to see."""

    role: Role = Role.SPECTATE
    token: str = ""
    seat: int = -1
    name: str = ""
    source: str = LIVE
    rate: float = DEFAULT_HZ
    resume: str = ""

    @property
    def recording(self) -> str:
        """The name of the recording that it wants to see, empty for the live race."""
        return self.source.removeprefix(RECORDING) if self.source != LIVE else ""


def read_words(text: str | bytes | None) -> dict[str, Any]:
    """Return a message in words as a dictionary with a type.

    Raises:
        GatewayError: too long, or no JSON object.
    """
    if not isinstance(text, str):
        raise GatewayError("malformed", "bytes where words are expected; send JSON as text")
    if len(text.encode()) > MOST_TEXT:
        raise GatewayError("too-large", f"a message of more than {MOST_TEXT} bytes; send less")
    try:
        words = json.loads(text)
    # A thousand brackets are a thousand calls.
    except (ValueError, RecursionError) as error:
        raise GatewayError("malformed", f"no JSON: {str(error)[:80]}") from error
    if not isinstance(words, dict):
        raise GatewayError("malformed", "JSON, but no object")
    return words


def read_hello(text: str | bytes | None) -> Hello:
    """Return the first message of a browser.

    Raises:
        GatewayError: too long, no JSON, or not what a first message holds.
    """
    words = read_words(text)
    role = read_text(words, "role", 16) or Role.SPECTATE
    if role not in set(Role):
        raise GatewayError("malformed", f"role {role!r} is unknown; choose {', '.join(Role)}")
    name = read_text(words, "name", 32)
    if not name.isprintable():
        raise GatewayError("malformed", "name: use up to 32 printable characters")
    source = read_text(words, "source", 160) or LIVE
    if source != LIVE and not source.startswith(RECORDING):
        raise GatewayError("malformed", f"source {source!r}: choose live or recording:NAME")
    return Hello(
        role=Role(role),
        token=read_text(words, "token", 128),
        seat=read_int(words, "seat", -1, MOST_SEAT, default=-1),
        name=name,
        source=source,
        rate=read_number(words, "rate", 1.0, MOST_HZ, default=DEFAULT_HZ),
        resume=read_text(words, "resume", 128),
    )


def read_text(words: dict[str, Any], name: str, most: int) -> str:
    """Return a text of at most `most` characters, empty where it is not there.

    Raises:
        GatewayError: it is no text, or longer.
    """
    value = words.get(name, "")
    if not isinstance(value, str) or len(value) > most:
        raise GatewayError("malformed", f"{name}: write up to {most} characters")
    return value


def read_number(
    words: dict[str, Any], name: str, least: float, most: float, *, default: float
) -> float:
    """Return a number within bounds; what lies outside of them is moved to the nearest.

    Raises:
        GatewayError: it is no number.
    """
    value = words.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise GatewayError("malformed", f"{name}: write a number from {least:g} to {most:g}")
    return float(min(max(value, least), most))


def read_int(words: dict[str, Any], name: str, least: int, most: int, *, default: int) -> int:
    """Return a whole number within bounds.

    Raises:
        GatewayError: it is no whole number, or outside of them.
    """
    value = words.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise GatewayError("malformed", f"{name}: write a whole number from {least} to {most}")
    return value


def read_bool(words: dict[str, Any], name: str) -> bool:
    """Return a true or false, false where it is not there.

    Raises:
        GatewayError: it is neither.
    """
    value = words.get(name, False)
    if not isinstance(value, bool):
        raise GatewayError("malformed", f"{name}: write true or false")
    return value
