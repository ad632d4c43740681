"""An event server in lock-step, whose process may end at any moment."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from race_server.competition.event_spec import (
    EventSpec,
    begin_event,
    unfinished_event,
    waiting_scenario,
)
from race_server.competition.launch import free_address
from race_server.competition.live_event import LiveEvent
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.formats import Format, Races, TimeTrial, format_named
from race_server.competition.race_day.plan import DayPlan, teams_of
from race_server.competition.race_day.record import RaceRecord
from race_server.core.driver import driver_named
from race_server.core.messages import EventPhase, Fault
from race_server.core.vehicle_presets import TT02
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.live.server.resume import restore_session
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.scenario.race import Scenario
from race_server.scenario.track.load import load_course
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.writer import writer_for

TRIAL = replace(
    format_named("time-trial"),
    stages=(replace(format_named("time-trial").stages[0], laps=1, attempts=2),),
)
EVENING = Format(
    "evening",
    "Evening",
    (TimeTrial("Qualification", "A", laps=1, attempts=1), Races("Heat", "B", laps=1, most=2)),
)


class Killed(BaseException):
    """The server was killed here."""


def spec_of(folder: Path, form: Format = TRIAL) -> EventSpec:
    tracks = dict.fromkeys(form.letters, "oval")
    return EventSpec(form, tracks, "tt02", 1, folder, call_s=0.2, review_s=0.0, needs_line=True)


class Served:
    """An event server in lock-step, whose process may end at any moment."""

    def __init__(self, spec: EventSpec, drivers: tuple[str, ...]) -> None:
        self.spec, self.drivers = spec, drivers
        self.said: list[str] = []
        self.awaited: list[int] = []  # seats that came back once no driver was there
        self.reviews: list[int] = []  # after how many attempts and races

    @staticmethod
    def scenario_for(seats: int, form: Format = TRIAL) -> Scenario:
        courses = {letter: load_course("oval") for letter in form.letters}
        plan = DayPlan(form, teams_of(["driver"] * seats), courses, TT02, 1, needs_line=True)
        return waiting_scenario(plan, seats)

    def run(self, *, kill_in_review: bool = False, kicked: int = -1, **what: float) -> Day:
        """Serve until the event is over, or what is to happen; races are counted from 0."""
        spec, said = self.spec, self.said
        with (
            writer_for(str(spec.folder / "results.sqlite"), said.append) as writer,
            Logbook(spec.folder, "cup", said.append) as book,
            ServerLink(free_address(), "cup", len(self.drivers) + 1) as link,
        ):
            assert writer is not None
            keeper, recording = Keeper(writer), book.unfinished()
            restored = restore_session(recording, keeper) if recording else None
            seats = len(self.drivers) + 1  # one stays free
            session = Session("cup", self.scenario_for(seats, spec.format))
            server = RaceServer(
                restored[0] if restored else session, link, LOCKSTEP, (), keeper, book
            )
            state = unfinished_event(spec, "cup", seats, Log())
            if state is None:
                for seat, name in enumerate(self.drivers):
                    server.local_drivers.admit(name, driver_named(name), seat)
                state = begin_event(server, spec, 0)
            assert state is not None
            event = LiveEvent(server, spec, state, Log(), lambda *_: None)
            self._arrange(server, event, **what)
            if kicked >= 0:
                server.session.keeps_seats = True
                server.session.race_control.exclude(kicked)
            self._note_reviews(event, kill_in_review=kill_in_review)
            resumed = (recording, restored[1]) if recording and restored else None
            assert event.run(resumed)
            return event.day

    def _arrange(
        self,
        server: RaceServer,
        event: LiveEvent,
        *,
        race: int = 0,
        kill_at_tick: int = -1,
        stop_at_tick: int = -1,
        remove_at_tick: int = -1,
        restart_at_tick: int = -1,
        kill_after_race: bool = False,
        gone: int = -1,
        may_come_back: bool = False,
        penalty_after: int = -1,
        penalised: int = 0,
        seconds: float = 0.0,
        protest_after: int = -1,
    ) -> None:
        advance, add = server.advance, event._add

        def watched(ticks: int) -> None:
            advance(ticks)
            if server.session.epoch == race + 1:
                if 0 <= kill_at_tick <= server.session.tick:
                    raise Killed
                if server.session.tick == remove_at_tick:
                    server.session.race_control.remove(penalised, Fault.RAMMING)
                server._steward.wants_restart = server.session.tick == restart_at_tick
                if 0 <= stop_at_tick <= server.session.tick:
                    server.stop()

        def added(record: RaceRecord) -> None:
            if kill_after_race and len(event.day.records) == race:
                raise Killed
            add(record)
            if len(event.day.records) == penalty_after + 1:
                server._penalise_late(penalised, seconds)
            if len(event.day.records) == protest_after + 1:
                event._desk.lodge(1 - penalised, penalised, "cut the chicane")
                event._desk.decide(1, "upheld", seconds, "marshal")

        server.advance = watched  # type: ignore[method-assign]
        event._add = added  # type: ignore[method-assign]
        if gone >= 0:
            server.session.keeps_seats = True
            server.session.drop(gone)
            self._come_back_when_awaited(server, gone)
        if may_come_back:
            entrants = tuple(replace(one, is_local=False) for one in event.state.entrants)
            event.state = replace(event.state, entrants=entrants)

    def _come_back_when_awaited(self, server: RaceServer, seat: int) -> None:
        wait = server.lobby.wait_until

        def waited(is_so: Callable[[], bool], timeout_s: float = math.inf) -> bool:
            if timeout_s == math.inf:
                self.awaited.append(seat)
                server.session.come_back(seat)
            return wait(is_so, timeout_s)

        server.lobby.wait_until = waited  # type: ignore[method-assign]

    def _note_reviews(self, event: LiveEvent, *, kill_in_review: bool) -> None:
        show = event._board.show

        def shown(day: Day, phase: EventPhase, **how: Any) -> None:
            show(day, phase, **how)
            if phase is EventPhase.REVIEWED:
                self.reviews.append(len(day.records))
                if kill_in_review:
                    raise Killed

        event._board.show = shown  # type: ignore[method-assign]
