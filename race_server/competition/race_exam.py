"""The exam of races: drivers against one another on many courses, their grid drawn for each race.

A race is driven in one process, without a network. Its outcome is kept in the user's cache, so that
an exam that was stopped goes on where it was.
"""

import contextlib
import math
import time
from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from types import MappingProxyType
from typing import Any

from race_server.competition.kept_outcomes import keep_outcome, kept_in, place_of
from race_server.competition.pool import SOLVING, Work, run_all
from race_server.competition.proportion import wilson_interval
from race_server.competition.race_day.race import DECISION_S, LocalRace, needs_line, rehearse
from race_server.competition.race_day.record import RaceRecord, Team
from race_server.competition.series import orders_of, rated
from race_server.competition.time_trial.run import HEARTBEAT_S, Tell
from race_server.core.messages import Event, EventKind
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import ScenarioError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.load import digest_of, load_course


@dataclass(frozen=True)
class RaceTask:
    """One race of an exam."""

    course: str  # a name, or the path of a course file
    drivers: tuple[str, ...]  # the first on pole
    seed: int
    vehicle: str = "tt02"
    laps: int = 5
    items: bool = True
    finish_limit_s: float = 0.0  # after the winner; 0: none
    decision_limit_s: float = DECISION_S


@dataclass(frozen=True)
class KartOutcome:
    """How a driver did in a race."""

    driver: str
    rank: int
    has_finished: bool
    laps: int
    best_lap_us: int  # 0: no lap
    wall_contacts: int
    kart_contacts: int
    rescues: int
    wrong_way: int  # times that it drove backwards
    remark: str = ""  # why it retired, and its penalties
    failed: bool = False  # the driver was not ready, raised, or took too long


@dataclass(frozen=True)
class RaceOutcome:
    """A race that was driven."""

    task: RaceTask
    karts: tuple[KartOutcome, ...] = ()  # the winner first
    failure: str = ""  # why it could not be driven


@dataclass(frozen=True)
class RaceRow:
    """How a driver did in all its races. Its fields are the keys of the JSON document."""

    driver: str
    starts: int
    finish_rate: float
    finish_interval: tuple[float, float]
    mean_place: float
    place_error: float  # standard error of it
    wins: int
    courses: int
    ahead_on: int  # of them: where its mean place is better than that of the row below
    rating: float
    rating_interval: tuple[float, float]
    wall_contacts: int
    kart_contacts: int
    rescues: int
    wrong_way: int
    retired: dict[str, str] = field(default_factory=dict)  # course with seed: why, of each kart


def tasks_of(
    drivers: Sequence[str], courses: Sequence[str], races: int, seed: int, like: RaceTask
) -> list[RaceTask]:
    """Return the races: each course in turn, each driver once from each place of the grid.

    Raises:
        ScenarioError: there are not two different drivers, or a course has too few places.
        RaceError: a course, the vehicle or a driver does not exist.
    """
    if len(set(drivers)) < 2:
        raise ScenarioError(
            f"drivers {', '.join(drivers) or 'none'}: a race needs two different ones or more; "
            "name them separated by commas"
        )
    vehicle_named(like.vehicle)
    for course in courses[:races]:
        if len(load_course(course).grid) < len(drivers):
            places = len(load_course(course).grid)
            raise ScenarioError(
                f"{course} has {places} grid places, and {len(drivers)} drivers are named; leave "
                "some out"
            )
    orders = orders_of(drivers, races, seed)
    return [
        RaceTask(
            courses[number % len(courses)],
            *(order, seed + number, like.vehicle, like.laps, like.items, like.finish_limit_s),
        )
        for number, order in enumerate(orders)
    ]


def hold_races(
    tasks: Sequence[RaceTask],
    jobs: int = 0,
    editions: Mapping[str, str] = MappingProxyType({}),
    watch: Callable[[str], None] = lambda _: None,
) -> Iterator[RaceOutcome]:
    """Yield each race as it ends; those that are kept first.

    jobs: processes; 0: one for each core. editions: of a driver, what else than the code decides
    how it drives: a digest of its policy. watch: is called with words for what goes on now.
    """
    waiting = []
    for task in tasks:
        kept = kept_in(_kept(task, editions), _outcome_in)
        if kept is not None:
            yield kept
        else:
            waiting.append(task)
    if waiting:
        # So that not every process compiles the same at the same time.
        rehearse(waiting[0].drivers, _scenario(waiting[0], solve=False))

    def report(number: int, laps: int) -> None:
        course = waiting[number].course
        watch(f"line of {course}" if laps == SOLVING else f"{course}, lap {laps + 1}")

    outcomes = run_all(Work(drive_race, lost_race), waiting, jobs, report)
    with contextlib.closing(outcomes):
        for _, outcome in outcomes:
            # What the clock of this machine decided may be another race the next time.
            if not outcome.failure and not any(kart.failed for kart in outcome.karts):
                keep_outcome(_kept(outcome.task, editions), asdict(outcome))
            yield outcome


