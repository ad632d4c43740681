"""Whether help that fades teaches more than help that stays: pupils drive, the coach decides."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from race_agents.pupils.coaching_exam import SIZES, School
from race_agents.pupils.habit import Habit, Road, line_with
from race_agents.pupils.laps import drive_lap
from race_agents.pupils.learner import Nature, Skill, after, made, nature_of
from race_server.coaching.corners import Corner
from race_server.coaching.fading import (
    DRIVEN_AFTER,
    WITHDRAWN_AFTER,
    Attention,
    Help,
    after_lap,
)
from race_server.coaching.faults import FaultKind
from race_server.coaching.lap import Lap
from race_server.core.clock import MICROSECONDS
from race_server.errors import ScenarioError

NEVER, ALWAYS, FADING = "never", "always", "fading"
WAYS = (NEVER, ALWAYS, FADING)
# What helps: words, or the kart, which brakes and accelerates by itself.
WORDS, KART = "words", "kart"
# Laps with the coach, and laps without any help after them.
COACHED, ALONE = 10, 3
# Habits of a pupil, each in a corner of the course.
HABITS = 3
# Kinds that a pupil has: they add up in any corners.
KINDS = (FaultKind.EARLY_BRAKES, FaultKind.SLOW_BEND, FaultKind.LATE_THROTTLE)
RESAMPLES = 4000


@dataclass(frozen=True)
class RetentionSpec:
    """What is to be driven."""

    track: str
    vehicle: str
    seeds: range
    by: str = WORDS


@dataclass(frozen=True)
class Schooling:
    """One pupil under one way of helping."""

    seed: int
    way: str
    laps_s: tuple[float, ...]  # the first without help, then those with the coach, those alone
    helped: tuple[int, ...]  # corners with help, in each of those laps
    flawless_s: tuple[float, ...]  # the first and the last without habits, with the same errors

    @property
    def gain(self) -> float:
        """Share of the time that can be removed which is gone when the pupil is alone."""
        return float(np.mean(self._gains))

    @property
    def gain_at_once(self) -> float:
        """The same share in the first lap alone: in the next two the pupil goes on learning."""
        return self._gains[0]

    @property
    def _gains(self) -> list[float]:
        lost = self.laps_s[0] - self.flawless_s[0]
        alone = zip(self.laps_s[-ALONE:], self.flawless_s[-ALONE:], strict=True)
        return [1.0 - (driven - flawless) / lost for driven, flawless in alone]


@dataclass(frozen=True)
class _Fixed:
    """What a pupil is like before the first lap."""

    kinds: tuple[FaultKind, ...]
    corners: tuple[Corner, ...]
    skills: tuple[Skill, ...]
    nature: Nature


def school_all(
    spec: RetentionSpec, watch: Callable[[str], None] = lambda _: None
) -> Iterator[Schooling]:
    """Yield every pupil under each way of helping.

    Raises:
        RaceError: the course or the vehicle does not exist, the course has fewer corners than a
            pupil has habits, or a pupil does not come round.
    """
    school = School(spec.track, spec.vehicle)
    if len(school.corners) < HABITS:
        raise ScenarioError(
            f"track {spec.track!r} has {len(school.corners)} corners for {spec.vehicle!r}, and a "
            f"pupil has habits in {HABITS}; choose a course with more"
        )
    for seed in spec.seeds:
        pupil, alone = _pupil(school, seed, spec.by), range(1 + COACHED, 1 + COACHED + ALONE)
        flawless = tuple(
            _driven(school, _road(school, seed, lap), seed).time_us / MICROSECONDS
            for lap in (0, *alone)
        )
        for way in WAYS:
            watch(f"pupil {seed}, help {way}")
            laps_s, helped = _taught(school, pupil, seed, way, spec.by)
            yield Schooling(seed, way, laps_s, helped, flawless)


def _pupil(school: School, seed: int, by: str) -> _Fixed:
    chance = np.random.default_rng([seed, 44])
    corners = chance.choice(len(school.corners), HABITS, replace=False)
    kinds = tuple(KINDS[index] for index in chance.integers(len(KINDS), size=HABITS))
    sizes = [float(chance.uniform(SIZES[kind][1], SIZES[kind][2])) for kind in kinds]
    return _Fixed(
        kinds,
        tuple(school.corners[index] for index in corners),
        tuple(Skill(size, size) for size in sizes),
        nature_of(seed, is_driven=by == KART),
    )


def _taught(
    school: School, pupil: _Fixed, seed: int, way: str, by: str
) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Return the times [s] of a pupil's laps, and in how many corners it was helped in each."""
    skills, times, counts = list(pupil.skills), [], []
    attention = {corner.name: Attention() for corner in school.corners}
    told: dict[str, FaultKind] = {}  # what the coach named last in a corner
    for lap in range(1 + COACHED + ALONE):
        is_coached = lap <= COACHED
        helped = [
            is_coached
            and attention[corner.name].help is Help.GIVEN
            and (by == KART or told.get(corner.name) is kind)  # a kart's help is for all of them
            for corner, kind in zip(pupil.corners, pupil.kinds, strict=True)
        ]
        road = _road(school, seed, lap)
        for kind, corner, skill, given in zip(
            pupil.kinds, pupil.corners, skills, helped, strict=True
        ):
            size = made(skill, pupil.nature, is_helped=given)
            line = line_with(road, Habit(kind, corner, size))
            assert line is not None
            road = replace(road, line=line)
        driven = _driven(school, road, seed)
        times.append(driven.time_us / MICROSECONDS)
        counts.append(sum(helped))
        faults = school.judge(driven)
        for name, now in attention.items():
            attention[name] = _next(way, by, now, is_inside=name not in faults)
        told |= {name: fault.kind for name, fault in faults.items()}
        skills = [
            after(skill, pupil.nature, is_helped=given)
            for skill, given in zip(skills, helped, strict=True)
        ]
    return tuple(times), tuple(counts)


