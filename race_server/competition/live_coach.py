"""Coaches the drivers of a race that is on: after each lap, and by cues on the way."""

import math
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from race_server.coaching.advice import tips_for
from race_server.coaching.cues import Cue, Moment, cues_for, due
from race_server.coaching.lap import Lap, lap_on, with_pedals_felt
from race_server.coaching.lesson import Coach, Lesson
from race_server.competition.live_laps import Glance, LiveLaps, SeenLap
from race_server.competition.time_trial.lap import COLUMNS
from race_server.core.messages import Phase
from race_server.live.client.race_view import RaceView
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic

# Messages that wait at most; of more than these the oldest are lost, and with them their laps.
MOST_WAITING = 20_000
MOST_EVENTS = 4096


@dataclass(frozen=True)
class Said:
    """What the coach says to a driver: of a lap that ended, or a cue on the way."""

    seat: int
    driver: str
    words: str  # what to try, or why the lap is not compared; empty where nothing was wrong
    lap: int = 0  # of a lap: its number
    time_us: int = 0  # of a lap
    behind_us: int | None = None  # … what it is behind the limit; None where it is not compared
    corner: str = ""  # of a cue


@dataclass(eq=False)
class _Pupil:
    """What is known of one driver."""

    laps: list[tuple[int, Lap, str]] = field(default_factory=list)
    best: Lap | None = None
    cues: tuple[Cue, ...] = ()
    said: set[str] = field(default_factory=set)  # corners with a cue in this lap
    spoken_s: float = -math.inf


class RaceCoach:
    """The coach of all drivers of a race, fed with what spectators receive."""

    def __init__(self, coach: dict[int, Coach] | Coach) -> None:
        """Wait for a race. coach: of all seats, or of each, for karts that differ."""
        self._coach = coach
        self.view = RaceView(MOST_EVENTS)
        self._laps = LiveLaps(self.coach_of(0).course.length)
        self._pupils: dict[int, _Pupil] = {}

    def coach_of(self, seat: int) -> Coach:
        """Return what laps of a seat are compared with."""
        return self._coach if isinstance(self._coach, Coach) else self._coach[seat]

    @property
    def is_over(self) -> bool:
        """Whether the race has ended."""
        standings = self.view.standings
        return standings is not None and standings.phase is Phase.FINISHED

    def receive(self, topic: Topic, data: bytes) -> Iterator[Said]:
        """Take a message; yield what there is to say."""
        update = self.view.receive(topic, data, time.monotonic())
        if update is None:
            return
        if update.is_other_race:
            self._laps.begin()
            self._pupils.clear()
        self._laps.hear(update.events)
        if topic is topics.SNAPSHOT and self.view.snapshot is not None:
            for glance in self._laps.see(self.view.snapshot):
                yield from self._cue(glance)
        for seen in self._laps.ended():
            yield self._study(seen)

    def lessons(self) -> dict[int, Lesson]:
        """Return what the race taught each driver, by seat."""
        return {
            seat: self.coach_of(seat).lesson(self._name(seat), pupil.laps)
            for seat, pupil in sorted(self._pupils.items())
            if pupil.laps
        }

    def _name(self, seat: int) -> str:
        standings = self.view.standings
        rows = standings.rows if standings else ()
        return next((row.driver for row in rows if row.seat == seat), f"seat {seat}")

    def _pupil(self, seat: int) -> _Pupil:
        return self._pupils.setdefault(seat, _Pupil())

    def _study(self, seen: SeenLap) -> Said:
        coach, pupil = self.coach_of(seen.seat), self._pupil(seen.seat)
        columns = dict(zip(COLUMNS, seen.lap.trace, strict=True))
        felt = lap_on(coach.course, f"lap {seen.number}", seen.lap.time_us, columns)
        lap = with_pedals_felt(felt, coach.bounds)
        pupil.laps.append((seen.number, lap, seen.reason))
        pupil.said.clear()
        told = seen.seat, self._name(seen.seat)
        if seen.reason:
            return Said(*told, seen.reason, seen.number, lap.time_us)
        if pupil.best is None or lap.time_us < pupil.best.time_us:
            pupil.best = lap
        studied = coach.study(seen.number, lap, pupil.best)
        pupil.cues = cues_for(studied.faults)
        tips = tips_for([studied.faults])
        words = tips[0].words if tips else ""
        return Said(*told, words, seen.number, lap.time_us, lap.time_us - coach.limit.time_us)

    def _cue(self, glance: Glance) -> Iterator[Said]:
        pupil = self._pupil(glance.seat)
        if pupil.best is None:
            return
        moment = Moment(
            progress=glance.progress,
            speed=glance.speed,
            ahead_s=glance.ahead_s,
            behind_s=glance.behind_s,
            is_cautioned=glance.is_cautioned,
            is_driving=glance.is_driving,
            since_cue_s=glance.seconds - pupil.spoken_s,
        )
        cue = due(pupil.cues, moment, pupil.best, pupil.said)
        if cue is not None:
            pupil.said.add(cue.corner)
            pupil.spoken_s = glance.seconds
            yield Said(glance.seat, self._name(glance.seat), cue.words, corner=cue.corner)


class LiveCoach:
    """A coach that listens to a race over its link."""

    def __init__(self, link: ClientLink, coach: dict[int, Coach] | Coach) -> None:
        """Begin to listen.

        Raises:
            LinkError: the server does not answer.
        """
        self.race, self._link = RaceCoach(coach), link
        self._inbox: deque[tuple[Topic, bytes]] = deque(maxlen=MOST_WAITING)
        self._heard_at = time.monotonic()
        for topic in (topics.SNAPSHOT, topics.STANDINGS, topics.EVENTS):
            link.listen(topic, partial(self._store, topic))
        self.ask()

    def ask(self) -> None:
        """Ask for the standings and the recent events.

        Raises:
            LinkError: the server does not answer.
        """
        for topic in (topics.TABLE, topics.RECENT):
            self._store(topic, self._link.ask(topic))

    def _store(self, topic: Topic, data: bytes) -> None:
        self._inbox.append((topic, data))
        self._heard_at = time.monotonic()

    def silence_s(self) -> float:
        """Return the time [s] since the last message."""
        return time.monotonic() - self._heard_at

    def heard(self) -> Iterator[Said]:
        """Yield what there is to say of all that has come."""
        while self._inbox:
            yield from self.race.receive(*self._inbox.popleft())
