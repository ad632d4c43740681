"""The seats of a session: their drivers, which of them are there, and which seats are closed."""

import secrets
from collections.abc import Iterator
from dataclasses import dataclass

from race_server.core.messages import Control, PlannedWay
from race_server.credentials import key_of
from race_server.errors import SeatError
from race_server.session.failsafe import AWAY_TICKS, STOP, FailsafeStage
from race_server.session.interventions import Intervention, InterventionKind

# Why a seat is closed; the place of each is the value of the act that closes it.
CLOSED_FOR = ("by the steward", "the steward sent its driver away")


@dataclass
class Seat:
    """One place in the race and its driver."""

    number: int
    driver: str = ""
    preset: str = ""
    key: bytes = b""  # follows from the driver's secret
    is_taken: bool = False
    is_ready: bool = False
    is_present: bool = False
    is_tracked: bool = False  # a real kart: it sends poses instead of controls
    control: Control = STOP
    control_tick: int = -1  # tick at which the control arrived
    answered_tick: int = -1  # tick of the observation that it answers
    sequence: int = 0  # of the newest message taken
    away_since: int = -1
    silence: FailsafeStage = FailsafeStage.FRESH  # how the driver's silence acts on the kart
    is_led: bool = False  # the parking driver of the server has the wheel
    keeps_wheel: bool = False  # it was given back, and no order has come since
    orders: int = 0  # to park, in this race
    planned: PlannedWay | None = None  # of the task that the driver was given, once it is known
    uses_item: bool = False  # a person beside the driver has pressed the item button

    def fits(self, secret: int) -> bool:
        """Return whether a secret is that of the seat's driver."""
        return secrets.compare_digest(self.key, key_of(secret))

    def assign(self, driver: str, preset: str, secret: int, *, is_tracked: bool) -> None:
        """Give the seat to a driver. secret: 0 for one that is drawn and known to no client."""
        self.driver, self.preset = driver, preset
        self.key = key_of(secret or secrets.randbits(63) | 1)
        self.is_taken, self.is_ready, self.is_present = True, False, True
        self.is_tracked = is_tracked

    def come_back(self) -> None:
        """Record that the driver is there again."""
        self.is_present = True
        self.away_since = -1

    def is_gone(self, tick: int) -> bool:
        """Return whether the driver has been away for `AWAY_TICKS`: it counts as withdrawn."""
        return 0 <= self.away_since <= tick - AWAY_TICKS

    def line_up(self) -> None:
        """Forget what was received in the last race."""
        self.control, self.control_tick, self.answered_tick = STOP, -1, -1
        self.sequence, self.silence = 0, FailsafeStage.FRESH
        # A driver that has gone, and whose kart stands on the grid, is away from the first tick on.
        self.away_since = 0 if self.is_taken and not self.is_present else -1
        self.is_led, self.keeps_wheel, self.orders, self.planned = False, False, 0, None
        self.uses_item = False

    def receive(self, sequence: int, control: Control, tick: int) -> None:
        """Record the newest message of the driver, which arrived before a tick."""
        self.sequence = sequence
        self.control, self.control_tick = control, tick
        if self.is_present:
            self.away_since = -1

    def lead(self, control: Control, tick: int) -> None:
        """Record a control of the server's parking driver, which is never away."""
        self.control, self.control_tick, self.answered_tick = control, tick, tick
        self.away_since = -1


class Seats:
    """All seats of a session, by number."""

    def __init__(self, count: int) -> None:
        """Begin with all of them free."""
        self._seats = [Seat(number) for number in range(count)]
        self.closed: dict[int, str] = {}  # those that no driver may take, and why

    def __len__(self) -> int:
        return len(self._seats)

    def __iter__(self) -> Iterator[Seat]:
        return iter(self._seats)

    def __getitem__(self, number: int) -> Seat:
        return self._seats[number]

    def __contains__(self, number: object) -> bool:
        return isinstance(number, int) and 0 <= number < len(self._seats)

    def check(self, number: int) -> None:
        """Do nothing for the number of a seat.

        Raises:
            SeatError: there is no such seat.
        """
        if number not in self:
            raise SeatError(f"seat {number} does not exist; seats are 0 to {len(self) - 1}")

    def check_open(self, number: int) -> None:
        """Do nothing for a seat that is not closed.

        Raises:
            SeatError: it is.
        """
        if number in self.closed:
            raise SeatError(f"seat {number} is closed: {self.closed[number]}")

    def taken(self) -> list[Seat]:
        """Return the seats that are taken."""
        return [seat for seat in self._seats if seat.is_taken]

    def vacant(self) -> list[Seat]:
        """Return the seats that a driver may take: neither taken nor closed."""
        return [s for s in self._seats if not s.is_taken and s.number not in self.closed]

    def taken_one(self, number: int) -> Seat:
        """Return a taken seat.

        Raises:
            SeatError: it is not taken.
        """
        if number not in self or not self[number].is_taken:
            raise SeatError(f"seat {number} is not taken")
        return self[number]

    def held_by(self, secret: int, wanted: int) -> Seat | None:
        """Return the seat that the holder of a secret has, where it is the wanted one or any."""
        for seat in self._seats:
            if secret and seat.is_taken and seat.fits(secret) and wanted in {-1, seat.number}:
                return seat
        return None

    def deserted(self, number: int, preset: str) -> Seat | None:
        """Return a seat that races without its driver, if its preset is the same."""
        if number not in self or number in self.closed:
            return None
        seat = self[number]
        is_deserted = seat.is_taken and not seat.is_present and seat.preset == preset
        return seat if is_deserted else None

    def free_one(self, wanted: int) -> Seat:
        """Return the wanted seat, or the first free one for -1.

        Raises:
            SeatError: it does not exist, is closed or taken; or none is free.
        """
        if wanted >= 0:
            self.check(wanted)
        self.check_open(wanted)
        if wanted >= 0 and self[wanted].is_taken:
            raise SeatError(f"seat {wanted} is taken by {self[wanted].driver}")
        if not (free := self.vacant()):
            shut = f" or closed ({len(self.closed)})" if self.closed else ""
            raise SeatError(f"all {len(self)} seats are taken{shut}")
        return self[wanted] if wanted >= 0 else free[0]

    def put(self, seat: Seat) -> None:
        """Put a seat as it is in the place of that of its number."""
        self._seats[seat.number] = seat

    def free(self, number: int) -> None:
        """Free a seat."""
        self.put(Seat(number))

    def close(self, number: int, *, sent_away: bool) -> None:
        """Close a seat to all drivers; one that was sent away may not come back either.

        That it was sent away stays so until the seat is opened.
        """
        sent_away = sent_away or self.is_sent_away(number)
        self.closed[number] = CLOSED_FOR[sent_away]
        if sent_away:
            self[number].key = b""

    def is_sent_away(self, number: int) -> bool:
        """Return whether the steward sent the driver of a seat away."""
        return self.closed.get(number) == CLOSED_FOR[True]

    def unclose(self, number: int) -> None:
        """Open a closed seat again."""
        self.closed.pop(number, None)

    def closings(self, tick: int) -> Iterator[Intervention]:
        """Yield the acts that close what is closed, as if done before a tick."""
        for number, reason in self.closed.items():
            yield Intervention(
                tick, InterventionKind.CLOSE, number, float(CLOSED_FOR.index(reason))
            )
