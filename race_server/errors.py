"""What can go wrong, in one tree. A message names the thing, the value and the way out."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum


class Reason(StrEnum):
    """Why a server refuses a message. All reasons are here: no sender can add one."""

    DAMAGED = "damaged"
    FOREIGN = "foreign"
    OVERSIZED = "oversized"
    OUT_OF_RANGE = "out of range"
    UNKNOWN_KEY = "request on no key of ours"
    TOO_MANY = "too many requests"
    CALLBACK = "message that a callback failed on"
    CONTROL_BADGE = "control without the seat's badge"
    POSE_BADGE = "pose without the seat's badge"
    ALERT_BADGE = "alert without the seat's badge"
    TELEMETRY_BADGE = "telemetry without the seat's badge"
    SECOND_LOGIN = "second login"
    TOO_MANY_LINKS = "link beyond those of its key"
    BARRED_LINK = "link of a key that is barred"
    STEWARD_ADDRESS = "link of another at the steward's address"
    AGAIN = "again"
    EPOCH = "of another epoch"
    FUTURE = "answer to the future"
    KART_KIND = "control of a real kart, or pose of a simulated one"
    VERSION = "another version of the protocol"
    SECRET = "the secret does not fit"
    OTHER_SEAT = "claims another seat"
    OBSERVATION = "unknown observation"
    SEAT = "the seat cannot be had"
    STEWARD = "not the steward"
    DECISION = "not possible for a steward"
    DRIVER = "a driver failed"


class RaceError(Exception):
    """Anything that this project raises on purpose."""


class TrackError(RaceError):
    """A course file cannot be read, or describes no course."""


class LotError(TrackError):
    """The file of a car park cannot be read, or describes none."""


class VehicleError(RaceError):
    """A vehicle is unknown, or its figures make no vehicle."""


class ScenarioError(RaceError):
    """A race cannot be set up as asked."""


class PlanError(RaceError):
    """There is no path from one pose to another, or none was found in time."""


class DriverError(RaceError):
    """A driver is unknown or cannot be started."""


class WireError(RaceError):
    """A message from outside is damaged, oversized, foreign or out of range."""

    def __init__(self, message: str, reason: Reason = Reason.DAMAGED) -> None:
        """Give the sentence and what a refusal is counted as."""
        super().__init__(message)
        self.reason = reason


class SeatError(RaceError):
    """A seat is taken, unknown or not in the state that a request needs."""

    def __init__(self, message: str, reason: Reason = Reason.SEAT) -> None:
        """Give the sentence and what a refusal is counted as."""
        super().__init__(message)
        self.reason = reason


class LinkError(RaceError):
    """No server answers at an address, or an address cannot be listened on."""


class KeysError(RaceError):
    """Keys cannot be read or made, have expired, or belong to another session."""


class RecordingError(RaceError):
    """A recording cannot be read."""


class ResultsError(RaceError):
    """The results file is locked, damaged or too new, or cannot give what is asked."""


class GatewayError(RaceError):
    """A browser is not let in, or let go; `code` says why in a word."""

    def __init__(self, code: str, reason: str) -> None:
        """Give the word and the sentence."""
        super().__init__(reason)
        self.code = code


@contextmanager
def brought_by(extra: str) -> Iterator[None]:
    """Import inside of this what only an extra of ours brings.

    Raises:
        ScenarioError: one of its packages is not installed.
    """
    try:
        yield
    except ImportError as error:
        missing = (error.name or "a package").split(".")[0]
        raise ScenarioError(
            f"{missing} is not installed: `pip install race-server[{extra}]` brings it, or in a "
            "clone `make setup`"
        ) from error
