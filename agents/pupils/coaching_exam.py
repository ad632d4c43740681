"""The exam of the coach: pupils with one known fault each, and how often it is named."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from race_agents.pupils.habit import Habit, Road, line_with, road_of, unsteady
from race_agents.pupils.laps import drive_lap
from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.cues import LATEST_S, SPOKEN_S, Moment, cues_for, due
from race_server.coaching.faults import Fault, FaultKind, faults_of
from race_server.coaching.lap import Lap, reference_lap
from race_server.coaching.losses import lap_loss
from race_server.competition.proportion import wilson_interval
from race_server.competition.time_trial.gaps import NONE, Gap
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.reality_gap import RealityGap
from race_server.errors import ScenarioError
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.load import load_course

# Sizes of each fault that are tried, in its unit.
SIZES: dict[FaultKind, tuple[float, float, float]] = {
    FaultKind.EARLY_BRAKES: (4.0, 7.0, 10.0),
    FaultKind.COASTING: (8.0, 12.0, 18.0),
    FaultKind.LATE_TURN_IN: (4.0, 6.0, 8.0),
    FaultKind.SLOW_BEND: (0.8, 1.2, 1.6),
    FaultKind.WIDE_APEX: (0.8, 1.1, 1.5),
    FaultKind.LATE_THROTTLE: (4.0, 6.0, 9.0),
    FaultKind.LIFT: (5.0, 8.0, 12.0),
    FaultKind.SHORT_EXIT: (0.8, 1.2, 1.8),
}
# Shares of motor force and top speed of karts that are slow without any fault of their drivers.
WEAK = (0.92, 0.88, 0.84)
# Cues are asked for as often as a driver decides [s].
ASKED_S = 0.05
# A habit that costs less than this [µs] is not a fault, and is counted apart.
COSTS_US = 40_000
# A cost is right within this share of the true one or within this time [µs].
NEAR_SHARE, NEAR_US = 0.15, 20_000


@dataclass(frozen=True)
class CoachingExamSpec:
    """What is to be driven."""

    track: str
    vehicle: str
    seeds: range
    is_seen: bool = False  # laps are as spectators of a live race see them


@dataclass(frozen=True)
class Attempted:
    """One lap of the exam, and what the coach said of it."""

    seed: int
    kind: str  # of the habit; `clean`, or `weak motor`
    size: float
    corner: str  # empty where the habit is in none
    true_cost_us: int  # against the same pupil without the habit
    cost_us: int  # of that corner against that pupil, as the coach finds it
    named: str  # what it named there; empty: nothing
    elsewhere: tuple[str, ...]  # what it named in other corners
    cue_ends_s: tuple[float, ...] = ()  # before the place to act, of each cue in such a lap


class School:
    """A course with its corners, and the lap that all are compared with."""

    def __init__(self, track: str, vehicle_name: str) -> None:
        """Find the corners, and let the line be raced: pupils have the speeds of that lap.

        Raises:
            RaceError: the course or the vehicle does not exist, or its line cannot be driven round.
        """
        self.course, vehicle = load_course(track), vehicle_named(vehicle_name)
        self.vehicle, self.bounds = vehicle_name, bounds_of(vehicle)
        line = reference_line(self.course, vehicle)
        self.limit = reference_lap(self.course, line, self.bounds)
        self.corners = corners_of(self.limit)
        road = road_of(self.course, line, self.bounds, self.limit)
        raced = drive_lap(self.course, self.vehicle, line, 0, racer=True)
        if raced is None:
            raise _not_round(track, vehicle_name, "raceline")
        driven = np.interp(road.progress, raced.progress, raced.speed)
        self.road = replace(road, line=replace(line, speed=np.minimum(line.speed, driven)))
        lap = drive_lap(self.course, self.vehicle, self.road.line, 0)
        if lap is None:
            raise _not_round(track, vehicle_name, "a pupil without faults")
        self.best = lap

    def pupil(self, seed: int) -> Road:
        """Return the line as the pupil of a seed follows it."""
        line = unsteady(self.road, seed)
        lap = reference_lap(self.course, line, self.bounds)
        return road_of(self.course, line, self.bounds, lap)

    def costs(self, lap: Lap, other: Lap) -> dict[str, int]:
        """Return what each corner costs [µs] against another lap."""
        loss = lap_loss(lap, other, self.corners, self.bounds)
        return {one.corner.name: one.total_us for one in loss.corners}

    def judge(self, lap: Lap) -> dict[str, Fault]:
        """Return the faults against the best lap, by corners."""
        loss = lap_loss(lap, self.best, self.corners, self.bounds)
        return {one.corner.name: one for one in faults_of(lap, self.best, loss)}


def _not_round(track: str, vehicle: str, who: str) -> ScenarioError:
    return ScenarioError(
        f"track {track!r} with vehicle {vehicle!r}: {who} does not come round on the reference "
        "line; choose another course or vehicle"
    )


def examine(
    spec: CoachingExamSpec, school: School, watch: Callable[[str], None] = lambda _: None
) -> Iterator[Attempted]:
    """Yield what the coach says of each lap: clean ones, weak motors, and each fault.

    A pupil that does not come round without a fault has no lap.
    """
    seen_by = school.bounds if spec.is_seen else None
    for seed in spec.seeds:
        watch(f"{spec.track}, seed {seed}")
        road = school.pupil(seed)

        def driven(line: ReferenceLine, gap: Gap = NONE, seed: int = seed) -> Lap | None:
            return drive_lap(school.course, school.vehicle, line, seed, gap, seen_by=seen_by)

        clean = driven(road.line)
        if clean is None:
            continue
        yield _attempt(school, clean, clean, ("clean", 0.0), None, seed)
        for share in WEAK:
            weak = Gap("weak", RealityGap(speed_coefficient=(share, share)))
            if (lap := driven(road.line, weak)) is not None:
                yield _attempt(school, lap, clean, ("weak motor", share), None, seed)
        for kind, corner in product(SIZES, school.corners):
            for size in SIZES[kind]:
                line = line_with(road, Habit(kind, corner, size))
                if line is not None and (lap := driven(line)) is not None:
                    yield _attempt(school, lap, clean, (kind.name.lower(), size), corner, seed)


def _attempt(
    school: School,
    lap: Lap,
    clean: Lap,
    habit: tuple[str, float],
    corner: Corner | None,
    seed: int,
) -> Attempted:
    faults = school.judge(lap)
    ends = tuple(cue_ends(lap, school.best, tuple(faults.values())))
    name = corner.name if corner else ""
    own = faults.pop(name, None)
    return Attempted(
        seed,
        *habit,
        name,
        lap.time_us - clean.time_us,
        school.costs(lap, clean).get(name, 0),
        own.kind.name.lower() if own else "",
        tuple(fault.kind.name.lower() for fault in faults.values()),
        ends,
    )


def cue_ends(lap: Lap, best: Lap, faults: Sequence[Fault]) -> Iterator[float]:
    """Yield how long [s] before the place to act each cue ends, for a driver alone on the course.

    faults: of the lap before; the lap is driven with them once more. The best lap tells times, as
    the driver has no better one yet.
    """
    cues, said, spoken = cues_for(faults), set[str](), -math.inf
    inf = math.inf
    free = Moment(0.0, 0.0, inf, inf, is_cautioned=False, is_driving=True, since_cue_s=inf)
    for now in np.arange(0.0, float(lap.time[-1]), ASKED_S):
        progress, speed = (
            float(np.interp(now, lap.time, values)) for values in (lap.progress, lap.speed)
        )
        moment = replace(free, progress=progress, speed=speed, since_cue_s=now - spoken)
        cue = due(cues, moment, best, said)
        if cue is not None:
            said.add(cue.corner)
            spoken = now
            # The next lap, where the place is behind the line, takes as long.
            there = lap.at(lap.time, cue.place)
            yield (there - now) % float(lap.time[-1]) - SPOKEN_S


def summary_of(tried: Sequence[Attempted], corners: int) -> dict[str, Any]:
    """Return the figures of an exam. corners: of the course. The keys are a contract."""
    faults = [one for one in tried if one.corner]
    costly = [one for one in faults if one.true_cost_us >= COSTS_US]
    named = [one for one in costly if one.named == one.kind]
    near = [one for one in costly if abs(one.cost_us - one.true_cost_us) <= _near(one)]
    clean = [one for one in tried if one.kind == "clean"]
    weak = [one for one in tried if one.kind == "weak motor"]
    unknown = FaultKind.UNKNOWN.name.lower()
    spoken = [word for one in weak for word in one.elsewhere]
    rows = []
    for kind in SIZES:
        own = [one for one in costly if one.kind == kind.name.lower()]
        right = sum(one.named == one.kind for one in own)
        wrong = Counter(one.named or "nothing" for one in own if one.named != one.kind)
        rows.append({"kind": kind.name.lower(), "laps": len(own), "named": right, **_wrong(wrong)})
    return {
        "laps": len(tried),
        "faults": len(costly),
        "harmless": len(faults) - len(costly),
        "named": len(named),
        "named_share": _share(len(named), len(costly)),
        "named_interval": wilson_interval(len(named), len(costly)),
        "cost_near_share": _share(len(near), len(costly)),
        **_cue_figures([end for one in tried for end in one.cue_ends_s]),
        "clean_corners": corners * len(clean),
        "clean_corners_with_a_fault": sum(
            word != unknown for one in clean for word in one.elsewhere
        ),
        "clean_corners_called_unknown": sum(
            word == unknown for one in clean for word in one.elsewhere
        ),
        "weak_corners_with_a_word": len(spoken),
        "weak_corners_called_unknown": sum(word == unknown for word in spoken),
        "kinds": rows,
    }


def _cue_figures(ends: Sequence[float]) -> dict[str, Any]:
    in_time = sum(end >= LATEST_S for end in ends)
    return {
        "cues": len(ends),
        "cues_in_time_share": _share(in_time, len(ends)),
        "cue_ends_s": [round(float(end), 3) for end in np.quantile(ends, (0.01, 0.5, 0.99))]
        if ends
        else None,
    }


def _wrong(counts: Counter[str]) -> dict[str, Any]:
    return {"named_otherwise": dict(sorted(counts.items()))}


def _near(one: Attempted) -> float:
    return max(NEAR_US, NEAR_SHARE * one.true_cost_us)


def _share(part: int, whole: int) -> float | None:
    return round(part / whole, 4) if whole else None


def document_of(spec: CoachingExamSpec, tried: Sequence[Attempted], corners: int) -> dict[str, Any]:
    """Return an exam as a document, each lap included. corners: of the course."""
    driven = {one.seed for one in tried}
    place = {
        "track": spec.track,
        "vehicle": spec.vehicle,
        "seeds": len(driven),
        "failed_seeds": [seed for seed in spec.seeds if seed not in driven],
        "seen": spec.is_seen,
    }
    return place | summary_of(tried, corners) | {"tries": [asdict(one) for one in tried]}
