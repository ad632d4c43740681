"""The race server: hears the seats, lets time pass, tells everybody. Read `run` first."""

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from race_server.core.clock import Pacer, ticks_of
from race_server.core.driver import driver_named
from race_server.core.messages import Event
from race_server.errors import DriverError
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server.amendments import Amendments
from race_server.live.server.counters import Counters
from race_server.live.server.inbox import Inbox
from race_server.live.server.persistence import Persistence
from race_server.live.server.publisher import Publisher
from race_server.live.server.refusals import Refusals
from race_server.live.server.requests import RequestHandler
from race_server.live.server.result import RaceResult
from race_server.live.server.session_log import SessionLog
from race_server.live.server.steward import Steward
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.session import Session
from race_server.session.seats import Seat
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.results.keeper import Keeper

REAL, LOCKSTEP = "real", "lockstep"
STANDINGS_TICKS = ticks_of(0.5)
# In lock-step a driver that does not answer for so long is treated as gone.
ANSWER_S = 10.0
# … and it is told again what it sees as often as this, should a message have been lost.
REPEAT_S = 0.5
LOBBY_POLL_S = 0.02
# Drivers that have not heard the end of the last race by then never will.
SEE_OFF_S = 5.0


@dataclass
class RaceServer:
    """One session on the network."""

    session: Session
    link: ServerLink
    pace: str = REAL
    fillers: tuple[str, ...] = ()  # drivers for the seats that stay empty, repeated in turn
    keeper: Keeper | None = None  # writes races and laps into the results file
    logbook: Logbook | None = None  # where recordings go
    token: str = ""  # the steward's; without one there is no steward
    log: Log | None = None  # where it says what happens
    amended: Callable[[RaceResult], None] = lambda _: None  # told if stewards change a result
    missed_ticks: int = 0
    refused: Refusals = field(init=False)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the parts that receive, answer, publish and write down."""
        self.session.takes_tracked = self.pace == REAL
        self.counters = Counters(len(self.session.seats))
        self.refused = Refusals(self.log)
        self._session_log = SessionLog(self.session, self.counters, self.log)
        self._local_drivers = LocalDrivers(self.session)
        self._publisher = Publisher(self.session, self.link)
        self._persistence = Persistence(self.session, self._publisher, self.keeper, self.logbook)
        self._amendments = Amendments(self.session, self._publisher, self.keeper, self.amended)
        self._steward = Steward(self.session, self.token, self._amendments.penalise)
        self._requests = RequestHandler(
            self.session, self.link, self._steward, self.refused, self._persistence.told
        )
        self._inbox = Inbox(
            self.session,
            self.link,
            self._requests,
            self._local_drivers,
            self.counters,
            self.refused,
        )
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
        return self._begin_again(self.race())

    def _begin_again(self, result: RaceResult) -> RaceResult:
        """Race anew with who is there for as long as the steward breaks races off for it."""
        while self._steward.wants_restart and not self._stop:
            self._steward.wants_restart = False
            self.reopen()
            for seat in self.session.seats:
                seat.is_ready = seat.is_taken
            self._fill_empty_seats()
            result = self.race()
        return result

    def stop(self) -> None:
        """End the race at the next tick; what was driven counts."""
        self._stop = True

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats that were filled are free again."""
        self.session.reopen()
        self._local_drivers.clear()
        self._publisher.publish_standings()

    def see_off(self, review_s: float = 0.0) -> None:
        """Tell drivers the end until they have gone: on a bad network the first word gets lost.

        review_s: for so long at least stewards may change the result.
        """
        begun, again = time.monotonic(), 0.0
        while not self._stop and (now := time.monotonic()) < begun + max(SEE_OFF_S, review_s):
            self._hear()
            is_reviewed = now >= begun + review_s
            if is_reviewed and not any(self._is_linked(seat) for seat in self.session.seats):
                return
            if now > again:
                again = now + REPEAT_S
                self._tell_seats()
            self.link.wait(LOBBY_POLL_S)

    def _is_linked(self, seat: Seat) -> bool:
        return seat.is_taken and seat.is_present and seat.number not in self._local_drivers

    def wait_in_lobby(self, drivers: int) -> None:
        """Serve the lobby until `drivers` seats are taken and all who sit there are ready."""
        while not self._stop:
            self._hear()
            self.refused.note_dropped(self.link.dropped)
            self._requests.free_deserted_seats()
            taken = sum(seat.is_taken for seat in self.session.seats)
            if taken >= drivers and (taken == 0 or self.session.can_start()):
                return
            self.link.wait(LOBBY_POLL_S)

    def race(self) -> RaceResult:
        """Run one race from the countdown to the last kart's finish."""
        self._amendments.lapse()
        self.session.start(_now_us())
        self._persistence.open(self.pace, self._local_drivers)
        return self._race_on(list(self.session.chronicle.recent))

    def go_on(self, recording: Recording, events: list[Event]) -> RaceResult:
        """Race on from where a server that was killed has left the race.

        The session stands there already, see `race_server.live.server.resume`; events: so far.
        """
        self._persistence.take_up(recording)
        for row in recording.start.seats:
            if row.is_local:
                self._local_drivers.readmit(row.driver, driver_named(row.driver), row.number)
            else:
                # As it is now: who was sent away has none.
                self.link.holders.admit(row.number, self.session.seats[row.number].key)
        if self.pace == LOCKSTEP:
            self._wait_for_return()
        self.session.fleet.take_up(self.session.world, _now_us())
        return self._begin_again(self._race_on(events))

    def _wait_for_return(self) -> None:
        """Wait until everybody is back; in lock-step the world must not run away from them."""
        deadline = time.monotonic() + ANSWER_S
        while not self._stop and time.monotonic() < deadline:
            self._hear()
            if all(seat.is_present for seat in self.session.seats if seat.is_taken):
                return
            self.link.wait(LOBBY_POLL_S)

    def _race_on(self, events: list[Event]) -> RaceResult:
        self.events = events
        self._publisher.publish_standings()
        try:
            with _no_garbage_collected():
                if self.pace == LOCKSTEP:
                    self._race_in_lockstep()
                else:
                    self._race_in_real_time()
        finally:
            self._persistence.close()
        self._tell_seats()
        self._publisher.publish_snapshot()
        self._publisher.publish_standings()
        result = RaceResult(
            self.session.digest(),
            self.session.tick,
            self.session.standings(),
            self.events,
            self.missed_ticks,
            self.refusals(),
            self.session.fleet.figures(_now_us()),
        )
        self._session_log.close(result)
        self._amendments.result = result
        return result

    def recorder_backlog(self) -> int:
        """Return how many messages wait to be recorded."""
        return self._persistence.backlog

    def refusals(self) -> dict[str, int]:
        """Return how many messages were refused, by reason."""
        self.refused.note_dropped(self.link.dropped)
        return dict(self.refused)

    def _race_in_real_time(self) -> None:
        pacer = Pacer()
        pacer.start()
        session = self.session
        while self._goes_on():
            if self.session.is_paused:
                self._stand_still()
                pacer.start()
            begun = time.perf_counter()
            if session.tick % session.decision_ticks == 0:
                self._tell_seats()
            else:
                self._publisher.repeat_orders()
            self._hear()
            self.session.follow(_now_us())
            self._advance(1)
            duration = time.perf_counter() - begun
            pacer.wait()
            missed = self.missed_ticks + pacer.missed
            self.counters.note_tick(duration, pacer.lateness_s, missed)
        self.missed_ticks += pacer.missed

    def _race_in_lockstep(self) -> None:
        while self._goes_on():
            if self.session.is_paused:
                self._stand_still()
            self._tell_seats()
            self._hear_all()
            self._advance(self.session.decision_ticks)

    def _goes_on(self) -> bool:
        ends = self._stop or self._steward.wants_restart
        return not ends and self.session.is_on

    def _stand_still(self) -> None:
        """Let no time pass while the clock stands; drivers hear now and then that we are here."""
        again = 0.0
        while self.session.is_paused and self._goes_on():
            self._hear()
            self._persistence.note_acts()
            if time.monotonic() > again:
                again = time.monotonic() + REPEAT_S
                self._publisher.repeat(self.session.seats, but=self._local_drivers)
            self.link.wait(LOBBY_POLL_S)

    def _advance(self, ticks: int) -> None:
        before = self.session.tick
        self._persistence.look()
        events = self.session.advance(ticks)
        self._measure(ticks)
        self.events += events
        self._persistence.note(before, events)
        # In real time no tick waits for the disk. In lock-step the world does, as for a driver.
        self._persistence.announce(events, wait=self.pace == LOCKSTEP)
        self._publisher.publish_snapshot()
        if before // STANDINGS_TICKS != self.session.tick // STANDINGS_TICKS:
            self._publisher.publish_standings()
            self.refused.note_dropped(self.link.dropped)

    def _measure(self, ticks: int) -> None:
        self.counters.ticks += ticks
        for seat in self.session.seats:
            if seat.silence and seat.is_taken:
                self.counters.silent[seat.number] += ticks

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
                late = [self.session.seats[number] for number in waiting]
                self._publisher.repeat(late, but=self._local_drivers)
            self.link.wait(0.05)

    def _hear(self) -> None:
        self.counters.turned_at = time.monotonic()
        self._session_log.look(self.counters.turned_at)
        self._inbox.listen()

    def _tell_seats(self) -> None:
        """Send every seat what it sees, and let the local drivers answer at once."""
        self.session.look()
        self._publisher.publish_seats(but=self._local_drivers)
        for seat in self.session.seats.taken():
            if seat.number in self._local_drivers:
                self._drive_locally(seat)

    # Seats that are driven from inside

    def _fill_empty_seats(self) -> None:
        """Let scripted drivers take the empty seats from inside the server."""
        for seat in list(self.session.seats):
            if self.fillers and not seat.is_taken:
                name = self.fillers[seat.number % len(self.fillers)]
                self._local_drivers.admit(name, driver_named(name), seat.number)

    def _drive_locally(self, seat: Seat) -> None:
        try:
            control = self._local_drivers.answer(seat.number)
        except DriverError:
            self.refused.note(f"driver {seat.driver} failed", seat.number)
            self.session.drop(seat.number)
            return
        self._inbox.take_control(seat.number, control)


def _now_us() -> int:
    """Return the time of the clock by which real karts are followed [µs]."""
    return time.monotonic_ns() // 1000


@contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """Let no tick wait for the garbage collector."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
