"""Shadow mode: what a kart's reflex would have done in races.

Each kart of a race is followed as if it were a real one: a radar that errs looks at the others
and at the borders from where it was, and the reflex is asked. It has no effect, so the end of
each moment without a brake is known, see `race_agents.plant.hindsight`. An act is *needless* where
the kart then touched nothing and did not come close to anything. It is *false* where, besides, no
slower kart was in its way by the true places, then or by when brakes bite.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from race_agents.plant.body import Body
from race_agents.plant.encounter import OpenPlace
from race_agents.plant.hindsight import (
    AFTER_S,
    LATEST_S,
    SLOW,
    SOON_S,
    came_close,
    rows_of,
    was_blocked,
)
from race_agents.plant.raced import SCAN_S, Frame, Raced
from race_agents.plant.radar import ERRS, REACH_LENGTHS, Floats, RadarErrors, Surroundings, scan
from race_agents.plant.row import Row
from race_agents.plant.told import HEADING, PACE, PLACE
from race_agents.unit.danger import severity_of, worst_ahead
from race_agents.unit.drift import STRAIGHT_ON, Arcs, Drift
from race_agents.unit.ego import EgoMotion
from race_agents.unit.limits import Limits
from race_agents.unit.objects import Objects
from race_agents.unit.peers import Whereabouts, tracks_of
from race_agents.unit.safety import Echoes
from race_server.core.alert import Danger, DangerStage
from race_server.core.messages import Status
from race_server.core.peer import Peer
from race_server.core.vehicles import Vehicle
from race_server.net.wire.spectate import Rows

# An act lasts until it was not called for, for this long [s].
APART_S = 1.0


@dataclass(frozen=True)
class Act:
    """A moment at which the reflex would have acted."""

    race: str
    tick: int
    seat: int
    stage: DangerStage
    speed: float
    danger: Danger
    is_needless: bool
    is_false: bool


@dataclass
class Shadow:
    """What was found in some races."""

    metres: float = 0.0
    acts: list[Act] = field(default_factory=list)

    def count(self, stage: DangerStage) -> int:
        """Return how often a stage was called for."""
        return sum(act.stage is stage for act in self.acts)

    def count_needless(self, stage: DangerStage) -> int:
        """Return how often a stage was called for, and nothing came close."""
        return sum(act.stage is stage and act.is_needless for act in self.acts)

    def count_false(self, stage: DangerStage) -> int:
        """Return how often a stage was called for, and nothing came close or was in the way."""
        return sum(act.stage is stage and act.is_false for act in self.acts)


@dataclass
class Follower:
    """The reflex of one kart."""

    vehicle: Vehicle
    limits: Limits
    borders: Floats
    chance: np.random.Generator
    errors: RadarErrors = ERRS
    objects: Objects = field(init=False)
    _motion: EgoMotion = field(default_factory=EgoMotion)
    _until: dict[DangerStage, float] = field(default_factory=dict)
    _speed: float = 0.0  # [m/s] at the last frame
    _looked_s: float = -math.inf

    def __post_init__(self) -> None:
        self.objects = Objects(self.limits.nose)

    def look(
        self, row: np.void, others: Floats, now_s: float, told: Sequence[Peer] = ()
    ) -> Danger | None:
        """Take one frame; return what begins now, if something does.

        row: this kart; others: (n, 5) x, y, heading and velocity of the others; told: by them.
        """
        x, y, heading, speed = (float(row[name]) for name in ("x", "y", "heading", "speed"))
        yaw_rate = float(row["yaw_rate"])
        body = Body(self.vehicle, x, y, heading, speed, float(row["lateral_speed"]), yaw_rate)
        slide = body.lateral_speed - self.vehicle.rear_axle * yaw_rate
        echoes = scan(body, Surroundings(self.borders, others), self.chance, self.errors)
        self._motion.advance(speed, slide, yaw_rate, SCAN_S)
        aside = slide + self.limits.nose * yaw_rate
        self.objects.look(echoes, self._motion.take(speed, aside), SCAN_S)
        wanted = math.tan(float(row["steering"])) / self.vehicle.wheelbase
        now = yaw_rate / speed if speed > SLOW else wanted
        sensed = self.objects.tracks, self.objects.loose
        drift = STRAIGHT_ON
        if speed > SLOW:
            drift = Drift.of(speed, slide, yaw_rate, self.limits)
        lost = max(self._speed - speed, 0.0) / SCAN_S if now_s - self._looked_s < APART_S else 0.0
        self._speed, self._looked_s = speed, now_s
        arcs = Arcs(speed, now, wanted, drift, min(lost, self.limits.promised))
        danger = worst_ahead(*sensed, arcs, self.limits)
        if told:
            back = self.vehicle.rear_axle
            place = x - back * math.cos(heading), y - back * math.sin(heading), heading
            own = Whereabouts(*place, PLACE, HEADING, now_s)
            tracks = tracks_of(told, own, OpenPlace(), self.limits.half_width)
            heard = worst_ahead(tracks, Echoes.nothing(), arcs, self.limits)
            danger = max(danger, heard, key=severity_of)
        if danger.stage < DangerStage.WARN or speed < SLOW:
            return None
        begins = self._until.get(danger.stage, -math.inf) < now_s
        for each in DangerStage:
            if DangerStage.WARN <= each <= danger.stage:
                self._until[each] = now_s + APART_S
        return danger if begins else None


def shadow(
    races: Iterable[Raced],
    *,
    most_km: float = math.inf,
    seed: int = 0,
    tell: Callable[[float], None] = lambda _: None,
    peers: bool = False,
) -> Shadow:
    """Return what the reflex would have done in some races.

    most_km: stop after these kilometres of all karts together; tell: called with those so far;
    peers: the karts tell one another where they are.
    """
    result = Shadow()
    for race in races:
        _follow(race, result, seed, 1000.0 * most_km, tell, peers=peers)
        if result.metres >= 1000.0 * most_km:
            break
    return result


def _follow(
    race: Raced,
    result: Shadow,
    seed: int,
    most: float,
    tell: Callable[[float], None],
    *,
    peers: bool,
) -> None:
    followers = [
        Follower(each, Limits.of(each), race.borders, np.random.default_rng([seed, seat]))
        for seat, each in enumerate(race.vehicles)
    ]
    chance, earlier, told = np.random.default_rng([seed, len(followers)]), None, {}
    for later in _windows(race.frames, round(LATEST_S / SCAN_S)):
        tick, karts = later[0]
        racing = karts[karts["status"] == Status.RACING]
        rows = rows_of(racing)
        if peers:
            told = _told_of(karts, earlier, race.vehicles, tick / 60.0, chance)
            earlier = karts
        for place, row in enumerate(racing):
            follower, speed = followers[int(row["seat"])], float(row["speed"])
            result.metres += abs(speed) * SCAN_S
            others = np.delete(rows, place, axis=0)
            reach = (REACH_LENGTHS + 2.0) * follower.vehicle.length
            others = others[np.hypot(*(others[:, :2] - rows[place, :2]).T) < reach]
            heard = [each for seat, each in told.items() if seat != int(row["seat"])]
            danger = follower.look(row, others, tick / 60.0, heard)
            if danger is None:
                continue
            seat, vehicle = int(row["seat"]), follower.vehicle
            met_s = max(min(danger.time_s + AFTER_S, LATEST_S), SOON_S)
            soon = list(islice(later, round(met_s / SCAN_S)))
            needless = not came_close(soon, seat, vehicle, race.borders)
            if needless and len(soon) < round(met_s / SCAN_S):
                continue  # the race ended before that was known
            false = needless and not was_blocked(soon, seat, vehicle, follower.limits)
            result.acts.append(
                Act(race.name, tick, seat, danger.stage, speed, danger, needless, false)
            )
        tell(result.metres / 1000.0)
        if result.metres >= most:
            return


def _told_of(
    karts: Rows,
    earlier: Rows | None,
    vehicles: Sequence[Vehicle],
    now_s: float,
    chance: np.random.Generator,
) -> dict[int, Peer]:
    """Return what karts told a frame ago, by seat.

    earlier: that frame; what each asks of its brakes is what it then lost of its speed.
    """
    if earlier is None:
        return {}
    told, later = {}, {int(row["seat"]): float(row["speed"]) for row in karts}
    for row in earlier[earlier["status"] == Status.RACING]:
        seat, vehicle, speed = int(row["seat"]), vehicles[int(row["seat"])], float(row["speed"])
        lost = (speed - later.get(seat, speed)) / SCAN_S
        heading, ahead = float(row["heading"]), vehicle.box_offset
        noise_x, noise_y = chance.normal(0.0, PLACE, 2)
        told[seat] = Peer(
            stamp_us=round(1e6 * (now_s - SCAN_S)),
            x=float(row["x"]) + ahead * math.cos(heading) + noise_x,
            y=float(row["y"]) + ahead * math.sin(heading) + noise_y,
            heading=heading + chance.normal(0.0, HEADING),
            speed=speed + chance.normal(0.0, PACE),
            lateral_speed=float(row["lateral_speed"]) + ahead * float(row["yaw_rate"]),
            yaw_rate=float(row["yaw_rate"]),
            braking=min(max(lost, 0.0), Limits.of(vehicle).promised),
            deviation=PLACE,
            heading_deviation=HEADING,
            length=vehicle.length,
            width=vehicle.width,
        )
    return told


def _windows(frames: Iterator[Frame], size: int) -> Iterator[Sequence[Frame]]:
    """Yield each frame with those after it: `size` together, fewer at the end."""
    window = deque(islice(frames, size - 1))
    for frame in frames:
        window.append(frame)
        yield window
        window.popleft()
    while window:
        yield window
        window.popleft()


def false_acts(found: Shadow) -> list[dict[str, Any]]:
    """Return each false full brake and warning as plain data, to be looked at one by one."""
    return [
        {
            "race": act.race,
            "time_s": round(act.tick / 60.0, 2),
            "seat": act.seat,
            "stage": act.stage.name.lower(),
            "speed": round(act.speed, 2),
            "for": act.danger.kind.name.lower(),
            "bearing": round(act.danger.bearing, 2),
            "distance": round(act.danger.distance, 2),
            "needed": round(act.danger.needed, 2),
        }
        for act in found.acts
        if act.is_false
    ]


def rows(found: Shadow) -> list[Row]:
    """Return the table of shadow mode."""
    km = max(found.metres / 1000.0, 1e-9)
    note = f"{found.metres / 1000.0:.1f} km of all karts"
    full = found.count(DangerStage.FULL)
    false, needless = (
        count(DangerStage.FULL) for count in (found.count_false, found.count_needless)
    )
    return [
        Row(
            "false full brakes in races",
            "per 1,000 km",
            1000.0 * false / km,
            most=1.0,
            note=f"{false} in {note}",
        ),
        Row(
            "full brakes in races without which nothing came close",
            "per 1,000 km",
            1000.0 * needless / km,
            least=0.0,
            note=f"{needless} in {note}",
        ),
        Row(
            "full brakes in races without which something did",
            "per 1,000 km",
            1000.0 * (full - needless) / km,
            least=0.0,
            note=f"{full - needless} in {note}",
        ),
        Row(
            "false warnings in races",
            "per 10 km",
            10.0 * found.count_false(DangerStage.WARN) / km,
            most=1.0,
            note=f"{found.count(DangerStage.WARN)} warnings in {note}",
        ),
    ]
