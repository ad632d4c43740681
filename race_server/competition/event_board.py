"""What spectators are sent of an event: what is on the track, what comes, and who leads."""

import time
from collections.abc import Callable
from dataclasses import replace

from race_server.competition.event_ghosts import EventGhosts
from race_server.competition.race_day.day import Day, Drive
from race_server.competition.race_day.formats import LAP, TimeTrial
from race_server.competition.race_day.incidents import Incidents
from race_server.competition.race_day.ledger import FinalRow, TrialResult
from race_server.competition.race_day.protest import OPEN
from race_server.competition.race_day.record import RaceRecord, Team
from race_server.core.clock import MICROSECONDS
from race_server.core.messages import EventPhase, Phase
from race_server.live.server import RaceServer
from race_server.net.wire.ghosts import GhostFrame, encode_ghosts
from race_server.net.wire.programme import (
    Call,
    DeletedLap,
    ProgrammeFrame,
    ProtestRow,
    TeamRow,
    encode_programme,
)


class EventBoard:
    """The event of a server as messages; they are made again when something has changed."""

    def __init__(
        self,
        server: RaceServer,
        seats: dict[str, int],
        ghosts: EventGhosts,
        record: Callable[[Drive], RaceRecord],
    ) -> None:
        """Show nothing yet.

        seats: by team; record: returns the record of the race that is over in the server's session.
        """
        self._server, self._seats, self._ghosts, self._record = server, seats, ghosts, record
        self._day: Day | None = None
        self._drive: Drive | None = None  # that is on, or was last
        self._phase, self._until_us = EventPhase.CALLED, 0
        self._made: tuple[int, bytes] = (0, b"")  # of how many events of the race
        self._shown: tuple[GhostFrame, ...] = ()

    def show(self, day: Day, phase: EventPhase, *, waits_s: float = 0.0) -> None:
        """Show the event as it stands from now on. waits_s: how long a call or a review takes."""
        if phase in {EventPhase.CALLED, EventPhase.ON_TRACK} and day.next is not None:
            self._drive = day.next
        self._day, self._phase, self._made = day, phase, (0, b"")
        until_us = time.monotonic_ns() // 1000 + round(waits_s * MICROSECONDS)
        self._until_us = until_us if waits_s else 0
        self._shown = self._find_ghosts(day) if phase is EventPhase.ON_TRACK else ()

    def renew(self) -> None:
        """Make the message again: a result has changed."""
        self._made = 0, b""

    @property
    def programme(self) -> bytes:
        """The message with the event as it stands; empty before it is first shown."""
        if self._day is None:
            return b""
        events = len(self._server.events)
        known, message = self._made
        if not message or known != events:
            message = encode_programme(self._frame(self._day))
            self._made = events, message
        return message

    @property
    def ghosts(self) -> bytes:
        """The message with what is driven against now; empty where there is nothing."""
        # A race that stewards start again has another epoch.
        return encode_ghosts(self._server.session.epoch, self._shown) if self._shown else b""

    def _frame(self, day: Day) -> ProgrammeFrame:
        drive, is_on = self._drive, self._phase is EventPhase.ON_TRACK
        live: tuple[DeletedLap, ...] = ()
        if drive and is_on and self._server.session.phase is Phase.FINISHED:
            day = day.with_record(self._record(drive))
        elif drive and is_on:
            live = self._deleted_now(day, drive)
        frame = programme_of(day, drive, self._phase, self._seats)
        if live and drive:
            on = drive.grid[0].name
            teams = tuple(
                replace(row, deleted=(*row.deleted, *live)) if row.name == on else row
                for row in frame.teams
            )
            frame = replace(frame, teams=teams)
        return replace(frame, until_us=self._until_us)

    def _deleted_now(self, day: Day, drive: Drive) -> tuple[DeletedLap, ...]:
        """Return the laps that were deleted in the attempt that is driven."""
        if not (isinstance(drive.stage, TimeTrial) and drive.stage.counts == LAP):
            return ()
        incidents, team = Incidents(), drive.grid[0].name
        incidents.record_events(self._server.events)
        trial = _trial_of(day, drive)
        before = [len(row.attempts) for row in trial.rows if row.team == team] if trial else []
        number = sum(before) + 1
        return tuple(
            DeletedLap(number, lap, why) for lap, why in incidents.deleted(self._seats[team])
        )

    def _find_ghosts(self, day: Day) -> tuple[GhostFrame, ...]:
        drive = self._drive
        trial = _trial_of(day, drive) if drive else None
        if drive is None or trial is None:
            return ()
        self._server.watchdog.rest()  # laps are driven again to be shown
        return self._ghosts.for_attempt(trial, drive.grid[0].name, self._seats)


