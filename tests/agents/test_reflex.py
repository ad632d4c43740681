"""The reflex of a real kart: what makes it brake, and what does not."""

import math
import random

import numpy as np
import pytest

from race_agents.unit.control_unit import UNSEEN_S
from race_agents.unit.drift import Arcs
from race_agents.unit.fence import CourseFence
from race_agents.unit.limits import Limits
from race_agents.unit.safety import (
    Echoes,
    Verdict,
    braking_time,
    combine,
    in_the_way,
    is_on_way,
    watch_creeping,
    watch_driver,
    watch_fence,
    watch_link,
    watch_obstacles,
    watch_restart,
    watch_speed,
    way_along,
)
from race_server.core import codes
from race_server.core.alert import Advice, Cause, DangerStage
from race_server.core.messages import Control, RayHit
from race_server.core.vehicle_presets import KART_60
from support.plant_loop import Loop

LIMITS = Limits(
    braking=5.0,
    promised=7.0,
    reaction_s=0.2,
    half_width=0.7,
    spare=0.0,
    berth=0.3,
    near=30.0,
    nose=1.5,
    stand_off=0.5,
    restart=3.0,
    top_speed=20.0,
    reverse_speed=1.5,
    sharpest=0.5,
    grip=6.0,
    slow_speed=2.0,
    fence=1.0,
)


def wall_ahead(distance: float, closing: float, kind: int = codes.OBSTACLE) -> Echoes:
    """Return one echo, `distance` [m] ahead of the bumper."""
    where = np.array([LIMITS.nose + distance])
    return Echoes(where, np.zeros(1), np.array([closing]), np.array([kind], np.uint8))


def test_from_ten_a_second_the_brakes_must_be_full_one_point_two_seconds_before() -> None:
    # 10 m of braking way and 2 m of reaction: 12 m at 10 m/s; what draws away needs no braking.
    times = braking_time(np.array([10.0, -3.0]), LIMITS)
    assert times == pytest.approx([1.2, LIMITS.reaction_s])


@pytest.mark.parametrize(("gap", "brakes"), [(12.4, True), (12.6, False)])
def test_the_reflex_brakes_when_the_way_to_stop_is_all_that_is_left(
    gap: float, brakes: bool
) -> None:
    # 12 m to stop from 10 m/s and half a metre to stand off.
    verdict = watch_obstacles(wall_ahead(gap, 10.0), 10.0, 0.0, 0.0, LIMITS)
    assert (verdict.brake == 1.0) is brakes


def test_what_is_too_far_for_any_arc_is_left_out_and_nothing_else() -> None:
    chance = np.random.default_rng(1)
    held = 0
    for _ in range(2000):
        x, y, kind = chance.uniform(0.0, 6.0, 1), chance.uniform(-4.0, 4.0, 1), codes.PERSON
        echoes = Echoes(x, y, np.zeros(1), np.array([kind], np.uint8))
        curvature = float(chance.uniform(-LIMITS.sharpest, LIMITS.sharpest))
        along, aside = way_along(x, y, curvature)
        is_met = is_on_way(along, aside, np.full(1, LIMITS.berth), curvature, LIMITS)
        is_held = bool((is_met & (along - LIMITS.nose < LIMITS.stand_off)).any())
        verdict = watch_creeping(echoes, curvature, LIMITS.stand_off, LIMITS)
        assert (verdict.brake > 0.0) is is_held
        held += is_held
    assert 200 < held < 1800


def test_full_throttle_does_not_help_against_the_reflex() -> None:
    verdict = watch_obstacles(wall_ahead(5.0, 10.0), 10.0, 0.0, 0.0, LIMITS)
    command = combine(Control(0.3, 1.0), 10.0, [verdict], LIMITS, game_speed=99.0, thrust=5.0)
    assert (command.steering, command.throttle, command.brake) == (0.3, 0.0, 1.0)
    assert command.cause is Cause.OBSTACLE


def test_no_share_of_the_motor_turns_the_pedal_round() -> None:
    for pedal in (1.0, -1.0):
        command = combine(Control(0.0, pedal), 0.0, [Verdict()], LIMITS, thrust=-1.0)
        assert command.throttle == 0.0


