"""Steers round, brakes or goes back: what a policy that evades does near people and blocks."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_agents.drivers.learned import Learned
from race_agents.planning.evasion import (
    GOES_S,
    PATIENCE,
    SEES,
    evade,
    lack,
    note_points,
)
from race_server.competition.parking_exam import ExamSpec, drive_exam
from race_server.core.kernel_driver import Cockpit, cockpit_for
from race_server.core.kernels.motion import Command
from race_server.core.observation import PART_NUMBERS, layout_of
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import DriverError
from support.briefings import briefing

RAYS = 41
KART = vehicle_named("kart-13")  # 2.06 m long, 1.3 m wide
STRAIGHT_ON, STRAIGHT_BACK = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
NOTHING = (0.0, 0.0, 0.0)


def cockpit_with(speed: float = 0.0, **seen: list[float]) -> Cockpit:
    """A kart far from its slot, which lies ahead, in the open."""
    cockpit = cockpit_for(
        briefing(
            "yard", vehicle=KART, decision_s=0.1, lidar_field=math.radians(200), lidar_reach=8.0
        ),
        layout_of(SEES, RAYS),
    )
    parts = {
        "speed": [speed],
        "lidar": [8.0] * RAYS,
        "goal_x": [30.0],
        "goal_distance": [30.0],
        "movers_x": [100.0, 100.0],
        "movers_age": [5.0, 5.0],
        **seen,
    }
    for name, values in parts.items():
        begin = cockpit.offsets[PART_NUMBERS[name]]
        cockpit.observation[begin : begin + len(values)] = values
    return cockpit


def person(x: float, y: float, speed_x: float = 0.0, speed_y: float = 0.0) -> dict[str, list]:
    """A person whom a ray has just met, as parts of an observation."""
    return {
        "movers_x": [x, 100.0],
        "movers_y": [y, 0.0],
        "movers_speed_x": [speed_x, 0.0],
        "movers_speed_y": [speed_y, 0.0],
        "movers_age": [0.0, 5.0],
        "movers_radius": [0.3, 0.0],
    }


def given(cockpit: Cockpit, command: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return what becomes of a command: steering, throttle, brake."""
    cockpit.control[:3] = command
    evade(cockpit)
    steering, throttle, brake, _ = cockpit.control.tolist()
    return steering, throttle, brake


def wall_ahead(away: float) -> list[float]:
    """Return the ranges [m] to a wall across the way, so far ahead of the lidar."""
    angles = np.radians(200) * (np.arange(RAYS) / (RAYS - 1) - 0.5)
    with np.errstate(divide="ignore"):
        ranges = np.where(np.abs(angles) < 1.5, away / np.cos(angles), 8.0)
    return np.minimum(ranges, 8.0).tolist()


def test_in_the_open_a_command_stays_as_it_is() -> None:
    assert given(cockpit_with(3.6), STRAIGHT_ON) == STRAIGHT_ON
    assert given(cockpit_with(-1.5), STRAIGHT_BACK) == STRAIGHT_BACK


def test_a_wall_that_is_reached_within_a_second_is_braked_for() -> None:
    """The nose is 1.1 m ahead; at 3.6 m/s a second leads 3.6 m on."""
    assert given(cockpit_with(3.6, lidar=wall_ahead(6.5)), STRAIGHT_ON) == STRAIGHT_ON
    _, throttle, brake = given(cockpit_with(3.6, lidar=wall_ahead(3.0)), STRAIGHT_ON)
    assert throttle <= 0.0
    assert brake == 1.0 or throttle == -1.0


def test_a_block_at_one_side_is_steered_round_at_full_pace() -> None:
    """A block that the right corner would graze, 0.1 m beside it: the nose turns left."""
    angles = np.radians(200) * (np.arange(RAYS) / (RAYS - 1) - 0.5)
    is_there = (np.radians(-25) < angles) & (angles < np.radians(-8))
    lidar = np.where(is_there, 3.0, 8.0).tolist()
    steering, throttle, brake = given(cockpit_with(3.6, lidar=lidar), STRAIGHT_ON)
    assert steering > 0.2
    assert (throttle, brake) == (1.0, 0.0)


