"""Readings that cannot be, clocks that are set back, words that hold for ever: the kart stops."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.ego import Ego
from race_agents.unit.fence import CourseFence
from race_agents.unit.objects import Objects
from race_agents.unit.orders import GivenOrders
from race_agents.unit.readings import Fix, Range, Readings
from race_agents.unit.safety import Command, Echoes
from race_agents.unit.seen_motion import SeenMotion
from race_server.core import codes
from race_server.core.alert import Cause
from race_server.core.messages import Control
from race_server.core.telemetry import Sensor, SensorState
from race_server.core.vehicle_presets import KART_60

STEP_S = 0.01
LINE = np.zeros((600, 4))
LINE[:, 0] = np.arange(600.0)
Change = Callable[[Readings], Readings]


@dataclass
class Drive:
    """A kart that drives straight on at full throttle, with borders 6 m to both sides."""

    change: Change = lambda readings: readings
    person: float = math.inf  # [m] along the course
    x: float = 5.0
    speed: float = 0.0
    pull: float = 0.0
    steps: int = 0
    hears: bool = True
    waits_s: float = 0.0  # before the driver's foot goes down
    clock_s: float = 100.0
    unit: ControlUnit = field(
        default_factory=lambda: ControlUnit.of(
            KART_60, CourseFence(LINE, np.full((600, 2), 6.0), 0.5)
        )
    )
    chance: Any = field(default_factory=lambda: np.random.default_rng(1))

    def go(self, seconds: float) -> Command:
        """Drive on; return what was commanded last."""
        for _ in range(round(seconds / STEP_S)):
            self._step()
        return self.unit.command

    def _step(self) -> None:
        self.steps += 1
        self.clock_s += STEP_S
        self.speed = max(self.speed + self.pull * STEP_S, 0.0)
        self.x += self.speed * STEP_S
        noise = self.chance.normal(0.0, 0.01, 6).tolist()
        fix = Fix(self.x + KART_60.rear_axle + noise[0], noise[1], 0.02, stamp_s=self.clock_s)
        readings = Readings(
            self.clock_s,
            self.speed + noise[2],
            0.1 * noise[3],
            0.01 * noise[4],
            (self.pull + noise[5], noise[0]),
            fix if self.steps % 10 == 0 else None,
            self._echoes() if self.steps % 5 == 0 else None,
        )
        self.unit.sense(self.change(readings))
        if self.hears:
            self.unit.hear(GivenOrders(15.0, 1.0), self.clock_s)
        foot = 1.0 if self.steps * STEP_S > self.waits_s else 0.0
        self.unit.drive(Control(0.0, foot), self.clock_s)
        command = self.unit.decide(self.clock_s)
        self.pull = 4.0 * command.throttle - 9.0 * command.brake

    def _echoes(self) -> Echoes:
        rows = [(ahead, side, codes.BORDER) for ahead in (12.0, 20.0, 30.0) for side in (-6.0, 6.0)]
        far = self.person - self.x
        if 0.0 < far < 60.0:
            rows += [(far, side, codes.PERSON) for side in (-0.2, 0.0, 0.2)]
        x, y, kinds = (np.array(column, float) for column in zip(*rows, strict=True))
        closing = self.speed * x / np.hypot(x, y)
        x = x + self.chance.normal(0.0, 0.02, len(x))
        return Echoes(x, y, closing, kinds.astype(np.uint8))


def once(at: int, change: Change) -> Change:
    """Return a change of the reading of one step."""
    seen = iter(range(10**6))
    return lambda readings: change(readings) if next(seen) == at else readings


def fixed(**values: Any) -> Change:
    """Return a change of the fix in a reading."""
    fix = Fix(20.0, 0.0, 0.02, heading=0.0, speed=5.0)
    return lambda readings: replace(readings, fix=replace(fix, **values))


@pytest.mark.parametrize(
    "change",
    [
        *(fixed(**{name: math.nan}) for name in ("heading", "heading_deviation", "speed")),
        *(fixed(**{name: math.inf}) for name in ("course", "deviation", "stamp_deviation_s")),
        fixed(heading=1e200),
        *(
            lambda readings, beacon=beacon: replace(readings, beacons=(beacon,))
            for beacon in (
                Range(math.nan, 0.0, 5.0),
                Range(0.0, 0.0, 5.0, math.nan),
                Range(0.0, 0.0, 5.0, 0.0),
            )
        ),
    ],
)
def test_one_number_that_cannot_be_blinds_no_kart(change: Change) -> None:
    drive = Drive(change=once(300, change), person=70.0)
    drive.go(13.5)
    assert np.isfinite(drive.unit.fusion.state).all()  # type: ignore[union-attr]
    assert drive.speed == 0.0
    assert 68.0 < drive.x + drive.unit.limits.nose < 70.0


def test_a_kart_whose_estimate_is_no_number_brakes() -> None:
    drive = Drive()
    drive.go(3.0)
    drive.unit.fusion.filter.state = np.full(10, math.nan)  # type: ignore[union-attr]
    assert drive.unit.decide(drive.clock_s) == Command(cause=Cause.SENSOR)
    assert Command().brake == 1.0


def test_wheels_that_tell_a_stand_from_the_start_are_stuck_and_the_kart_crawls() -> None:
    sound = Drive()
    sound.go(12.0)
    assert sound.speed == pytest.approx(15.0, abs=0.5)  # the cap of the game
    drive = Drive(change=lambda readings: replace(readings, wheel_speed=0.0))
    drive.go(3.0)
    assert drive.unit.watch.state(Sensor.WHEELS) is SensorState.STUCK
    drive.go(9.0)
    assert Cause.SENSOR in drive.unit.command.cause
    assert drive.speed < 5.0


@pytest.mark.parametrize("sensor", ["wheel_speed", "yaw_rate"])
def test_a_kart_whose_wheels_or_gyro_died_while_it_stood_crawls(sensor: str) -> None:
    def dead(readings: Readings) -> Readings:
        return replace(readings, **{sensor: math.nan}) if readings.time_s > 102.005 else readings

    drive = Drive(change=dead, waits_s=3.0)
    drive.go(2.0)
    assert drive.unit.fusion is not None
    assert drive.unit.fusion.inertial.rests
    drive.go(6.0)
    assert Cause.SENSOR in drive.unit.command.cause
    assert drive.speed == pytest.approx(drive.unit.limits.slow_speed, abs=0.2)


def test_a_kart_that_borders_and_fixes_see_moving_does_not_rest_whatever_its_wheels_tell() -> None:
    drive = Drive(change=lambda readings: replace(readings, wheel_speed=0.0), waits_s=1.0)
    drive.go(1.0)
    assert drive.unit.fusion is not None
    assert drive.unit.fusion.inertial.rests
    while drive.speed < 0.7:
        drive.pull = 1.0  # pushed so gently that what is felt may be noise
        drive._step()
    assert not drive.unit.fusion.inertial.rests


def test_a_kart_without_fresh_scans_of_its_lidar_does_not_know_what_they_showed() -> None:
    ranges = np.full(9, 20.0)

    def seen(readings: Readings) -> Readings:
        noisy = ranges + drive.chance.normal(0.0, 0.01, 9)
        return replace(readings, ranges=noisy if readings.time_s < 102.0 else None)

    drive = Drive(change=seen)
    drive.go(1.9)
    assert drive.unit.ranges is not None
    drive.go(0.5)
    assert drive.unit.ranges is None


@pytest.mark.parametrize("back_s", [0.0, 1.0, 30.0])
def test_silence_is_noticed_at_once_where_the_clock_was_set_back(back_s: float) -> None:
    drive = Drive()
    drive.go(6.0)
    drive.unit.hear_game(drive.clock_s)
    drive.clock_s -= back_s
    drive.go(0.14)
    assert drive.unit.command.brake < 0.1  # it holds the cap
    drive.go(0.03)
    assert drive.unit.command.brake == 0.6
    assert Cause.GAME in drive.unit.command.cause


def test_fixes_are_believed_soon_after_the_clock_was_set_back() -> None:
    drive = Drive()
    drive.go(6.0)
    drive.clock_s -= 30.0
    drive.go(0.3)
    pose = drive.unit.pose()
    assert pose is not None
    assert pose.deviation < 0.1
    assert pose.x == pytest.approx(drive.x + KART_60.rear_axle, abs=0.2)


def test_no_word_of_the_server_holds_for_ever() -> None:
    @dataclass(frozen=True)
    class Endless(GivenOrders):
        valid_s: float = 1e30

    drive = Drive(hears=False)
    drive.unit.hear(Endless(15.0, 1.0), drive.clock_s)
    drive.go(1.5)
    assert drive.speed > 2.0
    drive.go(6.0)
    assert drive.speed == 0.0
    assert Cause.LINK in drive.unit.command.cause


def test_somebody_who_crosses_among_forty_spectators_is_foreseen() -> None:
    """Each spectator is a track; those who are near must not be forgotten for those who are new."""
    objects = Objects(radar=1.5)
    crossing = -4.0
    for scan in range(40):
        ahead, crossing = 50.0 - 0.7 * scan, -4.0 + 0.1 * scan
        rows = [(ahead, crossing)] + [(ahead - 20.0 + 1.6 * n, 9.0) for n in range(40)]
        x, y = (np.array(column) for column in zip(*rows, strict=True))
        closing = 14.0 * x / np.hypot(x, y)
        closing[0] -= 2.0 * y[0] / np.hypot(x[0], y[0])
        objects.look(
            Echoes(x, y, closing, np.full(len(x), codes.PERSON, np.uint8)),
            Ego(0.7, 0.0, 0.0, 14.0),
            0.05,
        )
    known = [track for track in objects.tracks if abs(track.state[1] - crossing) < 0.5]
    assert [track.scans > 30 for track in known] == [True]
    assert known[0].velocity[1] == pytest.approx(2.0, abs=0.5)


def test_what_a_radar_calls_by_an_unknown_number_is_a_thing() -> None:
    def unknown(readings: Readings) -> Readings:
        echoes = readings.echoes
        if echoes is None:
            return readings
        kinds = np.where(echoes.kinds == codes.PERSON, 200, echoes.kinds).astype(np.uint8)
        return replace(readings, echoes=replace(echoes, kinds=kinds))

    drive = Drive(change=unknown, person=70.0)
    drive.go(13.5)
    assert drive.speed == 0.0
    assert drive.x + drive.unit.limits.nose < 70.0


def test_a_closing_speed_that_is_no_number_tells_nothing_of_the_karts() -> None:
    x, y = np.full(5, 11.0), np.linspace(-0.5, 0.5, 5)
    kinds = np.full(5, codes.BORDER, np.uint8)
    for closing, speed in (
        ([2.0, 2.0, 2.0, 2.0, math.nan], 2.0),
        ([2.0] * 3 + [math.nan] * 2, 0.0),
    ):
        seen = SeenMotion(1.0)
        seen.take(Readings(0.0, 0.0, 0.0, 0.0, echoes=Echoes(x, y, np.array(closing), kinds)))
        assert seen.speed(0.0) == pytest.approx(speed, abs=0.01)
