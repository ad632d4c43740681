"""Coaches the drivers of a race that is on: after each lap, and by cues on the way."""

import math
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from race_server.coaching.advice import tips_for
from race_server.coaching.corners import Corner
from race_server.coaching.cues import Cue, Moment, cues_for, due
from race_server.coaching.fading import DRIVEN_AFTER, Fading
from race_server.coaching.faults import Fault, FaultKind
from race_server.coaching.lap import Lap, lap_on, with_pedals_felt
from race_server.coaching.lesson import Coach, Lesson
from race_server.competition.live_laps import Glance, LiveLaps, SeenLap
from race_server.core.hint import Hint, HintKind
from race_server.core.messages import Phase
from race_server.live.client.listener import Listener
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

    seat: int
    driver: str
    words: str  # what to try, or why the lap is not compared; empty where nothing was wrong
    hint: Hint  # the same as figures


@dataclass(eq=False)
class _Pupil:
    """What is known of one driver."""

    name: str
    laps: list[tuple[int, Lap, str]] = field(default_factory=list)
    best: Lap | None = None
    # Help by words, and by a kart that brakes and accelerates: each is withdrawn in its own time.
    told: Fading = field(default_factory=Fading)
    driven: Fading = field(default_factory=partial(Fading, DRIVEN_AFTER))
    faults: dict[str, Fault] = field(default_factory=dict)  # the last one of each corner
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
        hint = Hint(lap=seen.number, time_us=lap.time_us, reason=seen.reason)
        if seen.reason:
            hint = replace(hint, helped=_helped(coach, pupil))
            return Said(seen.seat, pupil.name, seen.reason, hint)
        if pupil.best is None or lap.time_us < pupil.best.time_us:
            pupil.best = lap
        studied = coach.study(seen.number, lap, pupil.best)
        faults = {one.corner.name: one for one in sorted(studied.faults, key=_cost_of)}
        corners = [corner.name for corner in coach.corners]
        for fading in (pupil.told, pupil.driven):
            fading.take(corners, faults)
        pupil.faults |= faults
        pupil.cues = cues_for([pupil.faults[name] for name in corners if pupil.told.helps(name)])
        tips = tips_for([studied.faults])
        behind_us = lap.time_us - coach.limit.time_us
        hint = replace(hint, behind_us=behind_us, helped=_helped(coach, pupil))
        if not tips:
            return Said(seen.seat, pupil.name, "", hint)
        tip = tips[0]
        hint = replace(hint, **_figures_of(tip.kind, tip.corner), size=tip.size)
        return Said(seen.seat, pupil.name, tip.words, hint)

    def _cue(self, glance: Glance) -> Iterator[Said]:
        coach, pupil = self._coach_of(glance.seat), self._pupil(glance.seat)
        if glance.progress < pupil.progress - 0.5 * coach.course.length:
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
            corner = pupil.faults[cue.corner].corner
            hint = Hint(**_figures_of(cue.kind, corner), helped=_helped(coach, pupil))
            yield Said(glance.seat, pupil.name, cue.words, hint)


def _cost_of(fault: Fault) -> int:
    return fault.cost_us


def _figures_of(kind: FaultKind, corner: Corner) -> dict[str, Any]:
    """Return what a hint tells of a fault."""
    reach = corner.reach if corner.is_braked else 0.0
    return {"kind": HintKind[kind.name], "corner": corner.name, "reach": reach}


def _helped(coach: Coach, pupil: _Pupil) -> tuple[tuple[float, float], ...]:
    """Return the stretches in which a kart that helps by itself does so, from and to [m]."""
    length = coach.course.length
    return tuple(
        (corner.begin % length, corner.end % length)
        for corner in coach.corners
        if pupil.driven.helps(corner.name)
    )


class LiveCoach:
    """A coach that listens to a race over its link."""

    def __init__(self, link: ClientLink, coaches: Sequence[Coach]) -> None:
        """Begin to listen, see `RaceCoach`.

        Raises:
            LinkError: the server does not answer.
        """
        self.race = RaceCoach(coaches)
        self._inbox: deque[tuple[Topic, bytes]] = deque(maxlen=MOST_WAITING)
        wanted = topics.SNAPSHOT, topics.STANDINGS, topics.EVENTS
        self._listener = Listener(link, wanted, self._store)
        self.ask()

    def ask(self) -> None:
        """Ask for the standings and the recent events.

        Raises:
            LinkError: the server does not answer.
        """
        for topic in (topics.TABLE, topics.RECENT):
            self._listener.ask(topic)

    def _store(self, topic: Topic, data: bytes) -> None:
        self._inbox.append((topic, data))

    def silence_s(self) -> float:
        """Return the time [s] since the last message."""
        return self._listener.silence_s()

    def heard(self) -> Iterator[Said]:
        """Yield what there is to say of all that has come."""
        while self._inbox:
            yield from self.race.receive(*self._inbox.popleft())