def programme_of(
    day: Day, drive: Drive | None, phase: EventPhase, seats: dict[str, int]
) -> ProgrammeFrame:
    """Return an event as it stands. drive: that is on or was last; seats: by team."""
    plan, ledger = day.plan, day.ledger
    stage = drive.stage if drive else None
    trial = _trial_of(day, drive) if drive else None
    attempts = stage.attempts if isinstance(stage, TimeTrial) else 0
    if trial is None and not attempts and ledger.trials():
        trial = ledger.trials()[-1]
    is_ahead = phase in {EventPhase.CALLED, EventPhase.ON_TRACK}
    block = drive.block if drive and phase is not EventPhase.OVER else ""
    return ProgrammeFrame(
        event=day.event,
        title=plan.format.title,
        phase=phase,
        now=Call(drive.title, _names(drive.grid)) if drive else None,
        limit_s=drive.scenario.rules.limit_s if drive and is_ahead else 0.0,
        until_us=0,
        driven=len(day.records),
        drives=plan.drives(),
        has_points=plan.format.has_points,
        attempts=attempts,
        coming=tuple(Call(title, _names(teams)) for title, teams in drive.coming) if drive else (),
        teams=tuple(
            replace(
                _row_of(row, day, trial, attempts, seats[row.team]),
                can_change=day.last_of(row.team, block) is not None,
            )
            for row in ledger.classification()
        ),
        stage=stage.name if stage else "",
        protests=tuple(
            ProtestRow(
                *(one.number, one.title, one.by, one.against, one.why),
                outcome="" if one.verdict == OPEN else one.outcome,
            )
            for one in day.protests
        ),
    )


def _row_of(
    final: FinalRow, day: Day, trial: TrialResult | None, attempts: int, seat: int
) -> TeamRow:
    row = next((row for row in trial.rows if row.team == final.team), None) if trial else None
    times: tuple[int, ...] = ()
    deleted: list[DeletedLap] = []
    time_us = 0
    if trial and row:
        failure_us = round(trial.stage.failure_s * MICROSECONDS)
        times = tuple(time if time < failure_us else 0 for time in row.times_us)
        time_us = min(filter(None, times), default=0)
        for number, drive in enumerate(row.attempts, start=1):
            if trial.stage.counts == LAP:
                deleted += [DeletedLap(number, lap.number, lap.why) for lap in drive.deleted]
    return TeamRow(
        name=final.team,
        seat=seat,
        place=final.place,
        points=final.points,
        time_us=time_us,
        attempts_us=times,
        attempts_left=max(attempts - len(times), 0),
        deleted=tuple(deleted),
        remark=_last_remark(day, final.team),
    )


def _last_remark(day: Day, team: str) -> str:
    for record in reversed(day.results):
        for drive in record.drives:
            if drive.team == team:
                return drive.remark
    return ""


def _trial_of(day: Day, drive: Drive | None) -> TrialResult | None:
    """Return the time trial that a drive is an attempt of, so far; None for a race."""
    trials = (trial for trial in day.ledger.trials() if drive and trial.stage is drive.stage)
    return next(trials, None)


def _names(teams: tuple[Team, ...]) -> tuple[str, ...]:
    return tuple(team.name for team in teams)
