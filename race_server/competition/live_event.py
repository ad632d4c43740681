"""An event on the network: calls each attempt and race, drives it, and writes its results down.

`Day` says what comes next and what counts; here are the drivers, the clock and the file. A drive
whose server was killed goes on; one that was stopped is driven again.
"""

from collections.abc import Callable
from dataclasses import replace

from race_server.competition.event_board import EventBoard
from race_server.competition.event_ghosts import EventGhosts
from race_server.competition.event_spec import EventSpec, file_name
from race_server.competition.event_state import EventFile, EventState
from race_server.competition.protest_desk import ProtestDesk
from race_server.competition.race_day.day import Day, Drive
from race_server.competition.race_day.incidents import Incidents
from race_server.competition.race_day.record import RaceRecord, absent, record_of
from race_server.core.messages import Event, EventPhase, Phase
from race_server.errors import RaceError, RecordingError, ScenarioError
from race_server.live.server import REAL, RaceResult, RaceServer
from race_server.live.server.resume import restore_session
from race_server.logs import Log
from race_server.scenario.race import ABSENT, Scenario
from race_server.session.seats import Seat
from race_server.session.session import Session
from race_server.storage.recording.logbook import STAMP, recordings_of
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.scenario_codec import unpack_scenario

# Drivers in processes that the server keeps apart have this long to come back [s].
BACK_S = 8.0


