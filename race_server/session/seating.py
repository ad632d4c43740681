"""Which seat of a session a driver is given."""

from collections.abc import Sequence
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


def known_seat(
    newcomer: Newcomer, seats: Seats, racing: Sequence[Seat], *, in_event: bool, is_over: bool
) -> Seat | None:
    """Return the seat that a newcomer has already, or resumes with a new secret.

    racing: the seats that take part in the race that is on; in_event: all drivers keep their seats;
    is_over: the event, where there was one.

    Raises:
        SeatError: its observation preset is unknown, or it is no driver of the event.
    """
    seat = _held_seat(newcomer, seats)
    if seat is None and in_event:
        if is_over:
            raise SeatError("the event is over; start the server again for another one")
        seat = _returning_seat(newcomer, seats, racing)
    if seat is not None:
        seat.come_back()
    return seat


def _held_seat(newcomer: Newcomer, seats: Seats) -> Seat | None:
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


def _returning_seat(newcomer: Newcomer, seats: Seats, racing: Sequence[Seat]) -> Seat:
    """Return the seat of a driver of an event whose program was started again.

    It is known by its name, or in a session with keys by its seat. Of several of one name it is the
    first that the newcomer may have.
    """
    refused = SeatError(
        f"an event is on, and no {newcomer.driver!r} of it is away: its drivers are those that "
        "were there when it began"
    )
    for seat in seats.taken():
        own = newcomer.wanted == seat.number if newcomer.owns else newcomer.driver == seat.driver
        if not own or seat.is_present or newcomer.wanted not in {-1, seat.number}:
            continue
        try:
            seats.check_open(seat.number)
            _check_kind(newcomer, seat, is_racing=seat in racing)
        except SeatError as error:
            refused = error
            continue
        seat.preset, seat.key = newcomer.preset, key_of(newcomer.secret)
        return seat
    raise refused


def _check_kind(newcomer: Newcomer, seat: Seat, *, is_racing: bool) -> None:
    """Do nothing for a newcomer with the kind of kart of a seat, and what it observes in a race.

    Raises:
        SeatError: it has another one.
    """
    if newcomer.tracked != seat.is_tracked:
        kinds = ("simulated", "a real one")
        raise SeatError(
            f"the kart of seat {seat.number} is {kinds[seat.is_tracked]} in this event, "
            f"not {kinds[newcomer.tracked]}"
        )
    if is_racing and newcomer.preset != seat.preset:
        raise SeatError(
            f"seat {seat.number} drives now with observation {seat.preset!r}, not "
            f"{newcomer.preset!r}; come back when it is over",
            Reason.OBSERVATION,
        )
