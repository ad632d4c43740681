"""How well an estimator knows where a kart is, over seeds: accuracy, and whether it knows that."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from race_agents.plant.radar import Floats
from race_agents.plant.row import Row
from race_agents.plant.sensors import Sensors
from race_agents.plant.trip import Course, Followed, Trip, drive, follow
from race_agents.unit.readings import Readings
from race_server.core.vehicles import Vehicle

SETTLED_S = 10.0  # figures count from here: the kart has left the grid
LEARNED_S = 30.0  # … and these, once a delay could be learned
LOST_S, SILENCE_S = 30.0, 10.0  # fixes end, and for how long
DELAYS = (0.04, 0.1, 0.2, 0.3)  # [s] of fixes without a stamp
# What a beam of beacons round a course lies outside of it [m], and how many stand on each side.
OUTSIDE, BESIDE = 5.0, 3
# 95 % of a normal distribution lie within this many deviations.
CONFIDENT = 1.96

Change = Callable[[Readings], Readings]


@dataclass(frozen=True)
class Setting:
    """What is driven, and how often."""

    course: Course
    vehicle: Vehicle
    seeds: int = 10
    seconds: float = 60.0
    grip_share: float = 0.6
    tell: Callable[[], None] = lambda: None  # called after each trip

    def trips(self, sensors: Sensors, seconds: float | None = None) -> Iterator[Trip]:
        """Yield a trip for each seed; the wheels' scale is off by another share each time."""
        for seed in range(self.seeds):
            scale = float(np.random.default_rng(seed).uniform(-0.02, 0.02))
            yield drive(
                self.course,
                self.vehicle,
                replace(sensors, wheel_scale=scale),
                seconds=seconds or self.seconds,
                seed=seed,
                grip_share=self.grip_share,
            )
            self.tell()


def as_of_now(readings: Readings) -> Readings:
    """Return readings whose fix tells of the moment at which it arrived."""
    fix = readings.fix
    return readings if fix is None else replace(readings, fix=replace(fix, stamp_s=readings.time_s))


def innocent(trip: Trip) -> Followed:
    """Return how a filter follows that takes fixes as of now, and tyres for rails."""
    return follow(trip, compliance=0.0, change=as_of_now)


def band(numbers: int, runs: int) -> tuple[float, float]:
    """Return the band of a mean of squares over runs (95 %).

    numbers: that each square is made of. The mean of N chi-square sums of n numbers lies within
    χ²(nN)/N (Bar-Shalom, Li and Kirubarajan 2001, section 5.4); the quantiles are those of Wilson
    and Hilferty (1931).
    """
    many = numbers * runs
    part = 2.0 / (9.0 * many)
    low, high = (
        many * (1.0 - part + side * math.sqrt(part)) ** 3 for side in (-CONFIDENT, CONFIDENT)
    )
    return low / runs, high / runs


def off_after(runs: Sequence[Followed], since_s: float) -> Floats:
    """Return how far off all runs were after a time [m]."""
    return np.concatenate([run.off[run.times > since_s] for run in runs])


def rms(values: Floats) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def rows(setting: Setting) -> list[Row]:
    """Return the table: where the kart is, before and after."""
    return [
        *stamped_rows(setting),
        *unstamped_rows(setting),
        *coarse_rows(setting),
        *silent_rows(setting),
        *beacon_rows(setting),
    ]


def stamped_rows(setting: Setting) -> list[Row]:
    """Return accuracy and consistency with fixes of 2 cm that come 100 ms late."""
    runs, were = [], []
    for trip in setting.trips(Sensors()):
        runs.append(follow(trip))
        were.append(innocent(trip))
    off, was = off_after(runs, SETTLED_S), off_after(were, SETTLED_S)
    result = [
        Row("place, fixes 2 cm, 100 ms late: RMS", "m", rms(off), most=0.03, before=rms(was)),
        Row(
            "place, fixes 2 cm, 100 ms late: 99 %",
            "m",
            float(np.quantile(off, 0.99)),
            most=0.10,
            before=float(np.quantile(was, 0.99)),
        ),
        Row(
            "heading, fixes 2 cm, 100 ms late: RMS",
            "°",
            _heading(runs),
            most=0.5,
            before=_heading(were),
        ),
    ]
    low, high = band(3, setting.seeds)
    result.append(
        Row("NEES of x, y, heading", "-", _nees(runs), low, high, before=_nees(were)),
    )
    for sensor, numbers in (("position", 2), ("gyro", 1), ("wheels", 1)):
        _, high = band(numbers, setting.seeds)
        nis, before = (_mean([run.innovations[sensor] for run in each]) for each in (runs, were))
        result.append(Row(f"NIS of {sensor}", "-", nis, most=high, before=before))
    return result