class LiveEvent:
    """One event of a server."""

    def __init__(
        self,
        server: RaceServer,
        spec: EventSpec,
        state: EventState,
        log: Log,
        changed: Callable[[Day, EventState], None],
    ) -> None:
        """Go on with an event. changed: is called with each change of its results."""
        self._server, self._spec, self.state, self._log = server, spec, state, log
        self._changed = changed
        self._name = file_name(server)
        self._file = EventFile(spec.folder, self._name)
        self.day = state.day()
        self._raced = -1  # record of the race whose result stewards may change
        self._teams = {one.seat: one.team for one in state.entrants}
        self._seats = {one.team: one.seat for one in state.entrants}
        ghosts = EventGhosts(spec.folder, f"{self._name}-{STAMP}.mcap", state.name, log)
        self._board = EventBoard(server, self._seats, ghosts, self._record_now)
        self._board.show(self.day, EventPhase.CALLED)
        self._desk = ProtestDesk(self.day, state, server.keeper, self._announce)
        server.hold(self._board, self._desk)
        server.amended = self._amend

    # From the first call to the final classification

    def run(self, resumed: tuple[Recording, list[Event]] | None = None) -> bool:
        """Drive what is left; False where the server was stopped before the end.

        resumed: the drive in which the server before this one was killed, already restored.

        Raises:
            RaceError: the event cannot be written down.
        """
        server = self._server
        server.session.is_event = server.session.keeps_seats = True
        for one in self.state.entrants:
            if one.is_sent_away:
                server.session.seats.close(one.seat, sent_away=True)
                server.link.bar_seat(one.seat, is_barred=True)
        if resumed is not None:
            self._go_on(*resumed)
        else:
            self._restore_seats()
            if (record := self._found()) is not None:
                self._add(record)
        self._save()
        self._review_if_due()
        while (drive := self.day.next) is not None and not server.is_stopped:
            record = self._drive(drive)
            if record is None:
                return False
            self._add(record)
            self._review_if_due()
        if self.day.next is not None or server.is_stopped:
            return False
        self.state = replace(self.state, is_final=True)
        self._save()
        self._board.show(self.day, EventPhase.OVER)
        self._changed(self.day, self.state)
        server.session.is_event = False  # drivers go home; no other ones get their seats
        return True

    def _drive(self, drive: Drive) -> RaceRecord | None:
        """Call the drivers and let them drive; None where the server is stopped meanwhile."""
        server, session = self._server, self._server.session
        self._desk.block = drive.block
        seats = [session.seats[self._seats[team.name]] for team in drive.grid]
        names = ", ".join(team.name for team in drive.grid)
        # Karts that have just driven leave the track, while the next drivers get ready.
        cool_down_s = self._spec.cool_down_s if self._raced >= 0 else 0.0
        self._board.show(self.day, EventPhase.CALLED, waits_s=cool_down_s + self._spec.call_s)
        self._log.say("called", drive=drive.title, drivers=names)
        if server.pace == REAL:
            # A person may have been ready long ago; drivers' programs say it again, karts' once.
            for seat in seats:
                seat.is_ready = seat.is_ready and seat.is_tracked
        server.lobby.wait_until(lambda: False, cool_down_s)
        server.lobby.wait_until(lambda: all(map(self._is_ready, seats)), self._spec.call_s)
        self._save()  # with whom stewards sent away
        if server.is_stopped:
            return None
        if self._are_all_gone():
            self._log.warn("no driver is there: the event waits for one", drive=drive.title)
            self._board.show(self.day, EventPhase.CALLED)
            server.lobby.wait_until(lambda: not self._are_all_gone())
            return self._drive(drive)
        there = [seat.number for seat in seats if seat.is_present]
        if not there:
            return self._with_missing(RaceRecord("", ()), drive)
        for number in there:
            session.seats[number].is_ready = False
        self._board.show(self.day, EventPhase.ON_TRACK)
        server.watchdog.rest()  # a course may take its time
        server.drive(self._lined_up(drive, set(there)))
        record = self._recorded(drive)
        server.reopen()
        return record

    def _are_all_gone(self) -> bool:
        """Return whether no driver is there, and one may come back: after a kill, perhaps.

        Those of the server itself do not.
        """
        seats = self._server.session.seats
        outside = (one for one in self.state.entrants if not (one.is_local or one.is_apart))
        may_come = any(not seats.is_sent_away(one.seat) for one in outside)
        return may_come and not any(seat.is_present for seat in seats.taken())

    def _is_ready(self, seat: Seat) -> bool:
        is_inside = seat.number in self._server.local_drivers
        return seat.is_present and (seat.is_ready or is_inside)

    def _lined_up(self, drive: Drive, there: set[int]) -> Scenario:
        """Return the race of a drive on all seats of the session, for those that are there."""
        karts = len(self._server.session.seats)
        order = [ABSENT] * karts
        for place, team in enumerate(drive.grid):
            if (seat := self._seats[team.name]) in there:
                order[seat] = place
        return replace(drive.scenario, karts=karts, grid_order=tuple(order))

    def _recorded(self, drive: Drive) -> RaceRecord | None:
        """Return the record of the race that is over; None for one that was stopped."""
        is_over = self._server.session.phase is Phase.FINISHED
        return self._record_now(drive) if is_over else None

    def _record_now(self, drive: Drive) -> RaceRecord:
        """Return the record of the race in the session, as far as it was driven."""
        record = self._record_of(self._server.session, self._server.events)
        return self._with_missing(record, drive)

    def _with_missing(self, record: RaceRecord, drive: Drive) -> RaceRecord:
        """Return a record with the teams that did not come to their drive."""
        why = f"not there {self._spec.call_s:g} s after the call"
        missing = [team.name for team in drive.grid if team.name not in record.grid]
        drives = (*record.drives, *(absent(name, why) for name in missing))
        return replace(record, drives=drives, grid=tuple(team.name for team in drive.grid))

    def _record_of(self, session: Session, events: list[Event]) -> RaceRecord:
        incidents = Incidents()
        incidents.record_events(events)
        return record_of(session, self._teams, incidents)

    def _review_if_due(self) -> None:
        """Review a stage, or a round of one, that is driven and was not reviewed to the end."""
        block = self.day.driven[-1].block if self.day.driven else ""
        is_driven = self.day.next is None or self.day.next.block != block
        if block and is_driven and block != self.state.reviewed:
            self._review(block)

    def _review(self, block: str) -> None:
        """Leave the stewards their time for the results of a block, and for all protests."""
        self._desk.block = block
        if self._spec.review_s > 0.0:
            self._board.show(self.day, EventPhase.REVIEWED, waits_s=self._spec.review_s)
            self._log.say("provisional", stage=block, review_s=self._spec.review_s)
            self._server.lobby.wait_until(lambda: False, self._spec.review_s)
        if self._desk.is_busy:
            self._board.show(self.day, EventPhase.REVIEWED)
            self._log.warn("waiting for the decision on a protest", stage=block)
            self._server.lobby.wait_until(lambda: not self._desk.is_busy)
        self._desk.block = ""
        if not self._server.is_stopped:
            self.state = replace(self.state, reviewed=block)
            self._save()

    # What is written down

    def _add(self, record: RaceRecord) -> None:
        """Write down the record of the drive that was next."""
        drive = self.day.next
        assert drive is not None
        self.day.add(record)
        if record.digest:
            self._raced = len(self.day.records) - 1
        self._save()
        first = record.drives[0].team if record.drives and record.drives[0].place else "none"
        self._log.say("driven", drive=drive.title, first=first)
        self._changed(self.day, self.state)

    def _amend(self, result: RaceResult) -> None:
        """Take over what stewards decided on the last race."""
        if self._raced < 0:
            return
        before = self.day.records[self._raced]
        record = self._record_of(self._server.session, result.events)
        driven = {drive.team for drive in record.drives}
        missing = (drive for drive in before.drives if drive.team not in driven)
        record = replace(record, drives=(*record.drives, *missing), grid=before.grid)
        try:
            self.day.amend(self._raced, record)
        except ScenarioError as error:
            self._log.warn("a decision changes no classification", why=str(error))
            return
        self._desk.correct(self._raced)
        self._announce()

    def _announce(self) -> None:
        """Write down and send what has changed in the results; a drive waits for no full disk."""
        try:
            self._save()
        except RaceError as error:
            self._log.warn("a decision is written with the next drive", why=str(error))
        self._board.renew()
        self._changed(self.day, self.state)

    def _save(self) -> None:
        """Write the event to its file."""
        session = self._server.session
        seats = {seat.number: seat for seat in session.seats.taken()}
        entrants = tuple(
            replace(
                one,
                preset=seats[one.seat].preset,
                key=seats[one.seat].key.hex(),
                is_sent_away=session.seats.is_sent_away(one.seat),
            )
            if one.seat in seats
            else one
            for one in self.state.entrants
        )
        records = tuple(self.day.records)
        self.state = replace(
            self.state,
            entrants=entrants,
            epoch=session.epoch,
            records=records,
            protests=self.day.protests,
        )
        self._server.watchdog.rest()
        self._file.write(self.state)

    # After a server that was stopped or killed

    def _restore_seats(self) -> None:
        """Give all drivers their seats, as they were; those inside the server are made again."""
        server, session = self._server, self._server.session
        if session.seats.taken():
            return  # the event has just begun
        session.epoch = self.state.epoch
        for one in self.state.entrants:
            key = bytes.fromhex(one.key)
            seat = Seat(one.seat, one.driver, one.preset, key, is_tracked=one.is_tracked)
            seat.is_taken = True
            session.seats.put(seat)
            server.link.holders.admit(one.seat, key)
            if one.is_local and not one.is_sent_away:
                server.local_drivers.readmit(one.driver, one.seat)
        session.prepare(session.scenario)
        gone = [one for one in self.state.entrants if one.is_apart and not one.is_sent_away]
        if gone:
            # After a kill they are still there, and come back by themselves.
            server.lobby.wait_until(
                lambda: all(session.seats[one.seat].is_present for one in gone), BACK_S
            )
        for one in gone:
            if not session.seats[one.seat].is_present and not server.is_stopped:
                server.processes.start(one.driver, one.seat)

    def _go_on(self, recording: Recording, events: list[Event]) -> None:
        """Go on with the drive in which the server was killed."""
        server, drive = self._server, self.day.next
        for seat in server.session.seats:
            seat.is_ready = False
        if drive is not None:
            self._desk.block = drive.block
        self._board.show(self.day, EventPhase.ON_TRACK)
        server.resume(recording, events)
        occasion = server.session.scenario.occasion
        if drive is not None and occasion == drive.scenario.occasion:
            record = self._recorded(drive)
        else:
            record = None
        server.reopen()
        if record is not None:
            self._add(record)

    def _found(self) -> RaceRecord | None:
        """Return the record of the next drive if it was driven to its end already.

        A server may have been killed after the end of a race, and before it was written down here.
        """
        drive = self.day.next
        paths = recordings_of(self._spec.folder, self._name)
        if drive is None or not paths:
            return None
        try:
            recording = read_recording(paths[-1])
            scenario = unpack_scenario(recording.start.setting, recording.start.arrays)
            if scenario.occasion != drive.scenario.occasion or not recording.is_complete:
                return None
            session, events = restore_session(recording, None)
        except RecordingError as error:
            self._log.warn("a recording is left out", why=str(error))
            return None
        if session.phase is not Phase.FINISHED:
            return None
        self._log.say("found", drive=drive.title, recording=paths[-1].name)
        return self._with_missing(self._record_of(session, events), drive)
