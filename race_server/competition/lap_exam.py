"""The exam of laps: drivers alone on many courses, each course driven once by each of them.

Runs are those of time trials. What a driver did on a course is kept in the user's cache, so that an
exam that was stopped goes on where it was, and the same question is not driven twice.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from statistics import median
from types import MappingProxyType
from zlib import crc32

import numpy as np

from race_server.competition.kept_outcomes import keep_outcome, kept_in, place_of
from race_server.competition.pool import SOLVING, Work, run_all
from race_server.competition.proportion import wilson_interval
from race_server.competition.time_trial.figures import intervals
from race_server.competition.time_trial.gaps import DECISION_TICKS, NONE, Gap
from race_server.competition.time_trial.lap import TrialLap, X, Y
from race_server.competition.time_trial.plan import compile_once
from race_server.competition.time_trial.run import Run, Tell, drive_run, lost_run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.errors import RaceError, TrackError
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.program import load_casadi
from race_server.scenario.raceline.reference import known_limit, reference_limit
from race_server.scenario.track.course import Course
from race_server.scenario.track.load import digest_of, load_course
from race_server.scenario.track.polyline import nearest_on, segments_of

# Kinds of courses that are drawn in turn, for model cars and for longer vehicles.
SMALL = ("block", "spline", "circuit")
LARGE = ("spline:{}:kart", "circuit:{}:kart")


def examined_courses(
    folder: Path | None, count: int, first_seed: int, vehicle: Vehicle
) -> tuple[str, ...]:
    """Return the course files of a folder, or the names of generated courses where there is none.

    Raises:
        TrackError: the folder has no course file.
    """
    return courses_in(folder) if folder is not None else drawn_courses(count, first_seed, vehicle)


def drawn_courses(count: int, first_seed: int, vehicle: Vehicle) -> tuple[str, ...]:
    """Return the names of generated courses of a vehicle's scale, of each kind in turn."""
    forms = tuple(f"{kind}:{{}}" for kind in SMALL) if vehicle.is_model_car else LARGE
    return tuple(f"generated:{forms[n % len(forms)].format(first_seed + n)}" for n in range(count))


def courses_in(folder: Path) -> tuple[str, ...]:
    """Return the course files of a folder, in alphabetic order.

    Raises:
        TrackError: there is none.
    """
    found = tuple(str(path) for path in sorted(folder.glob("*.toml")))
    if not found:
        raise TrackError(f"{folder}: no course file (.toml) in it; name a folder that has some")
    return found


@dataclass(frozen=True)
class LapExamSpec:
    """What is asked of every driver."""

    courses: tuple[str, ...]  # names, or paths of course files
    vehicle: str = "tt02"
    laps: int = 5  # from a flying start, that count
    jobs: int = 0  # processes; 0: one for each core
    simulator: str = ""  # that moves the vehicle, see `race_server.second`; empty: ours
    decision_ticks: int = DECISION_TICKS
    gaps: tuple[Gap, ...] = (NONE,)
    warm_up: int = 1  # laps that come before those that count, 1 or more
    traffic: int = 0

    def runs_of(self, drivers: Sequence[str]) -> list[RunSpec]:
        """Return a run for each driver with each gap on each course.

        The seed follows from the name of the course: what a gap and noise draw differs between
        courses, and is the same for all drivers and in every list.
        """
        like = RunSpec(
            *("", "", self.vehicle),
            laps=self.laps + self.warm_up - 1,
            simulator=self.simulator,
            decision_ticks=self.decision_ticks,
            traffic=self.traffic,
        )
        return [
            replace(like, driver=driver, gap=gap, track=course, seed=_seed_of(course))
            for driver, gap, course in product(drivers, self.gaps, self.courses)
        ]


def _seed_of(course: str) -> int:
    """Return a seed that follows from the name of a course, or of its file."""
    return crc32(Path(course).stem.encode())


@dataclass(frozen=True)
class CourseTry:
    """How a driver did on one course."""

    driver: str
    course: str
    laps_wanted: int
    limit_s: float | None  # None: unknown
    times_s: tuple[float, ...]  # of the laps that were completed and count
    clean: int  # of them
    contacts: int  # with walls, those of the laps before included
    rescues: int
    remark: str = ""  # why the run ended early, or has no limit
    off_centre_m: float | None = None  # mean distance from the centre line; None: no lap
    gap: str = NONE.name
    failed: bool = False  # the driver refused, raised or stalled
    touches: int = 0  # contacts with other karts
    overtakes: int = 0  # less those of others; each lap ahead is one more

    @property
    def ratios(self) -> list[float]:
        """Times of laps over the limit of the course."""
        return [time / self.limit_s for time in self.times_s] if self.limit_s else []


