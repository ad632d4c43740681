"""Shadow mode: what a kart's reflex would have done in races that were recorded.

Each kart of a recording is followed as if it were a real one: a radar that errs looks at the others
and at the borders from where it was, and the reflex is asked. It has no effect, so the end of
each moment is known: an act is *false* where the kart then touched nothing and did not come close
to anything, though no brake helped, and where by the true places no slower kart was in its way.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from race_agents.plant.body import Body
from race_agents.plant.radar import ERRS, Floats, RadarErrors, Surroundings, scan
from race_agents.plant.row import Row
from race_agents.unit.danger import pivot_of, worst_ahead
from race_agents.unit.ego import EgoMotion
from race_agents.unit.objects import Objects
from race_agents.unit.safety import Limits, way_along
from race_server.core.alert import Danger, DangerStage
from race_server.core.messages import Phase, Status
from race_server.core.vehicles import Vehicle
from race_server.errors import RecordingError
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot
from race_server.storage.recording.channels import SNAPSHOTS
from race_server.storage.recording.reader import read_lines, read_recording
from race_server.storage.recording.scenario_codec import unpack_scenario

# The radar looks every third tick: 20 times a second.
TICKS = 3
SCAN_S = TICKS / 60.0
# An act lasts until it was not called for, for this long [s].
APART_S = 1.0
# A brake was right if within this time [s] the kart came nearer than this [m] to something, while
# approaching it.
SOON_S, CLOSE = 1.5, 0.35
# A speed that changes by more than this between two snapshots is that of a collision [m/s].
BLOW = 2.0
# A kart that drives slower by this [m/s] is in the way of one that has to stop or wait for it,
# within the way to stop and a warning before that [s], and this much room beside [m].
SLOWER, BEFORE_S, ROOM = 3.0, 1.0, 0.3
SLOW = 2.0  # [m/s] slower than this a kart is not raced


@dataclass(frozen=True)
class Act:
    """A moment at which the reflex would have acted."""

    path: str
    tick: int
    seat: int
    stage: DangerStage
    speed: float
    danger: Danger
    is_false: bool


@dataclass
class Shadow:
    """What was found in some recordings."""

    metres: float = 0.0
    acts: list[Act] = field(default_factory=list)

    def count(self, stage: DangerStage, *, false_only: bool = False) -> int:
        """Return how often a stage was called for."""
        return sum(act.stage is stage and (act.is_false or not false_only) for act in self.acts)


@dataclass
class Follower:
    """The reflex of one kart."""

    vehicle: Vehicle
    limits: Limits
    borders: Floats
    chance: np.random.Generator
    errors: RadarErrors = ERRS
    objects: Objects = field(default_factory=Objects)
    _motion: EgoMotion = field(default_factory=EgoMotion)
    _until: dict[DangerStage, float] = field(default_factory=dict)

    def look(self, row: np.void, others: Floats, now_s: float) -> tuple[DangerStage, Danger] | None:
        """Take one snapshot; return what begins now, if something does.

        row: this kart; others: (n, 5) x, y, heading and velocity of the others.
        """
        x, y, heading, speed = (float(row[name]) for name in ("x", "y", "heading", "speed"))
        slide = float(row["lateral_speed"]) - self.vehicle.rear_axle * float(row["yaw_rate"])
        body = Body(self.vehicle, x, y, heading, speed, float(row["lateral_speed"]))
        echoes = scan(body, Surroundings(self.borders, others), self.chance, self.errors)
        self._motion.advance(speed, slide, float(row["yaw_rate"]), SCAN_S)
        self.objects.look(echoes, self._motion.take(speed, body.lateral_speed), SCAN_S)
        wanted = math.tan(float(row["steering"])) / self.vehicle.wheelbase
        now = float(row["yaw_rate"]) / speed if speed > SLOW else wanted
        sensed = self.objects.tracks, self.objects.loose
        pivot = pivot_of(slide, float(row["yaw_rate"]), self.limits) if speed > SLOW else 0.0
        danger = worst_ahead(*sensed, speed, now, wanted, self.limits, pivot=pivot)
        stage = danger.stage
        if stage < DangerStage.WARN or speed < SLOW:
            return None
        begins = self._until.get(stage, -math.inf) < now_s
        for each in DangerStage:
            if DangerStage.WARN <= each <= stage:
                self._until[each] = now_s + APART_S
        return (stage, danger) if begins else None


def shadow(
    paths: Sequence[Path],
    *,
    most_km: float = math.inf,
    seed: int = 0,
    tell: Callable[[float], None] = lambda _: None,
) -> Shadow:
    """Return what the reflex would have done in recorded races.

    most_km: stop after these kilometres of all karts together.

    Raises:
        RecordingError: not a recording, or of no race on a course.
    """
    result = Shadow()
    for path in paths:
        _follow(path, result, seed, 1000.0 * most_km, tell)
        if result.metres >= 1000.0 * most_km:
            break
    return result


def _follow(
    path: Path, result: Shadow, seed: int, most: float, tell: Callable[[float], None]
) -> None:
    start = read_recording(path).start
    scenario = unpack_scenario(start.setting, start.arrays)
    course = scenario.course
    if not len(course.line):
        raise RecordingError(f"{path} is of a car park: only races are looked at")
    frames = [frame for frame in _frames(path) if frame.phase is Phase.RUNNING]
    vehicles = [scenario.vehicle_of(seat) for seat in range(scenario.karts)]
    followers = [
        Follower(each, Limits.of(each), course.borders, np.random.default_rng([seed, seat]))
        for seat, each in enumerate(vehicles)
    ]
    for number, frame in enumerate(frames):
        racing = frame.karts[frame.karts["status"] == Status.RACING]
        rows = _rows(racing)
        for place, row in enumerate(racing):
            seat = int(row["seat"])
            result.metres += abs(float(row["speed"])) * SCAN_S
            others = np.delete(rows, place, axis=0)
            near = np.hypot(*(others[:, :2] - rows[place, :2]).T) < 70.0
            begun = followers[seat].look(row, others[near], frame.tick / 60.0)
            if begun is not None:
                stage, danger = begun
                later = frames[number : number + round(SOON_S / SCAN_S)]
                is_right = _is_blocked(row, others[near], vehicles[seat], followers[seat].limits)
                is_false = not is_right and not _came_close(
                    later, seat, vehicles[seat], course.borders
                )
                result.acts.append(
                    Act(path.name, frame.tick, seat, stage, float(row["speed"]), danger, is_false)
                )
        tell(result.metres / 1000.0)
        if result.metres >= most:
            return


def _frames(path: Path) -> list[SnapshotFrame]:
    frames = [
        decode_snapshot(line.data)
        for line in read_lines(path)
        if line is not None and line.kind is SNAPSHOTS
    ]
    kept, last = [], -TICKS
    for frame in frames:
        if frame.tick - last >= TICKS:
            kept.append(frame)
            last = frame.tick
    return kept


def _rows(karts: np.ndarray) -> Floats:
    """Return x, y, heading and velocity of karts, (n, 5)."""
    cos, sin = np.cos(karts["heading"]), np.sin(karts["heading"])
    vx = karts["speed"] * cos - karts["lateral_speed"] * sin
    vy = karts["speed"] * sin + karts["lateral_speed"] * cos
    return np.stack([karts["x"], karts["y"], karts["heading"], vx, vy], axis=1).astype(np.float64)


def _is_blocked(row: np.void, others: Floats, vehicle: Vehicle, limits: Limits) -> bool:
    """Return whether a slower kart truly is on the arc of this one, within its way to stop.

    others: (n, 5) as of `Follower.look`.
    """
    speed, heading = float(row["speed"]), float(row["heading"])
    cos, sin = math.cos(heading), math.sin(heading)
    dx, dy = others[:, 0] - float(row["x"]), others[:, 1] - float(row["y"])
    curvature = float(row["yaw_rate"]) / max(speed, SLOW)
    along, aside = way_along(dx * cos + dy * sin, dy * cos - dx * sin, curvature)
    ways = heading + curvature * along
    paces = others[:, 3] * np.cos(ways) + others[:, 4] * np.sin(ways)
    stop = speed * (limits.reaction_s + BEFORE_S) + speed**2 / (2.0 * limits.braking)
    beside = 0.5 * (vehicle.length + vehicle.width) + ROOM
    is_near = (along > 0.0) & (along < stop + vehicle.length) & (np.abs(aside) < beside)
    return bool((is_near & (paces < speed - SLOWER)).any())


def _came_close(
    frames: Sequence[SnapshotFrame], seat: int, vehicle: Vehicle, borders: Floats
) -> bool:
    """Return whether a kart came close to another one, or to a border, in some snapshots."""
    around, speed = Surroundings(borders), math.nan
    for frame in frames:
        karts = frame.karts
        own = karts[karts["seat"] == seat]
        if not len(own):
            return False
        before, speed = speed, float(own["speed"][0])
        if abs(speed - before) > BLOW:
            return True
        rows = _rows(karts[karts["seat"] != seat])
        x, y, heading = (float(own[name][0]) for name in ("x", "y", "heading"))
        mine = _discs(x, y, heading, vehicle)
        for row in rows[np.hypot(rows[:, 0] - x, rows[:, 1] - y) < 2.0 * vehicle.length]:
            theirs = _discs(float(row[0]), float(row[1]), float(row[2]), vehicle)
            gaps = np.hypot(*(mine[:, None] - theirs).transpose(2, 0, 1)) - vehicle.width
            if float(gaps.min()) < CLOSE:
                return True
        near = around.borders_near(x, y, vehicle.length)
        if len(near) and float(_to_segments(mine, near).min()) - 0.5 * vehicle.width < 0.1:
            return True
    return False


def _discs(x: float, y: float, heading: float, vehicle: Vehicle) -> Floats:
    """Return the middles of three discs that make up a body, (3, 2)."""
    half = 0.5 * (vehicle.length - vehicle.width)
    along = vehicle.box_offset + np.array([-half, 0.0, half])
    return np.stack([x + along * math.cos(heading), y + along * math.sin(heading)], axis=1)


def _to_segments(points: Floats, segments: Floats) -> Floats:
    """Return the distances of points (n, 2) to segments (m, 4), (n, m) [m]."""
    start, edge = segments[:, :2], segments[:, 2:] - segments[:, :2]
    square = np.maximum((edge * edge).sum(axis=1), 1e-12)
    share = np.clip((((points[:, None] - start) * edge).sum(axis=2) / square), 0.0, 1.0)
    return np.hypot(*(points[:, None] - start - share[..., None] * edge).transpose(2, 0, 1))


def rows(found: Shadow) -> list[Row]:
    """Return the table of shadow mode."""
    km = max(found.metres / 1000.0, 1e-9)
    note = f"{found.metres / 1000.0:.1f} km of all karts"
    false = found.count(DangerStage.FULL, false_only=True)
    return [
        Row(
            "false full brakes in recorded races",
            "per 1,000 km",
            1000.0 * false / km,
            most=1.0,
            note=f"{false} in {note}",
        ),
        Row(
            "full brakes for what was there",
            "per 1,000 km",
            1000.0 * (found.count(DangerStage.FULL) - false) / km,
            least=0.0,
            note=note,
        ),
        Row(
            "false warnings in recorded races",
            "per 10 km",
            10.0 * found.count(DangerStage.WARN, false_only=True) / km,
            most=1.0,
            note=f"{found.count(DangerStage.WARN)} warnings in {note}",
        ),
    ]
