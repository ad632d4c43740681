"""One run of a trial: a driver, one kart in one world, and the clock."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from race_server.competition.time_limit import TimeLimitExceeded, time_limit
from race_server.competition.time_trial.lap import Mark, TrialLap, laps_of, note_of
from race_server.competition.time_trial.run_spec import FLYING, STOPPED_S, RunSpec, task_of
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing, Driver, driver_named
from race_server.core.messages import Control, Event, EventKind, Retirement, Standing, Status
from race_server.core.observation import Observation
from race_server.core.rules.items import items
from race_server.core.state import Float32s, Floats, Record
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.errors import RaceError
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.load import load_course
from race_server.session.lap_log import LapLog

# Time limit to load a driver and for its first decision [s]: networks load, kernels compile.
START_LIMIT_S = 300.0
# Interval at which a run reports to the pool that it is alive [s].
HEARTBEAT_S = 0.2

Tell = Callable[[int], None]  # called with the number of laps driven so far
Make = Callable[[str], Driver]


@dataclass(frozen=True, eq=False)
class Run:
    """Outcome of a run."""

    spec: RunSpec
    started_at: str = ""  # UTC, ISO 8601
    laps: tuple[TrialLap, ...] = ()
    crashes: int = 0  # wall contacts, those of laps that do not count included
    rescues: int = 0
    touches: int = 0  # contacts with other karts
    overtakes: int = 0  # less those of others; laps ahead count once more
    draws: dict[str, float] = field(default_factory=dict)  # what the reality gap drew
    remark: str = ""  # why it ended early
    failed: bool = False  # the driver raised or stalled
    digest: str = ""  # of the world at the end
    standing: Standing | None = None  # None: nothing was driven


def now() -> str:
    """Return the present time in the format of results files."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def drive_run(spec: RunSpec, tell: Tell = lambda _: None, make: Make = driver_named) -> Run:
    """Drive one run to its end, whatever the driver does.

    Raises:
        RaceError: the course or the vehicle does not exist.
    """
    started_at = now()
    course = load_course(spec.track)
    try:
        with time_limit(START_LIMIT_S):
            driver = make(spec.driver)
            attempt = Attempt(spec, course, driver)
    except TimeLimitExceeded:
        return Run(spec, started_at, remark=f"not ready after {START_LIMIT_S:g} s", failed=True)
    except RaceError as error:
        return Run(spec, started_at, remark=str(error), failed=True)
    except (Exception, SystemExit) as error:
        return Run(spec, started_at, remark=f"raised {_in_words(error)}", failed=True)
    try:
        remark, failed = attempt.drive(tell), False
    except TimeLimitExceeded:
        remark, failed = f"stalled for {spec.decision_limit_s:g} s", True
    except (Exception, SystemExit) as error:
        remark, failed = f"raised {_in_words(error)}", True
    return attempt.outcome(started_at, remark, failed=failed)


def lost_run(spec: RunSpec, started_at: str, remark: str) -> Run:
    """Return the outcome of a run whose process was lost."""
    return Run(spec, started_at, remark=remark, failed=True)


def _in_words(error: BaseException) -> str:
    lines = str(error).splitlines()
    return f"{type(error).__name__}: {lines[0][:200]}" if lines else type(error).__name__