@dataclass(frozen=True)
class LapRow:
    """One driver on all courses. Its fields are a contract; intervals are bounds of 95 %."""

    driver: str
    courses: int
    laps: int  # wanted; one that was not completed is not clean
    clean_lap_rate: float
    clean_lap_interval: tuple[float, float]  # as if laps of one course were independent
    clean_course_rate: float  # courses with no lap that is not clean
    clean_course_interval: tuple[float, float]
    ratio: float | None  # median time of a lap over the limit of its course
    ratio_interval: tuple[float | None, float | None]  # bootstrap over courses and laps
    contacts: int
    rescues: int
    not_clean: dict[str, int]  # clean laps of the courses with fewer than wanted
    remarks: tuple[str, ...]
    gap: str = NONE.name

    @staticmethod
    def of(tries: Sequence[CourseTry]) -> "LapRow":
        """Return the row of one driver's tries with one gap."""
        wanted, clean = sum(one.laps_wanted for one in tries), sum(one.clean for one in tries)
        spoilt = {one.course: one.clean for one in tries if one.clean < one.laps_wanted}
        held = len(tries) - len(spoilt)
        ratios = [one.ratios for one in tries if one.ratios]
        return LapRow(
            driver=tries[0].driver,
            courses=len(tries),
            laps=wanted,
            clean_lap_rate=clean / wanted,
            clean_lap_interval=wilson_interval(clean, wanted),
            clean_course_rate=held / len(tries),
            clean_course_interval=wilson_interval(held, len(tries)),
            ratio=median(ratio for group in ratios for ratio in group) if ratios else None,
            ratio_interval=intervals(ratios)[0],
            contacts=sum(one.contacts for one in tries),
            rescues=sum(one.rescues for one in tries),
            not_clean=spoilt,
            remarks=tuple(f"{one.course}: {one.remark}" for one in tries if one.remark),
            gap=tries[0].gap,
        )


def rows_of(tries: Sequence[CourseTry]) -> list[LapRow]:
    """Return a row for each driver and each gap, in the order of their first tries."""
    groups: dict[tuple[str, str], list[CourseTry]] = {}
    for one in tries:
        groups.setdefault((one.driver, one.gap), []).append(one)
    return [LapRow.of(group) for group in groups.values()]


def examine(
    spec: LapExamSpec,
    drivers: Sequence[str],
    editions: Mapping[str, str] = MappingProxyType({}),
    watch: Callable[[str], None] = lambda _: None,
) -> Iterator[CourseTry]:
    """Yield how each driver did on each course, as they finish; those that are kept first.

    editions: of a driver, what else than the code decides how it drives: a digest of its policy.
    watch: is called with words for what goes on now.

    Raises:
        RaceError: a course or the vehicle does not exist.
    """
    vehicle_named(spec.vehicle)
    waiting = []
    for run in spec.runs_of(drivers):
        kept = _read(_kept(run, spec.warm_up, editions))
        if kept is not None:
            yield kept
        else:
            waiting.append(run)
    for track in dict.fromkeys(run.track for run in waiting if run.track.endswith(".toml")):
        # One that describes no course ends the exam before it drives, not in the middle.
        watch(f"reading {Path(track).name}")
        load_course(track)
    if waiting:
        compile_once(waiting[0])

    def report(number: int, laps: int) -> None:
        run = waiting[number]
        course = Path(run.track).name
        is_solving = laps == SOLVING
        watch(f"limit of {course}" if is_solving else f"{run.driver}, {course}, lap {laps + 1}")

    outcomes = run_all(Work(drive_with_limit, lost_run), waiting, spec.jobs, report)
    with contextlib.closing(outcomes):
        for _, driven in outcomes:
            one = try_of(driven, spec.warm_up)
            if not driven.failed and _is_final(one):
                keep_outcome(_kept(driven.spec, spec.warm_up, editions), asdict(one))
            yield one


def drive_with_limit(spec: RunSpec, tell: Tell) -> Run:
    """Drive a run once the limit of its course is solved, here, beside those of other courses."""
    with contextlib.suppress(RaceError):  # the run says what it lacks
        course, vehicle = load_course(spec.track), vehicle_named(spec.vehicle)
        if known_limit(course, bounds_of(vehicle)) is None:
            tell(SOLVING)
            reference_limit(course, vehicle)
    return drive_run(spec, tell)


def try_of(run: Run, warm_up: int = 1) -> CourseTry:
    """Return what an exam keeps of a run. warm_up: laps that come before those that count."""
    course, vehicle = load_course(run.spec.track), vehicle_named(run.spec.vehicle)
    limit = known_limit(course, bounds_of(vehicle))
    remark = run.remark or ("" if limit else f"no limit of {vehicle.name} is known")
    laps = run.laps[warm_up - 1 :]  # that before a flying start is not among them
    return CourseTry(
        driver=run.spec.driver,
        course=run.spec.track,
        laps_wanted=run.spec.laps - (warm_up - 1),
        limit_s=limit.minimum_time.time_s if limit else None,
        times_s=tuple(lap.time_s for lap in laps),
        clean=sum(lap.is_clean for lap in laps),
        contacts=run.crashes,
        rescues=run.rescues,
        remark=remark,
        off_centre_m=_off_centre(course, laps),
        gap=run.spec.gap.name,
        failed=run.failed,
        touches=run.touches,
        overtakes=run.overtakes,
    )


def _off_centre(course: Course, laps: Sequence[TrialLap]) -> float | None:
    """Return how far [m] laps are from the centre line in the mean."""
    traces = [lap.trace for lap in laps]
    if not traces:
        return None
    distances, _ = nearest_on(segments_of(course.line[:, :2]), np.hstack(traces)[[X, Y]].T)
    return float(distances.mean())


def _is_final(one: CourseTry) -> bool:
    """Return whether the same question has the same answer again.

    Without the solver of limits it has not: with it there is a limit, and a line to drive along.
    """
    if one.limit_s is None:
        try:
            load_casadi()
        except RaceError:
            return False
    return True


def _kept(spec: RunSpec, warm_up: int, editions: Mapping[str, str]) -> Path:
    """Return the file that keeps a run."""
    edition = editions.get(spec.driver, "")
    return place_of("lap-exams", edition, digest_of(spec.track), warm_up, spec)


def _read(path: Path) -> CourseTry | None:
    """Return what a file keeps, or None if there is none that can be read."""
    return kept_in(path, lambda words: CourseTry(**(words | {"times_s": tuple(words["times_s"])})))
