"""Which seat of a session a driver is given."""

from dataclasses import dataclass

from race_server.core.observation import PRESETS
from race_server.credentials import key_of
from race_server.errors import Reason, SeatError
from race_server.session.seats import Seat, Seats


@dataclass(frozen=True)
class Newcomer:
    """A driver that asks for a seat; see `Session.join`."""

    driver: str
    preset: str
    wanted: int = -1
    secret: int = 0
    tracked: bool = False
    owns: bool = False


def held_seat(newcomer: Newcomer, seats: Seats) -> Seat | None:
    """Return the seat that a newcomer has already, or resumes with a new secret.

    Raises:
        SeatError: its observation preset is unknown.
    """
    if newcomer.preset not in PRESETS:
        known = ", ".join(PRESETS)
        raise SeatError(
            f"observation {newcomer.preset!r} is unknown; choose one of {known}",
            Reason.OBSERVATION,
        )
    if own := seats.held_by(newcomer.secret, newcomer.wanted):
        return own
    if newcomer.owns and (deserted := seats.deserted(newcomer.wanted, newcomer.preset)):
        deserted.key = key_of(newcomer.secret)
        return deserted
    return None


def free_seat(newcomer: Newcomer, seats: Seats, *, is_lobby: bool, takes_tracked: bool) -> Seat:
    """Return the free seat that a newcomer may take.

    Raises:
        SeatError: none is free, the wanted one is taken, the race has begun, or no real kart can
            take part.
    """
    wanted = newcomer.wanted
    if newcomer.owns and wanted in seats and seats[wanted].is_present:
        raise SeatError(
            f"seat {wanted} is in use: a client is logged in with its keys already",
            Reason.SECOND_LOGIN,
        )
    if not is_lobby:
        seats.check_open(wanted)
        raise SeatError("the race has begun; join again in the next lobby")
    if newcomer.tracked and not takes_tracked:
        raise SeatError("a real kart cannot wait for others; serve with --pace real")
    return seats.free_one(wanted)