class Attempt:
    """A driver in its world, decision by decision."""

    def __init__(
        self, spec: RunSpec, course: Course, driver: Driver, line: ReferenceLine | None = None
    ) -> None:
        """Put the kart on its mark and brief the driver.

        line: to follow in place of the course's own.

        Raises:
            ScenarioError: the driver wants an observation that does not exist.
        """
        self.spec = spec
        self.course = course
        self.driver = driver
        task = task_of(spec, course, driver.preset, line)
        self.batch = Batch(task, seed=spec.seed, after=STAY)
        self.notes: list[tuple[float, ...]] = []
        self.marks: list[Mark] = []
        self._laps = LapLog()
        self.crashes = self.rescues = self.touches = 0
        self._ahead_at_first: Floats | None = None
        self._begin_lap()
        lidar = spec.gap.lidar()
        driver.reset(
            Briefing(
                seat=0,
                vehicle=vehicle_named(spec.vehicle),
                laps=spec.laps_driven,
                preset=driver.preset,
                decision_s=spec.decision_ticks * TICK_S,
                items=tuple(item.name for item in items()),
                lidar_field=lidar.field,
                lidar_reach=lidar.reach,
                waits=True,
            )
        )

    @property
    def _body(self) -> Record:
        return self.batch.world.bodies[0, 0]

    @property
    def _racer(self) -> Record:
        return self.batch.world.racers[0, 0]

    @property
    def laps_done(self) -> int:
        """Laps that count, so far."""
        return max(len(self.marks) - (1 if self.spec.start == FLYING else 0), 0)

    def drive(self, tell: Tell) -> str:
        """Drive until the kart is out or finished; return why it ended early, "" if it finished."""
        limit_s, told = START_LIMIT_S, -HEARTBEAT_S
        self._note()
        while self._body.status == codes.RACING:
            if time.monotonic() - told > HEARTBEAT_S:
                tell(self.laps_done)
                told = time.monotonic()
            with time_limit(limit_s):
                control = self.driver.act(self._look())
                numbers = numbers_of(control)
            self._move(numbers)
            if limit_s == START_LIMIT_S:
                # From now on the shorter time limit holds in the pool, too.
                limit_s, told = self.spec.decision_limit_s, -HEARTBEAT_S
        tell(self.laps_done)
        return self._reason()

    def _look(self) -> Observation:
        batch = self.batch
        tick = int(batch.world.races[0].tick)
        # A copy, so that a driver cannot change the buffer of the world.
        return Observation(tick, batch.layout, batch.observations[0, 0].copy())

    def _move(self, numbers: Float32s) -> None:
        self.batch.buffers.actions[0, 0] = numbers
        self.batch.step()
        self._note()
        if self._ahead_at_first is None:
            self._ahead_at_first = self._ahead(self.batch.world.racers[0]["progress"])
            self._driven_at_first = self.batch.world.racers[0]["distance"].copy()
        count = int(self.batch.world.event_counts[0])
        for row in self.batch.world.events[0][:count]:
            if int(row.kart) not in {0, -1}:
                self.touches += int(row.kind) == EventKind.CONTACT_KART and int(row.other) == 0
                continue
            other, value, detail = int(row.other), int(row.value), int(row.detail)
            kind = EventKind(int(row.kind))
            self._count(Event(int(row.sequence), int(row.tick), kind, 0, other, value, detail))

    def _count(self, event: Event) -> None:
        """Record an event."""
        if event.kind is EventKind.CONTACT_WALL:
            self.crashes += 1
            self._contacts += 1
        elif event.kind is EventKind.CONTACT_KART:
            self.touches += 1
        elif event.kind is EventKind.RESCUED:
            self.rescues += 1
            self._rescues += 1
        if (lap := self._laps.add(event)) is not None:
            end_us, counts = int(self._racer.lap_start_us), (self._contacts, self._rescues)
            self.marks.append(Mark(end_us, lap.time_us, lap.sectors, lap.is_clean, *counts))
            self._begin_lap()

    def _ahead(self, along: Floats) -> Floats:
        """Return how far ahead of each other kart this one is [m], at most half a lap: (K - 1,)."""
        length = self.course.length
        return (along[0] - along[1:] + 0.5 * length) % length - 0.5 * length

    def overtakes(self) -> int:
        """Return how many karts were overtaken, less those that did; each lap ahead is one more."""
        if self._ahead_at_first is None:
            return 0
        racers, length = self.batch.world.racers[0], self.course.length
        driven = racers["distance"] - self._driven_at_first
        ahead = self._ahead_at_first + driven[0] - driven[1:]
        there = self.batch.world.bodies[0, 1:]["status"] != codes.ABSENT
        places = np.floor(ahead / length) - np.floor(self._ahead_at_first / length)
        return int(places[there].sum())

    def _begin_lap(self) -> None:
        self._contacts = self._rescues = 0

    def _note(self) -> None:
        body, racer, race = self._body, self._racer, self.batch.world.races[0]
        seconds = (int(race.tick) - int(race.start_tick)) * TICK_S
        self.notes.append(note_of(seconds, body, racer))

    def _reason(self) -> str:
        """Return a text that says why a run ended before its last lap."""
        racer = self._racer
        if self._body.status != codes.RETIRED:
            return ""
        words = {
            Retirement.STOPPED: f"stood still for {STOPPED_S:g} s",
            Retirement.TIME_OUT: "out of time",
        }
        reason = Retirement(int(racer.retired_for))
        where = f"in lap {self.laps_done + 1} at {racer.progress:.1f} m"
        if self.spec.start == FLYING and not self.marks:
            where = f"before the first lap at {racer.progress:.1f} m"
        return f"{words.get(reason, reason.name.lower().replace('_', ' '))} {where}"

    def outcome(self, started_at: str, remark: str, *, failed: bool) -> Run:
        """Return the outcome of the run so far."""
        flying = self.spec.start == FLYING
        laps = laps_of(self.notes, self.marks, self.course.length, flying=flying)
        return Run(
            spec=self.spec,
            started_at=started_at,
            laps=laps,
            crashes=self.crashes,
            rescues=self.rescues,
            touches=self.touches,
            overtakes=self.overtakes(),
            draws=self.batch.draws(0, 0),
            remark=remark,
            failed=failed,
            digest=self.batch.digest(),
            standing=self._standing(laps),
        )

    def _standing(self, laps: tuple[TrialLap, ...]) -> Standing:
        body, racer = self._body, self._racer
        times = tuple(lap.time_us for lap in laps)
        finished = body.status == codes.FINISHED
        penalty_us = int(racer.penalty_us)
        return Standing(
            seat=0,
            driver=self.spec.driver,
            rank=1,
            laps=len(laps),
            status=Status(int(body.status)),
            last_lap_us=times[-1] if times else 0,
            best_lap_us=min(times, default=0),
            race_time_us=sum(times) + penalty_us if finished else 0,
            gap_us=0,
            penalties=int(racer.penalties),
            penalty_us=penalty_us,
            items_used=0,
            lap_times_us=times,
        )


def numbers_of(control: Control) -> Float32s:
    """Return a control as the world takes it: clipped to its limits, in single precision.

    A live server receives the same over the network; not-a-number counts as zero.
    """
    wanted = (float(control.steering), float(control.throttle), float(control.brake))
    shares = np.clip(np.nan_to_num(wanted), (-1.0, -1.0, 0.0), 1.0)
    return np.append(shares, int(control.buttons)).astype(np.float32)
