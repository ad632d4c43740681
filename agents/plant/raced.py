"""Races as shadow mode looks at them: recorded ones, and ones that scripted drivers drive here."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from race_agents.plant.radar import Floats
from race_server.core.clock import TICK_S
from race_server.core.messages import Phase
from race_server.core.vehicles import Vehicle
from race_server.errors import RecordingError
from race_server.net.wire.spectate import KART, Rows, decode_snapshot
from race_server.storage.recording.channels import SNAPSHOTS
from race_server.storage.recording.reader import read_lines, read_recording
from race_server.storage.recording.scenario_codec import unpack_scenario

if TYPE_CHECKING:
    from race_server.envs.batch import Batch

# The radar looks every third tick: 20 times a second, which is how often drivers decide, too.
TICKS = 3
SCAN_S = TICKS / 60.0
KARTS = 8
DRIVERS = ("raceline", "idm", "pure_pursuit")
COURSES = ("hangar-400", "colline-1100", "paddock-280")
# Courses that are drawn for a seed, one of each kind in turn.
DRAWN = ("generated:circuit:{}:kart", "generated:spline:{}:kart")
# Time of a race [s] from a standing start; no kart finishes it.
RACE_S = 300.0
LAPS = 10_000
# Fields of a body that a snapshot has, too.
SHOWN = ("x", "y", "heading", "speed", "lateral_speed", "yaw_rate", "steering", "status")


class Frame(NamedTuple):
    """All karts at one tick."""

    tick: int
    karts: Rows  # (K,) KART


@dataclass(frozen=True, eq=False)
class Raced:
    """One race."""

    name: str
    borders: Floats  # (P, 4)
    vehicles: tuple[Vehicle, ...]  # one for each seat
    frames: Iterator[Frame]  # 20 a second of race time, while it runs


def recorded_race(path: Path) -> Raced:
    """Return the race of a recording.

    Raises:
        RecordingError: not a recording, or of no race on a course.
    """
    start = read_recording(path).start
    scenario = unpack_scenario(start.setting, start.arrays)
    if not len(scenario.course.line):
        raise RecordingError(f"{path} is of a car park: only races are looked at")
    vehicles = tuple(scenario.vehicle_of(seat) for seat in range(scenario.karts))
    return Raced(path.name, scenario.course.borders, vehicles, _recorded_frames(path))


def _recorded_frames(path: Path) -> Iterator[Frame]:
    last = -TICKS
    for line in read_lines(path):
        if line is None or line.kind is not SNAPSHOTS:
            continue
        frame = decode_snapshot(line.data)
        if frame.phase is Phase.RUNNING and frame.tick - last >= TICKS:
            last = frame.tick
            yield Frame(frame.tick, frame.karts)


def driven_races(vehicle: Vehicle, first_seed: int) -> Iterator[Raced]:
    """Yield races without end, one for each seed: of eight karts, on each course in turn.

    Every other course is drawn for its seed.
    """
    for place in range(1_000_000):
        seed, half = first_seed + place, place // 2
        names = DRAWN if place % 2 else COURSES
        yield driven_race(names[half % len(names)].format(seed), vehicle, seed)


def driven_race(track: str, vehicle: Vehicle, seed: int) -> Raced:
    """Return a race of eight karts that scripted drivers drive here, as in training.

    seed: of the world, and of the order on the grid.

    Raises:
        TrackError: no such course.
    """
    # A recording is looked at without a compiler.
    from race_server.envs.batch import Batch
    from race_server.envs.buffers import STAY
    from race_server.envs.presets import task_on
    from race_server.scenario.race import Rules, Scenario
    from race_server.scenario.raceline.attach import reference_line
    from race_server.scenario.track.load import load_course

    course = load_course(track)
    long_s = 10.0 * RACE_S
    scenario = Scenario(
        course=course,
        karts=KARTS,
        vehicles=(vehicle,),
        rules=Rules(LAPS, countdown_s=0.0, items=False, limit_s=long_s, finish_limit_s=long_s),
        seed=seed,
        grid_order=tuple(np.random.default_rng(seed).permutation(KARTS).tolist()),
        line=reference_line(course, vehicle, solve=True),
    )
    task = task_on(
        (scenario,),
        learners=1,  # a batch has one at least: advised with zeros, it is one more driver
        opponents=(*DRIVERS[1:], *DRIVERS[:1]),
        observation="radar",
        action="residual",
        base=DRIVERS[0],
    )
    batch = Batch(task, seed=seed, after=STAY)
    return Raced(f"{track}, seed {seed}", course.borders, (vehicle,) * KARTS, _driven(batch))


def _driven(batch: "Batch") -> Iterator[Frame]:
    bodies, race = batch.world.bodies[0], batch.world.races[0]
    while race.tick < RACE_S / TICK_S:
        batch.step()
        karts = np.zeros(KARTS, KART)
        karts["seat"] = np.arange(KARTS)
        for name in SHOWN:
            karts[name] = bodies[name]
        yield Frame(int(race.tick), karts)