def unstamped_rows(setting: Setting) -> list[Row]:
    """Return accuracy where it is not known how late the fixes are."""
    offs, was, wrong = [], [], 0.0
    for delay in DELAYS:
        for trip in setting.trips(Sensors(fix_stamped=False, fix_delay_s=delay)):
            run = follow(trip)
            offs.append(run.off[run.times > LEARNED_S])
            was.append(off_after([innocent(trip)], LEARNED_S))
            # The kart reads its receiver 50 times a second: half a turn later in the mean.
            wrong = max(wrong, abs(float(run.delays[-1]) - delay - 0.01))
    off, before = np.concatenate(offs), np.concatenate(was)
    title = "place, fixes 2 cm, 40 to 300 ms late, not told: RMS"
    return [
        Row(title, "m", rms(off), most=0.06, before=rms(before)),
        Row("delay that was found, largest error", "ms", 1e3 * wrong, most=10.0),
    ]


def coarse_rows(setting: Setting) -> list[Row]:
    """Return accuracy with satellites alone, without and with the speed that a receiver tells."""
    result = []
    for words, deviation in (("", None), (" with speed and course", 0.1)):
        runs, were = [], []
        for trip in setting.trips(Sensors(fix_deviation=1.5, velocity_deviation=deviation)):
            runs.append(follow(trip))
            were.append(innocent(trip))
        off, was = off_after(runs, SETTLED_S), off_after(were, SETTLED_S)
        title = f"place, fixes 1.5 m{words}, 100 ms late: RMS"
        result.append(Row(title, "m", rms(off), most=0.45, before=rms(was)))
    return result


def silent_rows(setting: Setting) -> list[Row]:
    """Return whether ten seconds without a fix end in an honest deviation."""

    def ends(readings: Readings) -> Readings:
        return readings if readings.time_s < LOST_S else replace(readings, fix=None)

    honest, told, were = 0, 0.0, 0
    for trip in setting.trips(Sensors(), seconds=LOST_S + SILENCE_S + 1.0):
        run = follow(trip, change=ends)
        was = follow(trip, compliance=0.0, change=lambda given: as_of_now(ends(given)))
        place = int(np.searchsorted(run.times, LOST_S + SILENCE_S))
        honest += bool(run.off[place] < 2.0 * run.deviations[place])
        were += bool(was.off[place] < 2.0 * was.deviations[place])
        told = max(told, float(run.deviations[place]))
    share, before = honest / setting.seeds, were / setting.seeds
    return [
        Row(
            "10 s without fixes: off by less than twice of what is told",
            "share",
            share,
            least=0.95,
            before=before,
        ),
        Row("10 s without fixes: largest deviation told", "m", told, most=4.0),
    ]


def beacon_rows(setting: Setting) -> list[Row]:
    """Return accuracy by ranges to beacons round the course, a tenth of them by a detour."""
    sensors = Sensors(beacons=_round(setting.course.line), range_detours=0.1)

    def alone(readings: Readings) -> Readings:
        return replace(readings, fix=readings.fix if readings.time_s < 1.5 else None)

    runs = [follow(trip, change=alone) for trip in setting.trips(sensors)]
    off = off_after(runs, SETTLED_S)
    title = "place by beacons of 10 cm, 10 % of ranges 0.5 to 5 m too long: RMS"
    return [Row(title, "m", rms(off), most=0.10)]


def _round(line: Floats) -> tuple[tuple[float, float], ...]:
    """Return places of beacons on the two long sides of a course."""
    (x0, y0), (x1, y1) = line[:, :2].min(axis=0), line[:, :2].max(axis=0)
    return tuple(
        (float(x), float(y))
        for x in np.linspace(x0 - OUTSIDE, x1 + OUTSIDE, BESIDE)
        for y in (y0 - OUTSIDE, y1 + OUTSIDE)
    )


def _heading(runs: Sequence[Followed]) -> float:
    """Return the root mean square of the heading's error [°]."""
    errors = np.concatenate([run.errors[run.times > SETTLED_S, 2] for run in runs])
    return math.degrees(rms(errors))


def _nees(runs: Sequence[Followed]) -> float:
    return _mean([run.squares[run.times > SETTLED_S] for run in runs])


def _mean(values: Sequence[Floats]) -> float:
    return float(np.mean(np.concatenate(values)))
