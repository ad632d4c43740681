"""One run of a trial: driver, track, vehicle, reality gap, seed; and the scenario of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from race_server.competition.time_trial.gaps import DECISION_TICKS, NONE, Gap
from race_server.core.kernels.rng import EPISODE_STREAM, bits
from race_server.core.state import Floats
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.envs.presets import task_on
from race_server.envs.rounds import SEED_SHIFT
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine
from race_server.second.highway_itself import NAME as ITSELF

FLYING, STANDING = "flying", "standing"
STARTS = (FLYING, STANDING)

# Number of the round that a batch begins with.
FIRST_ROUND = 1
# A kart that stands for longer is out [s]: the rule of the 1/10 race.
STOPPED_S = 10.0
# No lap takes longer than at this share of the top speed: 0.25 m/s for the 1/10 car.
CRAWL_SHARE = 1.0 / 40.0
# A car is put on its mark by hand: greatest error as a share of its width, and of its angle.
MARK_SHARE = 0.25
MARK_ANGLE = np.radians(2.0)


@dataclass(frozen=True)
class RunSpec:
    """One run: a driver alone on a course, from the start to the last lap."""

    driver: str
    track: str
    vehicle: str = "tt02"
    gap: Gap = NONE
    seed: int = 1
    laps: int = 5  # that count
    start: str = FLYING
    decision_limit_s: float = 2.0  # a driver that takes longer has stalled
    simulator: str = ""  # that moves the kart, see `race_server.second`; empty: ours
    decision_ticks: int = DECISION_TICKS
    traffic: int = 0  # vehicles of highway-env ahead at the start

    @property
    def laps_driven(self) -> int:
        """Laps to the finish, with the uncounted one before a flying start."""
        return self.laps + (1 if self.start == FLYING else 0)


def run_specs_of(
    drivers: Sequence[str],
    tracks: Sequence[str],
    vehicles: Sequence[str],
    gaps: Sequence[Gap],
    seeds: Sequence[int],
    like: RunSpec,
) -> list[RunSpec]:
    """Return one run for each combination, with the laps and the start of `like`.

    Raises:
        ScenarioError: the start is unknown, there is no lap, or a seed is negative.
    """
    if like.start not in STARTS:
        raise ScenarioError(f"start {like.start!r} is unknown; choose {' or '.join(STARTS)}")
    if like.laps < 1 or not seeds or min(seeds) < 0:
        raise ScenarioError(
            f"{like.laps} laps with seeds {list(seeds)}: give one lap or more, and one seed or "
            "more, none below zero"
        )
    return [
        replace(like, track=track, vehicle=vehicle, gap=gap, driver=driver, seed=seed)
        for track, vehicle, gap, driver, seed in product(tracks, vehicles, gaps, drivers, seeds)
    ]


def rules_of(spec: RunSpec, course: Course, vehicle: Vehicle) -> Rules:
    """Return the rules of a trial: alone, no items, walls push back, a standing kart is out."""
    longest_s = course.length / (CRAWL_SHARE * vehicle.top_speed)
    return Rules(
        laps=spec.laps_driven,
        standing_start=spec.start == STANDING,
        countdown_s=0.0,
        items=False,
        stopped_limit_s=STOPPED_S,
        limit_s=spec.laps_driven * longest_s,
    )


def scenario_of(spec: RunSpec, course: Course, line: ReferenceLine | None = None) -> Scenario:
    """Return the scenario of a run. The seed decides the sensor noise and the start pose.

    line: to follow in place of the course's own.
    """
    vehicle = vehicle_named(spec.vehicle)
    grid = on_the_mark(course, vehicle, spec.seed)
    if spec.traffic >= len(grid):
        raise ScenarioError(
            f"traffic {spec.traffic}: the grid of {course.name} has {len(grid)} places, and the "
            "driver needs one"
        )
    # The driver of the run is kart 0, and starts behind the others.
    rules = rules_of(spec, course, vehicle)
    if spec.traffic:
        grid = np.roll(grid[: 1 + spec.traffic], 1, axis=0)
        rules = replace(rules, finish_limit_s=rules.limit_s)
    return Scenario(
        course=replace(course, grid=grid),
        karts=1 + spec.traffic,
        vehicles=(vehicle,),
        rules=rules,
        lidar=spec.gap.lidar(),
        seed=spec.seed,
        line=line,
    )


def task_of(spec: RunSpec, course: Course, preset: str, line: ReferenceLine | None = None) -> Task:
    """Return the run as a task of the training world, with observations of `preset`."""
    return task_on(
        (scenario_of(spec, course, line),),
        learners=1,
        opponents=(_rival(spec),) if spec.traffic else (),
        observation=preset,
        action="control",
        gap=spec.gap.reality,
        simulator=spec.simulator,
        decision_ticks=spec.decision_ticks,
    )


def _rival(spec: RunSpec) -> str:
    """Return the driver of the others; highway-env itself drives its own, so it is not asked."""
    return "pure_pursuit" if spec.simulator.startswith(ITSELF) else "highway_idm"


def world_seed(seed: int) -> int:
    """Return the seed of the world in which the run of a seed is driven: that of its one round."""
    return int(bits(seed, EPISODE_STREAM, FIRST_ROUND, 0)) >> SEED_SHIFT


def on_the_mark(course: Course, vehicle: Vehicle, seed: int) -> Floats:
    """Return the start grid with a random error of the pole position, shape (S, 3).

    Raises:
        ScenarioError: the course has no place to start from.
    """
    if not len(course.grid):
        raise ScenarioError(
            f"the start grid of {course.name} has no place: the course is too narrow, or too short"
        )
    chance = np.random.default_rng(seed)
    aside = MARK_SHARE * vehicle.width * chance.uniform(-1.0, 1.0)
    grid = course.grid.copy()
    heading = grid[0, 2]
    grid[0] += (-aside * np.sin(heading), aside * np.cos(heading), 0.0)
    grid[0, 2] += MARK_ANGLE * chance.uniform(-1.0, 1.0)
    return grid