def drive_race(task: RaceTask, tell: Tell) -> RaceOutcome:
    """Drive a race to its end.

    Raises:
        RaceError: a course or vehicle does not exist.
    """
    tell(SOLVING)
    scenario = _scenario(task, solve=any(needs_line(name) for name in task.drivers))
    # Kernels are loaded, and networks, before a decision is timed.
    rehearse(task.drivers, scenario)
    counts: Counter[tuple[int, EventKind]] = Counter()
    told = -math.inf
    lap = 0

    def watch(events: Sequence[Event]) -> None:
        nonlocal told, lap
        for event in events:
            is_end = event.kind is EventKind.WRONG_WAY and not event.value
            counts[event.kart, event.kind] += not is_end
            if event.kind is EventKind.LAP:
                lap = max(lap, event.other)
        if time.monotonic() - told > HEARTBEAT_S:
            tell(lap)
            told = time.monotonic()

    # Names of teams are unique, and drivers may have several karts.
    teams = [Team(str(seat), name) for seat, name in enumerate(task.drivers)]
    race = LocalRace("exam", scenario, None)
    record = race.run(teams, task.seed, watch)
    return RaceOutcome(task, _karts_of(record, task.drivers, counts, race.failed))


def lost_race(task: RaceTask, _begun_at: str, why: str) -> RaceOutcome:
    """Return the outcome of a race whose process was lost."""
    return RaceOutcome(task, failure=why)


def race_rows(outcomes: Sequence[RaceOutcome]) -> list[RaceRow]:
    """Return a row for each driver, the best rating first."""
    driven = [outcome for outcome in outcomes if outcome.karts]
    documents = [{"karts": [asdict(kart) for kart in outcome.karts]} for outcome in driven]
    found = rated(documents)
    places = [_mean_places(driven, rating["driver"]) for rating in found]
    rows = []
    for rating, (mine, below) in zip(found, pairwise([*places, {}]), strict=True):
        own = [
            (outcome.task, kart)
            for outcome in driven
            for kart in outcome.karts
            if kart.driver == rating["driver"]
        ]
        karts = [kart for _, kart in own]
        home = sum(kart.has_finished for kart in karts)
        rows.append(
            RaceRow(
                driver=rating["driver"],
                starts=len(own),
                finish_rate=home / len(own),
                finish_interval=wilson_interval(home, len(own)),
                mean_place=rating["mean_place"],
                place_error=rating["place_error"],
                wins=rating["wins"],
                courses=len(mine),
                ahead_on=sum(mine[one] < below.get(one, -math.inf) for one in mine),
                rating=rating["mu"],
                rating_interval=(rating["low"], rating["high"]),
                wall_contacts=sum(kart.wall_contacts for kart in karts),
                kart_contacts=sum(kart.kart_contacts for kart in karts),
                rescues=sum(kart.rescues for kart in karts),
                wrong_way=sum(kart.wrong_way for kart in karts),
                retired=_retired(own),
            )
        )
    return rows


def _retired(own: Sequence[tuple[RaceTask, KartOutcome]]) -> dict[str, str]:
    """Return why karts of a driver did not finish, those of one race with a slash between."""
    found: dict[str, list[str]] = {}
    for task, kart in own:
        if not kart.has_finished:
            where = f"{task.course} seed {task.seed}"
            found.setdefault(where, []).append(kart.remark or "did not finish")
    return {where: " / ".join(remarks) for where, remarks in found.items()}


def _mean_places(driven: Sequence[RaceOutcome], driver: str) -> dict[str, float]:
    """Return the driver's mean place on each course."""
    ranks: dict[str, list[int]] = {}
    for outcome in driven:
        for kart in outcome.karts:
            if kart.driver == driver:
                ranks.setdefault(outcome.task.course, []).append(kart.rank)
    return {course: fmean(found) for course, found in ranks.items()}


def _karts_of(
    record: RaceRecord,
    drivers: Sequence[str],
    counts: Mapping[tuple[int, EventKind], int],
    failed: Container[str],
) -> tuple[KartOutcome, ...]:
    return tuple(
        KartOutcome(
            driver=drivers[int(drive.team)],
            rank=rank,
            has_finished=drive.place > 0,
            laps=drive.laps,
            best_lap_us=drive.best_lap_us,
            wall_contacts=drive.wall_contacts,
            kart_contacts=drive.kart_contacts,
            rescues=counts[int(drive.team), EventKind.RESCUED],
            wrong_way=counts[int(drive.team), EventKind.WRONG_WAY],
            remark=drive.remark,
            failed=drive.team in failed,
        )
        for rank, drive in enumerate(record.drives, start=1)
    )


def _scenario(task: RaceTask, *, solve: bool) -> Scenario:
    rules = Rules(laps=task.laps, items=task.items, finish_limit_s=task.finish_limit_s)
    vehicles = (vehicle_named(task.vehicle),)
    course = load_course(task.course)
    return with_line(Scenario(course, len(task.drivers), vehicles, rules), solve=solve)


def _kept(task: RaceTask, editions: Mapping[str, str]) -> Path:
    known = [editions.get(name, "") for name in task.drivers]
    return place_of("race-exams", known, digest_of(task.course), task)


def _outcome_in(words: dict[str, Any]) -> RaceOutcome:
    task = words["task"] | {"drivers": tuple(words["task"]["drivers"])}
    return RaceOutcome(RaceTask(**task), tuple(KartOutcome(**kart) for kart in words["karts"]))
