"""A driver on the line is slower where it came too near to a border before, or slid."""

from dataclasses import replace

import numpy as np
import pytest

from race_agents.drivers.learned import Learned
from race_agents.drivers.mapper import Mapper
from race_agents.planning.care import take_care
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import Cockpit, memory_size
from race_server.core.observation import layout_of, offsets_of
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import line_of
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.reference import reference_limit
from race_server.scenario.raceline.turning_over import slowed
from race_server.scenario.track.load import load_course
from support.cockpits import alone
from support.races import run_race

# TT02 is 0.45 m long and 0.19 m wide: a stretch of the course is 1.8 m, and too near is 9.5 mm.
AT_THE_WALL, CLEAR = 0.1, 0.3


class Lap:
    """A kart that goes along an even line at 5 m/s, on a course of 90 m, 50 stretches."""

    def __init__(self, preset: str = "line") -> None:
        """Begin without any memory."""
        layout = layout_of(preset, 0)
        self.slices = layout.slices
        seen, control = np.zeros(layout.size), np.zeros(4)
        setup, uses = np.array([0.0, 0.0, 0.05]), np.zeros(1, np.int64)
        vehicle, memory = vehicle_record(TT02)[0], np.zeros(memory_size(0))
        self.cockpit = Cockpit(seen, offsets_of(layout), vehicle, setup, uses, memory, control)
        self.speed_at(89.999)

    @property
    def speed(self) -> float:
        """The speed [m/s] of the line where the kart is, as it takes it."""
        return float(self.cockpit.observation[self.slices["line_speed_ahead"]][0])

    def show(self, progress: float, room: float, **seen: float) -> None:
        """Show a place, with `room` [m] to its right."""
        values = {"line_speed_ahead": 5.0, "line_step": 0.2, "speed": 5.0, "grip_scale": 1.0}
        values |= {"karts_x": 1e3, "line_left_ahead": 1.0, "line_right_ahead": room}
        for name, value in (values | {"progress": progress} | seen).items():
            self.cockpit.observation[self.slices[name]] = value

    def speed_at(self, progress: float, room: float = CLEAR, **seen: float) -> float:
        """Return the speed [m/s] of the line at a place, with `room` [m] to its right."""
        self.show(progress, room, **seen)
        take_care(self.cockpit)
        return self.speed


def test_where_a_kart_came_too_near_it_is_3_percent_slower_on_the_way_there() -> None:
    lap = Lap()
    assert lap.speed_at(50.0) == 5.0
    lap.speed_at(50.0, room=AT_THE_WALL)
    # 1.2 s at 5 m/s are 6 m.
    assert lap.speed_at(50.0 - 6.0) == pytest.approx(0.97 * 5.0)
    assert lap.speed_at(50.0 - 2.0) == pytest.approx(0.97 * 5.0)
    assert lap.speed_at(50.0 - 12.0) == lap.speed_at(50.0 + 2.0) == 5.0


def test_what_lasts_counts_once_and_each_further_lap_again_up_to_12_percent() -> None:
    lap = Lap()
    for times in range(1, 7):
        lap.speed_at(50.0, room=AT_THE_WALL)
        lap.speed_at(50.2, room=AT_THE_WALL)
        assert lap.speed_at(48.0) == pytest.approx((1.0 - min(0.03 * times, 0.12)) * 5.0)


def test_where_the_rear_axle_lost_its_hold_a_kart_is_6_percent_slower_on_the_way_there() -> None:
    lap = Lap()
    lap.speed_at(50.0, lateral_speed=-1.7)  # of 5 m/s: 0.33 rad
    assert lap.speed_at(48.0) == 5.0
    lap.speed_at(50.0, lateral_speed=-2.0)  # 0.38 rad
    lap.speed_at(50.2, room=AT_THE_WALL, lateral_speed=-2.0)
    lap.speed_at(50.4, room=AT_THE_WALL)
    assert lap.speed_at(48.0) == pytest.approx(0.94 * 5.0)
    assert lap.speed_at(52.0) == 5.0


def test_the_way_to_a_place_just_after_the_line_begins_before_the_line() -> None:
    lap = Lap()
    lap.speed_at(1.0, room=AT_THE_WALL)
    assert lap.speed_at(86.0) == pytest.approx(0.97 * 5.0)
    assert lap.speed_at(60.0) == 5.0


@pytest.mark.parametrize("why", ["karts_x", "grip_scale", "speed", "lights"])
def test_a_kart_that_was_pushed_or_slips_or_stands_learns_nothing(why: str) -> None:
    lap = Lap()
    seen = {"karts_x": 0.3, "grip_scale": 0.5, "speed": 0.2, "lights": 1.0}[why]
    lap.speed_at(50.0, AT_THE_WALL, **{why: seen})
    assert lap.speed_at(48.0) == 5.0


def test_the_tail_of_a_kart_that_points_inside_comes_near_as_well() -> None:
    lap = Lap()
    # 0.12 rad to the left brings the tail 27 mm to the right.
    lap.speed_at(50.0, room=0.125)
    assert lap.speed_at(48.0) == 5.0
    lap.speed_at(50.0, room=0.125, line_heading=0.12)
    assert lap.speed_at(48.0) == pytest.approx(0.97 * 5.0)


def test_a_policy_that_sees_the_line_is_slower_there_as_well() -> None:
    driver = Learned("full")
    layout = layout_of(driver.preset, 0)
    lap = Lap(driver.preset)
    drive = driver.driving(alone(lap.cockpit), layout)
    for progress, room in ((50.0, AT_THE_WALL), (48.0, CLEAR)):
        lap.show(progress, room)
        drive()
    assert lap.speed == pytest.approx(0.97 * 5.0)


@pytest.mark.slow
def test_a_corner_that_was_grazed_is_not_grazed_again() -> None:
    course, bounds = load_course("generated:spline:1000022"), bounds_of(TT02)
    # The fastest lap of all, which keeps no more room where it is fast.
    line = line_of(course, reference_limit(course, TT02).minimum_time)
    speed = slowed(line.speed, line.curvature, line.spacing, bounds)
    laps = Scenario(course, karts=1, line=replace(line, speed=speed))
    contacts = []
    for count in (1, 4):
        rules = Rules(laps=count, items=False)
        session, _ = run_race(replace(laps, rules=rules), ["raceline"])
        contacts.append(int(session.world.racers[0, 0].wall_contacts))
    assert contacts == [1, 1]


def test_a_driver_that_maps_has_compiled_what_it_races_with_before_the_start() -> None:
    mapper = Mapper()
    mapper.reset(Briefing(0, TT02, 3, "lidar", 0.05, ()))
    assert mapper._tracker._cockpit is not None
