"""Coaches the drivers of a race that is on: after each lap, and by cues on the way."""

import math
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

from race_server.coaching.advice import tips_for
from race_server.coaching.cues import Cue, Moment, cues_for, due
from race_server.coaching.lap import Lap, lap_on, with_pedals_felt
from race_server.coaching.lesson import Coach, Lesson
from race_server.competition.live_laps import Glance, LiveLaps, SeenLap
from race_server.core.messages import Phase
from race_server.live.client.race_view import RaceView
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic

# Messages that wait at most: half a minute's. Of more the oldest are lost, and their laps.
MOST_WAITING = 2_000
MOST_EVENTS = 4096


@dataclass(frozen=True)
class Said:
    """What the coach says to a driver: of a lap that ended, or a cue on the way."""

    driver: str
    words: str  # what to try, or why the lap is not compared; empty where nothing was wrong
    lap: int = 0  # of a lap: its number
    time_us: int = 0  # of a lap
    behind_us: int | None = None  # … what it is behind the limit; None where it is not compared
    corner: str = ""  # of a cue


@dataclass(eq=False)
class _Pupil:
    """What is known of one driver."""

    name: str
    laps: list[tuple[int, Lap, str]] = field(default_factory=list)
    best: Lap | None = None
    cues: tuple[Cue, ...] = ()
    progress: float = 0.0  # [m] at the last glance
    said: set[str] = field(default_factory=set)  # corners with a cue in this lap
    spoken_s: float = -math.inf


class RaceCoach:
    """The coach of all drivers of one race, fed with what spectators receive.

    It ends with the race of which it saw a lap, also where the next race begins at once.
    """

    def __init__(self, coaches: Sequence[Coach]) -> None:
        """Wait for a race. coaches: of the vehicles of the seats, repeated in turn."""
        self._coaches = coaches
        self.view, self._laps = RaceView(MOST_EVENTS), LiveLaps(coaches[0].course.length)
        self._pupils: dict[int, _Pupil] = {}
        self.is_over = False

    def _coach_of(self, seat: int) -> Coach:
        return self._coaches[seat % len(self._coaches)]

    def receive(self, topic: Topic, data: bytes) -> Iterator[Said]:
        """Take a message; yield what there is to say."""
        if self.is_over and topic not in {topics.EVENTS, topics.RECENT}:
            return
        update = self.view.receive(topic, data, time.monotonic())
        if update is None:
            return
        if update.is_other_race and self.has_laps:
            self.is_over = True
            return
        if update.is_other_race:
            self._laps.begin()
            self._pupils.clear()
        self._laps.hear(update.events)
        if topic is topics.SNAPSHOT and self.view.snapshot is not None:
            for glance in self._laps.see(self.view.snapshot):
                yield from self._cue(glance)
        standings = self.view.standings
        has_ended = standings is not None and standings.phase is Phase.FINISHED
        for seen in self._laps.ended(is_over=has_ended):
            yield self._study(seen)
        self.is_over |= has_ended and self.has_laps

    @property
    def has_laps(self) -> bool:
        """Whether a whole lap was seen."""
        return any(pupil.laps for pupil in self._pupils.values())

    def lessons(self) -> dict[int, Lesson]:
        """Return what the race taught each driver, by seat."""
        return {
            seat: self._coach_of(seat).lesson(pupil.name, pupil.laps)
            for seat, pupil in sorted(self._pupils.items())
            if pupil.laps
        }

    def _pupil(self, seat: int) -> _Pupil:
        standings = self.view.standings
        rows = standings.rows if standings else ()
        name = next((row.driver for row in rows if row.seat == seat), "")
        pupil = self._pupils.setdefault(seat, _Pupil(name))
        pupil.name = pupil.name or name or f"seat {seat}"
        return pupil

    def _study(self, seen: SeenLap) -> Said:
        coach, pupil = self._coach_of(seen.seat), self._pupil(seen.seat)
        felt = lap_on(coach.course, f"lap {seen.number}", seen.lap.time_us, seen.lap.columns)
        lap = with_pedals_felt(felt, coach.bounds)
        pupil.laps.append((seen.number, lap, seen.reason))
        if seen.reason:
            return Said(pupil.name, seen.reason, seen.number, lap.time_us)
        if pupil.best is None or lap.time_us < pupil.best.time_us:
            pupil.best = lap
        studied = coach.study(seen.number, lap, pupil.best)
        pupil.cues = cues_for(studied.faults)
        tips = tips_for([studied.faults])
        words = tips[0].words if tips else ""
        behind_us = lap.time_us - coach.limit.time_us
        return Said(pupil.name, words, seen.number, lap.time_us, behind_us)

    def _cue(self, glance: Glance) -> Iterator[Said]:
        pupil = self._pupil(glance.seat)
        if glance.progress < pupil.progress - 0.5 * self._coach_of(glance.seat).course.length:
            pupil.said.clear()  # another lap
        pupil.progress = glance.progress
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
            yield Said(pupil.name, cue.words, corner=cue.corner)


class LiveCoach:
    """A coach that listens to a race over its link."""

    def __init__(self, link: ClientLink, coaches: Sequence[Coach]) -> None:
        """Begin to listen, see `RaceCoach`.

        Raises:
            LinkError: the server does not answer.
        """
        self.race, self._link = RaceCoach(coaches), link
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