def test_no_message_of_the_game_makes_a_kart_faster() -> None:
    for chance in (random.Random(seed) for seed in range(300)):
        verdict = Verdict(
            speed=chance.choice([math.inf, chance.uniform(0.0, 10.0)]),
            brake=chance.random(),
            motor=chance.random(),
        )
        control = Control(0.0, chance.uniform(-1.0, 1.0), chance.random())
        speed = chance.uniform(-2.0, 15.0)
        alone = combine(control, speed, [verdict], LIMITS)
        told = combine(
            control,
            speed,
            [verdict],
            LIMITS,
            game_speed=chance.uniform(0.0, 99.0),
            thrust=chance.uniform(0.0, 9.0),
        )
        assert abs(told.throttle) <= abs(alone.throttle)
        assert told.brake >= alone.brake


@pytest.mark.parametrize(
    ("aside", "kind", "brakes"),
    [
        (0.8, codes.KART_HIT, False),
        (0.8, codes.OBSTACLE, True),  # a person 0.1 m beside the kart is wider than that
        (1.1, codes.OBSTACLE, False),  # people beside the way may stand there
    ],
)
def test_what_stands_beside_the_way_is_no_danger_but_people_get_a_berth(
    aside: float, kind: int, brakes: bool
) -> None:
    beside = Echoes(
        np.array([6.0]), np.array([aside]), np.array([10.0]), np.array([kind], np.uint8)
    )
    verdict = watch_obstacles(beside, 10.0, 0.0, 0.0, LIMITS)
    assert (verdict.brake == 1.0) is brakes


def test_something_on_the_arc_is_a_danger_and_straight_ahead_is_none() -> None:
    # A left bend of radius 10 m: a quarter of it ends at (10, 10).
    along, aside = way_along(np.array([10.0, 10.0]), np.array([10.0, 0.0]), 0.1)
    assert (along[0], aside[0]) == pytest.approx((5.0 * math.pi, 0.0))
    assert abs(aside[1]) == pytest.approx(10.0 * (math.sqrt(2.0) - 1.0))


def wall_of(points: list[tuple[float, float]]) -> Echoes:
    x, y = np.array(points).T
    return Echoes(x + LIMITS.nose, y, np.full(len(x), 10.0), np.full(len(x), codes.BORDER, "u1"))


def test_the_border_of_a_bend_is_no_danger_while_a_way_leads_past_it() -> None:
    # At 10 m/s and 6 m/s² across the sharpest way has a radius of 16.7 m: 3 m aside after 10 m.
    post = wall_of([(9.0, 0.0)])
    assert watch_obstacles(post, 10.0, 0.0, 0.0, LIMITS) == Verdict()
    # Braking by all that is promised takes 8.1 m, and no way is longer than 7.4 m.
    wall = wall_of([(6.5, 0.5 * side) for side in range(-12, 13)])
    assert watch_obstacles(wall, 10.0, 0.0, 0.0, LIMITS).brake == 1.0
    person = wall_ahead(9.0, 10.0, codes.OBSTACLE)
    assert watch_obstacles(person, 10.0, 0.0, 0.2, LIMITS).brake == 1.0


def test_a_kart_that_moves_away_is_followed_without_braking() -> None:
    assert (
        watch_obstacles(wall_ahead(1.0, -0.5, codes.KART_HIT), 10.0, 0.0, 0.0, LIMITS) == Verdict()
    )


def test_a_kart_that_stands_before_a_person_does_not_creep() -> None:
    assert watch_creeping(wall_ahead(0.3, 0.0), 0.0, 0.5, LIMITS).brake == 1.0
    assert watch_creeping(wall_ahead(0.7, 0.0), 0.0, 0.5, LIMITS) == Verdict()


def test_a_kart_that_stood_for_a_person_does_not_steer_around_it() -> None:
    person = Echoes(
        np.array([LIMITS.nose + 2.0]), np.zeros(1), np.zeros(1), np.array([codes.OBSTACLE], "u1")
    )
    assert watch_creeping(person, 0.5, LIMITS.restart, LIMITS).brake == 0.0
    assert watch_restart(person, LIMITS).brake == 1.0