def _road(school: School, seed: int, lap: int) -> Road:
    """Return the line of a pupil's lap: with the same random errors whatever the help."""
    return school.pupil(1000 * seed + lap)


def _driven(school: School, road: Road, seed: int) -> Lap:
    driven = drive_lap(school.course, school.vehicle, road.line, seed)
    if driven is None:
        raise ScenarioError(
            f"pupil {seed} does not come round on {school.course.name!r}; leave that seed out with "
            "--first-seed, or choose another course"
        )
    return driven


def _next(way: str, by: str, now: Attention, *, is_inside: bool) -> Attention:
    if way == FADING:
        laps = DRIVEN_AFTER if by == KART else WITHDRAWN_AFTER
        return after_lap(now, is_inside=is_inside, withdrawn_after=laps)
    if way == ALWAYS and (now.help is Help.GIVEN or not is_inside):
        return Attention(Help.GIVEN)
    return Attention()


def summary_of(schooled: Sequence[Schooling]) -> dict[str, Any]:
    """Return the figures of all pupils. The keys are a contract."""
    by_way = {way: [one for one in schooled if one.way == way] for way in WAYS}
    alone = {
        way: np.array([np.mean(one.laps_s[-ALONE:]) for one in group])
        for way, group in by_way.items()
    }
    faster = alone[ALWAYS] - alone[FADING]
    return {
        "pupils": len(faster),
        "faster_alone_after_fading_s": round(float(faster.mean()), 4),
        "faster_alone_after_fading_interval_s": interval_of(faster),
        "ways": [
            {
                "way": way,
                "alone_s": round(float(alone[way].mean()), 4),
                "gain": round(float(np.median([one.gain for one in group])), 4),
                "gain_interval": interval_of(np.array([one.gain for one in group])),
                "gain_at_once": round(float(np.median([one.gain_at_once for one in group])), 4),
                "corners_helped": round(
                    float(np.mean([sum(one.helped) / COACHED for one in group])), 3
                ),
            }
            for way, group in by_way.items()
        ],
    }


def interval_of(values: "np.ndarray[Any, Any]") -> tuple[float, float]:
    """Return the bounds of the mean in 95 % of samples drawn again from values (n,).

    Efron, Bootstrap methods: another look at the jackknife, 1979.
    """
    chance = np.random.default_rng(45)
    means = chance.choice(values, (RESAMPLES, len(values))).mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return round(float(low), 4), round(float(high), 4)


def document_of(spec: RetentionSpec, schooled: Sequence[Schooling]) -> dict[str, Any]:
    """Return all pupils as a document."""
    place = {"track": spec.track, "vehicle": spec.vehicle, "by": spec.by}
    laps = [asdict(one) | {"gain": round(one.gain, 4)} for one in schooled]
    return place | summary_of(schooled) | {"pupils_laps": laps}