def test_a_person_who_crosses_is_let_through_and_one_who_has_passed_is_not_waited_for() -> None:
    """Both are 2.5 m ahead and 1 m left, and walk at 1.2 m/s: to the right, and to the left."""
    towards = given(cockpit_with(3.0, **person(3.0, 1.2, speed_y=-1.2)), STRAIGHT_ON)
    assert towards != STRAIGHT_ON
    away = given(cockpit_with(3.0, **person(3.0, 1.7, speed_y=1.2)), STRAIGHT_ON)
    assert away == STRAIGHT_ON


def test_a_person_not_seen_for_long_is_forgotten() -> None:
    known = person(2.0, 0.0)
    assert given(cockpit_with(3.0, **known), STRAIGHT_ON) != STRAIGHT_ON
    assert given(cockpit_with(3.0, **(known | {"movers_age": [2.5, 5.0]})), STRAIGHT_ON) == (
        STRAIGHT_ON
    )


def test_a_vehicle_that_backs_into_one_that_stands_makes_it_drive_off() -> None:
    """It comes at 1.5 m/s from the left, 2.5 m away; before and behind is room."""
    comes = person(0.0, 2.5, speed_y=-1.5) | {"movers_radius": [0.65, 0.0]}
    _, throttle, brake = given(cockpit_with(0.0, **comes), NOTHING)
    assert abs(throttle) == 1.0
    assert brake == 0.0


def test_a_vehicle_that_does_nothing_goes_towards_its_slot_after_a_while() -> None:
    cockpit = cockpit_with()
    answers = [given(cockpit, NOTHING) for _ in range(30)]
    begins = round(PATIENCE / 0.1)
    assert answers[: begins - 1] == [NOTHING] * (begins - 1)
    throttles = [throttle for _, throttle, _ in answers[begins + 1 :]]
    assert throttles[: round(GOES_S / 0.1) - 2] == [0.5] * (round(GOES_S / 0.1) - 2)


def test_a_vehicle_before_a_wall_goes_back_although_its_slot_is_behind_the_wall() -> None:
    cockpit = cockpit_with(lidar=wall_ahead(1.2))
    answers = [given(cockpit, STRAIGHT_ON) for _ in range(10)]
    assert answers[-1][1] == -0.5


def test_a_vehicle_in_its_slot_stays_there() -> None:
    cockpit = cockpit_with(goal_x=[0.1], goal_distance=[0.1], parked_for=[0.2])
    assert [given(cockpit, NOTHING) for _ in range(20)] == [NOTHING] * 20


def test_no_command_is_changed_before_the_lights_go_out() -> None:
    cockpit = cockpit_with(3.6, lidar=wall_ahead(2.0), lights=[1.0])
    assert given(cockpit, STRAIGHT_ON) == STRAIGHT_ON


@pytest.mark.parametrize("x", np.linspace(1.5, 6.0, 10).tolist())
@pytest.mark.parametrize("y", [-1.5, 0.0, 0.7])
def test_what_is_commanded_lacks_no_more_room_than_what_was_wanted(x: float, y: float) -> None:
    cockpit = cockpit_with(2.5, **person(x, y, -0.5, 0.3))
    answer = given(cockpit, STRAIGHT_ON)
    points = note_points(cockpit)
    assert lack(cockpit, points, Command(*answer)) <= lack(cockpit, points, Command(0.0, 1.0, 0.0))


# In a policy file


@pytest.mark.slow
def test_a_bundled_policy_that_evades_hits_less_than_its_network_alone() -> None:
    """16 tasks of three karts each, of which none taught it anything."""
    hits = {}
    for evades in (False, True):

        def make(name: str, evades: bool = evades) -> Learned:
            driver = Learned("parking-2-karts")
            assert driver.policy.metadata.evades
            driver.policy.metadata = replace(driver.policy.metadata, evades=evades)
            return driver

        spec = ExamSpec("yard-70", range(7_000_001, 7_000_017), vehicles=3)
        tries = list(drive_exam(spec, "learned:parking-2-karts", make))
        hits[evades] = sum(not one.figures["is_success"] for one in tries)
    assert hits[False] >= 5
    assert hits[True] <= 0.5 * hits[False]


def test_a_vehicle_with_a_trailer_does_not_evade() -> None:
    driver = Learned("parking-2")
    lorry = vehicle_named("lorry-16m5")
    driver.policy.metadata = replace(driver.policy.metadata, vehicle=lorry.name)
    with pytest.raises(DriverError, match=r"reckoned for one body, and lorry-16m5 draws a trailer"):
        driver.reset(briefing("full", vehicle=lorry, decision_s=0.1))