@pytest.mark.parametrize(("closing", "is_met"), [(5.0, True), (6.5, True), (12.0, False)])
def test_a_kart_that_crosses_faster_than_one_drives_oneself_is_not_braked_fully_for(
    closing: float, is_met: bool
) -> None:
    crosses = Echoes(
        np.array([LIMITS.nose + 1.0]),
        np.zeros(1),
        np.array([closing]),
        np.array([codes.KART_HIT], "u1"),
    )
    assert in_the_way(crosses, 3.4, 0.0, 0.0, LIMITS).any() == is_met


def test_a_kart_that_stood_for_a_person_waits_who_then_stands_where_no_beam_reaches() -> None:
    unit = Loop("kart").run(4.0).unit
    unit.drive(Control(throttle=1.0), unit._time_s)
    person = Echoes(
        np.array([unit.limits.nose + 1.0]),
        np.zeros(1),
        np.array([2.0]),
        np.array([codes.OBSTACLE], "u1"),
    )
    unit.echoes = unit.loose = person
    assert unit._watch_ahead(Arcs(2.0, 0.0, 0.0)).brake == 1.0
    seen = unit.alert().danger
    assert (seen.stage, seen.kind) == (DangerStage.FULL, RayHit.OBSTACLE)
    assert (seen.distance, seen.bearing, seen.time_s) == pytest.approx((1.0, 0.0, 0.5))
    unit.echoes = unit.loose = Echoes.nothing()
    for later_s, brake in ((0.1, 1.0), (UNSEEN_S - 0.2, 1.0), (0.2, 0.0)):
        unit._time_s += later_s
        assert unit._watch_ahead(Arcs(0.0, 0.0, 0.0)).brake == brake
        assert (unit.alert().danger.advice is Advice.WAIT) == (brake == 1.0)


def test_a_kart_that_hears_nothing_says_that_it_slows_down_for_that() -> None:
    loop = Loop("kart").run(4.0)
    loop.unit.decide(loop.unit._time_s + 1.0)
    alert = loop.unit.alert()
    assert (alert.danger.stage, alert.danger.kind) == (DangerStage.EASE, RayHit.NOTHING)
    assert Cause.LINK in alert.cause


@pytest.mark.parametrize(
    ("age_s", "motor", "brake"), [(0.1, 1.0, 0.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.6)]
)
def test_a_driver_who_lets_go_coasts_then_stops(age_s: float, motor: float, brake: float) -> None:
    verdict = watch_driver(age_s, LIMITS)
    assert (verdict.motor, verdict.brake) == (motor, brake)


def test_a_silent_link_slows_then_stops() -> None:
    assert watch_link(0.2, 0.5, LIMITS) == Verdict()
    assert watch_link(0.4, 0.5, LIMITS).speed == LIMITS.slow_speed
    assert watch_link(0.6, 0.5, LIMITS).brake == 0.6


def test_the_hard_cap_stands_above_every_boost() -> None:
    command = combine(
        Control(0.0, 1.0), 21.0, [watch_speed(21.0, LIMITS)], LIMITS, game_speed=99.0, thrust=2.0
    )
    assert command.throttle == 0.0
    assert command.brake > 0.0


def test_outside_the_fence_the_kart_crawls() -> None:
    line = np.stack([np.arange(20.0), np.zeros(20), np.zeros(20), np.zeros(20)], axis=1)
    fence = CourseFence(line, np.full((20, 2), 4.0), 0.5)
    assert fence.beyond(10.0, 3.0) == pytest.approx(-1.5)
    assert fence.beyond(10.0, -6.0) == pytest.approx(1.5)
    assert watch_fence(0.9, LIMITS) == Verdict()
    assert watch_fence(1.5, LIMITS).speed == LIMITS.slow_speed


def test_the_game_stops_a_kart_with_a_cap_of_zero() -> None:
    command = combine(Control(0.0, 1.0), 3.0, [Verdict()], LIMITS, game_speed=0.0)
    assert command.throttle == 0.0
    assert command.brake == 0.7


def test_the_reflex_of_a_fast_kart_counts_on_less_than_its_brakes_promise() -> None:
    limits = Limits.of(KART_60)
    assert limits.braking == pytest.approx(0.7 * 0.75 * 9.81)
    assert limits.top_speed == pytest.approx(1.25 * 60.0 / 3.6)
