"""The race server: receives from the seats, advances the race, publishes. Read `run` first."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from race_server.core.clock import Pacer, ticks_of
from race_server.core.messages import Event
from race_server.errors import Reason, SeatError
from race_server.live.driver_processes import DriverProcesses
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server.counters import Counters, Refusals
from race_server.live.server.inbox import Inbox
from race_server.live.server.lobby import Lobby
from race_server.live.server.persistence import Persistence
from race_server.live.server.publisher import Board, Publisher
from race_server.live.server.requests import RequestHandler
from race_server.live.server.result import RaceResult
from race_server.live.server.session_log import SessionLog
from race_server.live.server.steward import Court, Steward
from race_server.live.server.timing import ServerTiming
from race_server.live.server.warm_up import no_garbage_collected
from race_server.live.server.wheels import VALET, Wheels
from race_server.live.server.yardstick import Yardstick
from race_server.live.suspects import Suspects
from race_server.live.watchdog import Watchdog
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.results.keeper import Keeper

REAL, LOCKSTEP = "real", "lockstep"
STANDINGS_TICKS = ticks_of(0.5)


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
    log: Log | None = None
    amended: Callable[[RaceResult], None] = lambda _: None  # called if stewards change a result
    timing: ServerTiming = field(default_factory=ServerTiming)
    watchdog: Watchdog = field(default_factory=Watchdog)
    suspects: Suspects = field(default_factory=Suspects)
    processes: DriverProcesses = field(default_factory=DriverProcesses)  # of fillers kept apart
    valet: str = VALET  # driver that parks on request
    measures: bool = False  # drivers from outside that park, against the plan of that driver
    missed_ticks: int = 0
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the parts that receive, answer, publish and record."""
        session, timing = self.session, self.timing
        session.takes_tracked = self.pace == REAL
        self.counters = Counters(len(session.seats), Refusals(self.log))
        self._session_log = SessionLog(session, self.counters, self.log, timing)
        waits = self.pace == LOCKSTEP
        self.local_drivers = inside = LocalDrivers(session, self.suspects, waits=waits)
        self._persistence = Persistence(session, self.keeper, self.logbook, timing)
        self._wheels = Wheels(session, inside, self.counters, self.suspects, self.valet)
        self._yardstick = Yardstick(session, inside, self.valet if self.measures else "")
        out = session, self.link, self._persistence
        self._publisher = Publisher(*out, orders_s=timing.orders_s, ways=self._wheels.ways)
        late, park = self._penalise_late, self._wheels.park
        self._steward = Steward(session, self.token, late, park, self.log)
        refused, announced = self.counters.refused, self._persistence.announced
        self._requests = RequestHandler(
            session, self.link, self._steward, self._wheels, refused, announced, timing.show_up_s
        )
        self.inbox = Inbox(session, self.link, self._requests, self.local_drivers, self.counters)
        drivers = inside, self.processes
        self.lobby = Lobby(session, self.link, drivers, timing, self._tend, self.log)
        self._result: RaceResult | None = None  # of the last race, until the next one begins
        self._stop = False

    # One race from the lobby to the results

    def run(self, drivers: int) -> RaceResult | None:
        """Wait until `drivers` drivers are ready, race, and return the result.

        A server that is stopped in the lobby has no result.

        Raises:
            DriverError: there are fillers, and no driver at all.
        """
        self.lobby.gather(drivers, self.fillers)
        return None if self.is_stopped else self._begin_again(self.race())

    def drive(self, scenario: Scenario) -> RaceResult:
        """Race in an event: drivers keep their seats, those inside begin as if made for it."""
        self.session.prepare(scenario)
        return self._begin_again(self.race())

    def _begin_again(self, result: RaceResult) -> RaceResult:
        """Race again with the same drivers each time that the steward restarts the race."""
        while self._steward.wants_restart and not self._stop:
            self._steward.wants_restart = False
            self.reopen()
            for seat in self.session.seats:
                seat.is_ready = seat.is_taken
            if not self.session.keeps_seats:
                self.lobby.fill(self.fillers)
            result = self.race()
        return result

    def hold(self, board: Board, court: Court) -> None:
        """Send spectators the event that the races are part of, and let it take protests."""
        self._publisher.board, self._steward.court = board, court

    def stop(self) -> None:
        """End the race at the next tick; what was driven counts."""
        self._stop = True

    @property
    def is_stopped(self) -> bool:
        """Whether the server was told to stop."""
        return self._stop

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats that were filled are free again.

        In an event all drivers stay.
        """
        self.session.reopen()
        if not self.session.keeps_seats:
            self.local_drivers.clear()
            for seat in self.processes.end():
                self.session.drop(seat)
        self._publisher.publish_standings()

    def see_off(self, review_s: float = 0.0) -> None:
        """Send drivers the end until they have gone; stewards may change it for `review_s` [s]."""
        self.lobby.see_off(self._publish_observations, review_s)

    def race(self) -> RaceResult:
        """Run one race from the countdown to the last kart's finish."""
        self._result = None
        self._wheels.clear()
        if self.session.keeps_seats:
            self.local_drivers.renew()
        self.session.start(_now_us())
        self._yardstick.begin()
        self._persistence.open(self.pace, self.local_drivers)
        return self._race_on(list(self.session.event_log.recent))

    def resume(self, recording: Recording, events: list[Event]) -> RaceResult:
        """Continue the race of a server that was killed.

        The session is restored already, see `race_server.live.server.resume`. events: so far.
        """
        self._persistence.resume(recording)
        seats = self.session.seats
        for row in recording.start.seats:
            if row.is_local and not seats.is_sent_away(row.number):
                self.local_drivers.readmit(row.driver, row.number)
            else:
                # As it is now: a driver that was sent away has none.
                self.link.holders.admit(row.number, seats[row.number].key)
        if self.pace == LOCKSTEP:
            # The world must not run away from drivers that are coming back.
            drive = self.session.lined_up
            self.lobby.wait_until(lambda: all(s.is_present for s in drive()), self.timing.answer_s)
        self.session.tracked_karts.resume(self.session.world, _now_us())
        self._wheels.resume()
        return self._begin_again(self._race_on(events))

    def _race_on(self, events: list[Event]) -> RaceResult:
        self.events = events
        self._publisher.begin()
        try:
            with no_garbage_collected():
                if self.pace == LOCKSTEP:
                    self._race_in_lockstep()
                else:
                    self._race_in_real_time()
        except BaseException:
            # Without its end: the server that replaces this one resumes the race.
            self._persistence.leave()
            raise
        self.watchdog.rest()
        self._yardstick.settle()
        self._announce(wait=True)
        self._publisher.record_standings()
        self._persistence.close()
        self._publish_observations()
        self._publisher.publish_end()
        figures = self.missed_ticks, self.refusals(), _now_us()
        self._result = RaceResult.of(self.session, self.events, *figures)
        self._session_log.close(self._result)
        return self._result

    def _penalise_late(self, seat: int, seconds: float) -> str:
        """Add a penalty to the result of the last race and return the driver's name.

        Raises:
            SeatError: there is no result, or no driver raced on that seat.
        """
        if self._result is None:
            raise SeatError("no race is on, and none is over: no result to change", Reason.DECISION)
        driver = self._result.driver_on(seat)
        events = self.session.race_control.penalise_late(seat, seconds)
        self._result = self._result.amended(self.session.table(), events)
        if self.keeper:
            self.keeper.amend(self._result.standings)
        self._publisher.publish_events(events)
        self._publisher.publish_standings()
        self.amended(self._result)
        return driver

    def recorder_backlog(self) -> int:
        """Return how many messages wait to be recorded."""
        return self._persistence.backlog

    def refusals(self) -> dict[str, int]:
        """Return how many messages were refused, by reason."""
        self.counters.refused.record_dropped(self.link.dropped)
        return {reason.value: times for reason, times in self.counters.refused.items()}

    def _race_in_real_time(self) -> None:
        pacer = Pacer()
        pacer.start()
        session = self.session
        while self._goes_on():
            if self.session.race_control.is_paused:
                self._wait_while_paused()
                pacer.start()
            begun = time.perf_counter()
            if session.tick % session.decision_ticks == 0:
                self._publish_observations()
            else:
                self._publisher.repeat_orders()
            self.poll()
            self.session.follow(_now_us())
            self.advance(1)
            duration = time.perf_counter() - begun
            pacer.wait()
            missed = self.missed_ticks + pacer.missed
            self.counters.record_tick(duration, pacer.lateness_s, missed)
        self.missed_ticks += pacer.missed

    def _race_in_lockstep(self) -> None:
        while self._goes_on():
            if self.session.race_control.is_paused:
                self._wait_while_paused()
            self._publish_observations()
            self._wait_for_answers()
            self.advance(self.session.decision_ticks)

    def _goes_on(self) -> bool:
        return self.session.is_on and not (self._stop or self._steward.wants_restart)

    def _wait_while_paused(self) -> None:
        """Wait while the race is paused; repeat what is sent, so that drivers see a live server."""
        again = 0.0
        while self.session.race_control.is_paused and self._goes_on():
            self.poll()
            self._persistence.record_interventions()
            self._publisher.order_stop(_now_us())
            if time.monotonic() > again:
                again = time.monotonic() + self.timing.repeat_s
                self._publisher.repeat(self.session.seats, but=self.local_drivers)
            self.link.wait(self.timing.poll_s)

    def advance(self, ticks: int) -> None:
        """Advance the race, record what happened, and publish it."""
        before = self.session.tick
        events = self.session.advance(ticks)
        self.counters.record_silence(self.session.seats.taken(), ticks)
        self.events += events
        self._persistence.record(before, events)
        # In real time no tick waits for the disk. In lockstep the world does, as for a driver.
        self._announce(wait=self.pace == LOCKSTEP)
        self._publisher.publish_snapshot()
        if before // STANDINGS_TICKS != self.session.tick // STANDINGS_TICKS:
            self._yardstick.look()
            self._publisher.publish_event()
            self._publisher.publish_standings()
            self.counters.refused.record_dropped(self.link.dropped)

    def _announce(self, *, wait: bool) -> None:
        for events in self._persistence.released(wait=wait):
            self._publisher.publish_events(events)

    # What is received and sent

    def _wait_for_answers(self) -> None:
        """Wait for the answer of every seat; a driver that is silent too long is gone."""
        deadline = time.monotonic() + self.timing.answer_s
        again = time.monotonic() + self.timing.repeat_s
        while True:
            self.poll()
            waiting = self.session.waits_for()
            if not waiting or self._stop:
                return
            now = time.monotonic()
            if now > deadline:
                for seat in waiting:
                    self.session.drop(seat)
                return
            if now > again:
                again = now + self.timing.repeat_s
                late = [self.session.seats[number] for number in waiting]
                self._publisher.repeat(late, but=self.local_drivers)
            self.link.wait(0.05)

    def poll(self) -> None:
        """Receive all that has come, and log what has changed."""
        self.counters.turned_at = time.monotonic()
        self.watchdog.turn()
        self._session_log.poll(self.counters.turned_at)
        self.inbox.drain()

    def _tend(self) -> bool:
        """Receive while no race is on; return whether the server goes on."""
        self.poll()
        self.counters.refused.record_dropped(self.link.dropped)
        self._requests.free_deserted_seats()
        self._publisher.publish_event()
        return not self._stop

    def _publish_observations(self) -> None:
        """Send every seat its observation, and let the local drivers answer at once."""
        self.session.observe()
        self._publisher.publish_seats(but=self.local_drivers)
        self._wheels.drive(self.inbox.receive_control)


def _now_us() -> int:
    """Return the time of the clock by which real karts are followed [µs]."""
    return time.monotonic_ns() // 1000
