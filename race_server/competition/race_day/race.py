"""One race with all its drivers in this process, in lock-step: each tick waits for them all."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

from race_server.competition.race_day.incidents import Incidents
from race_server.competition.race_day.record import RaceRecord, Team, record_of
from race_server.competition.time_limit import TimeLimitExceeded, time_limit
from race_server.core.driver import driver_named
from race_server.core.messages import Event, Phase
from race_server.core.observation import wants_line
from race_server.errors import DriverError, RaceError
from race_server.live.local_drivers import LocalDrivers
from race_server.net.wire.drive import ControlFrame, decode_control
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from race_server.storage.results.keeper import Keeper

Answer = TypeVar("Answer")

# A driver that takes longer for a decision is out of the race [s].
DECISION_S = 2.0
# Time to get ready [s]: a driver may have a model to load.
READY_S = 30.0


def _ignore(_: Sequence[Event]) -> None:
    """Do nothing."""


class LocalRace:
    """A session whose seats are filled from inside this process, race after race."""

    def __init__(self, name: str, scenario: Scenario, keeper: Keeper | None) -> None:
        """Prepare the world; `keeper` writes results into the results file."""
        self._session = Session(name, scenario)
        self._keeper = keeper
        # Teams of the last race whose drivers were not ready, raised, or took too long.
        self.failed: frozenset[str] = frozenset()

    def run(
        self, teams: Sequence[Team], seed: int, watch: Callable[[Sequence[Event]], None] = _ignore
    ) -> RaceRecord:
        """Run a race of these teams, the first on pole, and return its record.

        watch: is called after each decision, with what happened since the one before.
        """
        session = self._session
        session.scenario = replace(session.scenario, seed=seed)
        local_drivers, incidents = LocalDrivers(session, waits=True), Incidents()
        for seat, team in enumerate(teams):
            self._admit(local_drivers, seat, team, incidents)
        session.start()
        if self._keeper:
            self._keeper.begin(session, "lockstep")
        try:
            for seat in incidents.absent:
                session.leave(seat)
            while session.is_on:
                self._decide(local_drivers, incidents)
                watch(self._advance(incidents))
        finally:
            self._close_book()
        names = {seat: team.name for seat, team in enumerate(teams)}
        self.failed = frozenset(names[seat] for seat in incidents.failed)
        record = record_of(session, names, incidents)
        session.reopen()
        for taken in [seat for seat in session.seats if seat.is_taken]:
            session.leave(taken.number)
        return record

    def _admit(
        self, local_drivers: LocalDrivers, seat: int, team: Team, incidents: Incidents
    ) -> None:
        """Seat a driver; one that cannot be loaded or reset is out before the start."""

        def get_ready() -> bool:
            local_drivers.admit(team.driver, driver_named(team.driver), seat)
            return True

        if not _answer(get_ready, READY_S, seat, incidents):
            incidents.absent.add(seat)
            if not self._session.seats[seat].is_taken:
                self._session.join(team.driver, "track", wanted=seat)

    def _decide(self, local_drivers: LocalDrivers, incidents: Incidents) -> None:
        """Ask every driver that still races for its control."""
        session = self._session
        session.observe()
        for seat in session.waits_for():
            think = partial(_control, local_drivers, seat)
            if (frame := _answer(think, DECISION_S, seat, incidents)) is None:
                session.leave(seat)
                continue
            session.receive_control(seat, frame.epoch, frame.sequence, frame.tick, frame.control)

    def _advance(self, incidents: Incidents) -> Sequence[Event]:
        events = self._session.advance(self._session.decision_ticks)
        incidents.record_events(events)
        if self._keeper:
            self._keeper.add_laps(self._session.event_log.laps.laps_in(events))
        return events

    def _close_book(self) -> None:
        if self._keeper:
            self._keeper.end(self._session)


def _control(local_drivers: LocalDrivers, seat: int) -> ControlFrame:
    return decode_control(local_drivers.answer(seat))


def _answer(
    ask: Callable[[], Answer], limit_s: float, seat: int, incidents: Incidents
) -> Answer | None:
    """Return what a driver answers; record why it is out if it raises or takes too long."""
    try:
        with time_limit(limit_s):
            return ask()
    except TimeLimitExceeded:
        incidents.record_failure(seat, f"no answer within {limit_s:g} s")
    except RaceError as error:
        cause = error.__cause__
        incidents.record_failure(
            seat, f"raised {type(cause).__name__}: {cause}" if cause else str(error)
        )
    return None


def rehearse(drivers: Sequence[str], scenario: Scenario) -> None:
    """Let each driver decide once, however long it takes: its kernels may have to be compiled.

    A failure here is ignored: it happens again in the race, and is recorded there.
    """
    session = Session("rehearsal", replace(scenario, karts=1))
    for name in dict.fromkeys(drivers):
        local_drivers = LocalDrivers(session, waits=True)
        try:
            local_drivers.admit(name, driver_named(name), 0)
            session.start()
            session.observe()
            with time_limit(10.0 * READY_S):
                local_drivers.answer(0)
            session.advance(session.decision_ticks)
        except (RaceError, TimeLimitExceeded):
            pass
        session.phase = Phase.LOBBY
        session.seats.free(0)


def needs_line(driver: str) -> bool:
    """Return whether a driver follows the reference line; one that does not exist does not."""
    try:
        return wants_line(driver_named(driver).preset)
    except DriverError:  # it is out before the start
        return False
