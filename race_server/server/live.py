"""The race server: hears the seats, lets time pass, tells everybody. Read `run` first."""

import gc
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from race_server.clock import Pacer, ticks_of
from race_server.driver import driver_named
from race_server.errors import DriverError, WireError
from race_server.messages import Event, Phase
from race_server.paddock import Paddock
from race_server.results.keeper import Keeper
from race_server.results.writer import Writer
from race_server.server.desk import Desk, reason_of
from race_server.server.herald import Herald
from race_server.server.outcome import RaceResult
from race_server.session import Seat, Session
from race_server.transport import ServerLink
from race_server.wire.drive import decode_control
from race_server.wire.pose import decode_pose

REAL, LOCKSTEP = "real", "lockstep"
STANDINGS_TICKS = ticks_of(0.5)
# In lock-step a driver that does not answer for so long is treated as gone.
ANSWER_S = 10.0
# … and it is told again what it sees as often as this, should a message have been lost.
REPEAT_S = 0.5
LOBBY_POLL_S = 0.02


@dataclass
class RaceServer:
    """One session on the network."""

    session: Session
    link: ServerLink
    pace: str = REAL
    fillers: tuple[str, ...] = ()  # drivers for the seats that stay empty, repeated in turn
    results: Writer | None = None  # the file that keeps races and laps
    missed_ticks: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Open the desk and send for the herald."""
        self.session.takes_tracked = self.pace == REAL
        self._keeper = Keeper(self.results) if self.results else None
        self._paddock = Paddock(self.session)
        self._herald = Herald(self.session, self.link)
        self._desk = Desk(self.session, self.refused, self._told)
        self._stop = False

    # One race from the lobby to the results

    def run(self, drivers: int) -> RaceResult | None:
        """Wait until `drivers` drivers are ready, race, and return the result.

        Who is stopped in the lobby has no result.
        """
        self.wait_in_lobby(drivers)
        if self._stop:
            return None
        self._fill_empty_seats()
        return self.race()

    def stop(self) -> None:
        """End the race at the next tick; what was driven counts."""
        self._stop = True

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats that were filled are free again."""
        self.session.reopen()
        self._paddock.clear()
        self._herald.tell_standings()

    def wait_in_lobby(self, drivers: int) -> None:
        """Serve the lobby until `drivers` seats are taken and all who sit there are ready."""
        while not self._stop:
            self._hear()
            self._desk.free_deserted_seats()
            taken = sum(seat.is_taken for seat in self.session.seats)
            if taken >= drivers and (taken == 0 or self.session.can_start()):
                return
            self.link.wait(LOBBY_POLL_S)

    def race(self) -> RaceResult:
        """Run one race from the countdown to the last kart's finish."""
        self.session.start(_now_us())
        self.events = list(self.session.recent)
        if self._keeper:
            self._keeper.begin(self.session, self.pace)
        self._herald.tell_standings()
        gc.collect()
        gc.freeze()
        gc.disable()
        try:
            if self.pace == LOCKSTEP:
                self._race_in_lockstep()
            else:
                self._race_in_real_time()
        finally:
            gc.enable()
            gc.unfreeze()
            self._close_book()
        self._tell_seats()
        self._herald.tell_watchers()
        self._herald.tell_standings()
        return RaceResult(
            self.session.digest(),
            self.session.tick,
            self.session.standings(),
            self.events,
            self.missed_ticks,
            self._refusals(),
            self.session.fleet.figures(_now_us()),
        )

    def _close_book(self) -> None:
        """Tell the last events and write how the race ended."""
        if self._keeper:
            self._tell_released(self._keeper, wait=True)
            self._keeper.end(self.session)

    def _refusals(self) -> dict[str, int]:
        """Return how many messages were refused, by reason."""
        counts = dict(self.refused)
        for reason in ("oversized", "foreign"):
            if count := getattr(self.link, reason):
                counts[reason] = count
        return counts

    def _race_in_real_time(self) -> None:
        pacer = Pacer()
        pacer.start()
        session = self.session
        while self._goes_on():
            if session.tick % session.decision_ticks == 0:
                self._tell_seats()
            else:
                self._repeat_orders()
            self._hear()
            self.session.follow(_now_us())
            self._advance(1)
            pacer.wait()
        self.missed_ticks += pacer.missed

    def _race_in_lockstep(self) -> None:
        while self._goes_on():
            self._tell_seats()
            self._hear_all()
            self._advance(self.session.decision_ticks)

    def _goes_on(self) -> bool:
        return not self._stop and self.session.phase in {Phase.COUNTDOWN, Phase.RUNNING}

    def _advance(self, ticks: int) -> None:
        before = self.session.tick
        if self._keeper:
            self._keeper.look(self.session)
        events = self.session.advance(ticks)
        self.events += events
        self._announce(events)
        self._herald.tell_watchers()
        if before // STANDINGS_TICKS != self.session.tick // STANDINGS_TICKS:
            self._herald.tell_standings()

    def _announce(self, events: list[Event]) -> None:
        """Tell events in order; a lap, and what comes after it, once it is in the results file.

        In real time no tick waits for the file. In lock-step the world does, as for a driver.
        """
        if self._keeper:
            self._keeper.keep(events)
            self._tell_released(self._keeper, wait=self.pace == LOCKSTEP)
        elif events:
            self._herald.tell_events(events)

    def _tell_released(self, keeper: Keeper, *, wait: bool) -> None:
        for events in keeper.released(wait=wait):
            self._herald.tell_events(events)

    def _told(self, events: Iterable[Event]) -> list[Event]:
        return self._keeper.told(events) if self._keeper else list(events)

    # Hearing and telling

    def _hear_all(self) -> None:
        """Wait for the answer of every seat; who is silent too long is gone."""
        deadline = time.monotonic() + ANSWER_S
        again = time.monotonic() + REPEAT_S
        while True:
            self._hear()
            waiting = self.session.waits_for()
            if not waiting or self._stop:
                return
            now = time.monotonic()
            if now > deadline:
                for seat in waiting:
                    self.session.drop(seat)
                return
            if now > again:
                again = now + REPEAT_S
                for seat in waiting:
                    self._herald.tell_observation(self.session.seats[seat])
            self.link.wait(0.05)

    def _hear(self) -> None:
        for seat, data in self.link.take_inputs():
            self._take_control(seat, data)
        for seat, data, arrived_us in self.link.take_poses():
            self._take_pose(seat, data, arrived_us)
        for request in self.link.take_requests():
            self._desk.answer(request)
        for seat, is_there in self.link.take_presence():
            if seat not in self._paddock:
                self._desk.take_presence(seat, is_there=is_there)

    def _take_control(self, seat: int, data: bytes) -> None:
        try:
            frame = decode_control(data)
            self.session.take_control(seat, frame.epoch, frame.sequence, frame.tick, frame.control)
        except WireError as error:
            self.refused[reason_of(error)] += 1

    def _take_pose(self, seat: int, data: bytes, arrived_us: int) -> None:
        try:
            frame = decode_pose(data)
            self.session.take_pose(
                seat,
                frame.epoch,
                frame.sequence,
                frame.pose,
                arrived_us=arrived_us,
                acknowledged=frame.acknowledged,
                buttons=frame.buttons,
            )
        except WireError as error:
            self.refused[reason_of(error)] += 1

    def _repeat_orders(self) -> None:
        """Tell real karts again what they have not acknowledged yet."""
        for number, tracker in self.session.fleet.trackers.items():
            if tracker.orders.is_open and self.session.seats[number].is_present:
                self._herald.tell_hud(self.session.seats[number])

    def _tell_seats(self) -> None:
        """Send every seat what it sees, and let the local drivers answer at once."""
        self.session.look()
        for seat in self.session.seats:
            if not seat.is_taken:
                continue
            if seat.number in self._paddock:
                self._drive_locally(seat)
            elif seat.is_present:
                self._herald.tell_seat(seat)

    # Seats that are driven from inside

    def _fill_empty_seats(self) -> None:
        """Let scripted drivers take the empty seats from inside the server."""
        for seat in list(self.session.seats):
            if self.fillers and not seat.is_taken:
                name = self.fillers[seat.number % len(self.fillers)]
                self._paddock.admit(name, driver_named(name), seat.number)

    def _drive_locally(self, seat: Seat) -> None:
        try:
            control = self._paddock.answer(seat.number)
        except DriverError:
            self.refused[f"driver {seat.driver} failed"] += 1
            self.session.drop(seat.number)
            return
        self._take_control(seat.number, control)


def _now_us() -> int:
    """Return the time of the clock by which real karts are followed [µs]."""
    return time.monotonic_ns() // 1000
