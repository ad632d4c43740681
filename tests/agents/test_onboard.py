"""The real kart's own program: filter, reflex, and the whole loop with the plant."""

import math
import random

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from race_agents.plant.kart import Plant
from race_agents.plant.radar import Person, Surroundings, gap_to
from race_agents.plant.sensors import Sensors
from race_agents.unit import motion
from race_agents.unit.control_unit import UNSEEN_S, ControlUnit
from race_agents.unit.ekf import KartFilter
from race_agents.unit.fence import CourseFence
from race_agents.unit.limits import Limits
from race_agents.unit.motion import antenna_at, antenna_jacobian, drive_on, jacobian_of
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.safety import (
    Echoes,
    Verdict,
    braking_time,
    combine,
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
from race_server.core.messages import Control, Event, EventKind, RayHit, Status, Trust
from race_server.core.observation import Observation
from race_server.core.rules.items import items
from race_server.core.vehicle_presets import KART_30, KART_60, TT02
from race_server.live.server.hud import hud_of
from race_server.scenario.race import Rules, Scenario
from race_server.session import Session
from support.courses import ring

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
LEVER = 0.4


# The filter


def state_of(*values: float) -> np.ndarray:
    """Return a state that begins with these values; the others are 0."""
    state = np.zeros(motion.SIZE)
    state[: len(values)] = values
    return state


def simulated(
    seconds: float, seed: int = 3
) -> list[tuple[np.ndarray, float, float, np.ndarray | None]]:
    """Return truth, wheel speed, gyro and now and then a fix of a kart that swings about."""
    chance = np.random.default_rng(seed)
    state, rows = state_of(1.0, 2.0, 0.3, 5.0, 0.0, 0.05), []
    for turn in range(round(seconds * 50)):
        state = state.copy()
        state[4] = 0.8 * math.sin(0.02 * turn)
        state[3] = 5.0 + 2.0 * math.sin(0.011 * turn)
        state = drive_on(state, 0.02)
        fix = antenna_at(state, LEVER) + chance.normal(0.0, 0.3, 2) if turn % 5 == 0 else None
        speed, rate = state[3] + chance.normal(0.0, 0.1), state[4] + state[5]
        rows.append((state, float(speed), float(rate + chance.normal(0.0, 0.02)), fix))
    return rows


def wheels_told(state: np.ndarray) -> np.ndarray:
    return np.array([(1.0 + state[7]) * state[3]])


def wheels_row(state: np.ndarray) -> np.ndarray:
    row = state_of(0.0, 0.0, 0.0, 1.0 + state[7])[None]
    row[0, 7] = state[3]
    return row


def test_the_filter_is_that_of_filterpy() -> None:
    ours = KartFilter(1.0, 2.0, 0.2, lever=LEVER)
    ours.state[3] = 5.0
    theirs = ExtendedKalmanFilter(dim_x=motion.SIZE, dim_z=2)
    theirs.x, theirs.P = ours.state.copy(), ours.covariance.copy()
    agility = motion.Agility(compliance_drift=0.0)  # tyres that do not slip do not soften
    rate_row = np.zeros((1, motion.SIZE))
    rate_row[0, 4] = rate_row[0, 5] = 1.0
    for _, speed, rate, fix in simulated(20.0):
        theirs.F = jacobian_of(theirs.x, 0.02)
        noise = motion.process_noise(float(theirs.x[2]), 0.02, agility)
        after = drive_on(theirs.x, 0.02)
        theirs.P = theirs.F @ theirs.P @ theirs.F.T + noise
        theirs.x = after
        ours.predict(0.02)
        believed = ours.see_speed(speed, 0.1), ours.see_yaw_rate(rate, 0.02)
        # One in a thousand is not believed; filterpy has no gate.
        if believed[0]:
            theirs.update(np.array([speed]), wheels_row, wheels_told, R=np.array([[0.01]]))
        if believed[1]:
            theirs.update(
                np.array([rate]), lambda _: rate_row, lambda x: rate_row @ x, R=np.array([[4e-4]])
            )
        if fix is not None and ours.see_position(*fix, 0.3):
            theirs.update(
                fix,
                lambda x: antenna_jacobian(x, LEVER),
                lambda x: antenna_at(x, LEVER),
                R=np.eye(2) * 0.09,
            )
        turned = math.remainder(ours.state[2] - theirs.x[2], 2.0 * math.pi)
        assert turned == pytest.approx(0.0, abs=1e-9)
        theirs.x[2] = ours.state[2]
        assert ours.state == pytest.approx(theirs.x, abs=1e-8)
        assert ours.covariance == pytest.approx(theirs.P, abs=1e-8)


def test_the_jacobian_is_the_slope_of_the_motion() -> None:
    for rate in (-0.3, 0.7):
        state = state_of(1.0, 2.0, 0.5, 6.0, rate, 0.01, 0.8)
        slope = jacobian_of(state, 0.1)
        for column in range(motion.SIZE):
            nudge = np.zeros(motion.SIZE)
            nudge[column] = 1e-6
            ahead, behind = drive_on(state + nudge, 0.1), drive_on(state - nudge, 0.1)
            assert slope[:, column] == pytest.approx((ahead - behind) / 2e-6, abs=2e-4)


def test_the_jacobian_does_not_jump_where_bends_become_straight() -> None:
    flat, bent = (state_of(1.0, 2.0, 0.5, 6.0, rate, 0.0, 0.8) for rate in (0.9e-4, 1.1e-4))
    assert jacobian_of(flat, 0.1) == pytest.approx(jacobian_of(bent, 0.1), abs=1e-4)


def test_the_filter_knows_the_place_better_than_the_fixes_and_finds_the_bias() -> None:
    rows = simulated(40.0)
    filtered = KartFilter(1.0, 2.0, 0.2, lever=LEVER)  # at rest, as it believes
    errors = []
    for truth, speed, rate, fix in rows:
        filtered.predict(0.02)
        filtered.see_speed(speed, 0.1)
        filtered.see_yaw_rate(rate, 0.02)
        if fix is not None:
            filtered.see_position(*fix, 0.3)
        errors.append(math.hypot(*(filtered.state[:2] - truth[:2])))
    assert np.median(errors[500:]) < 0.15  # the fixes: 0.35 m
    assert filtered.state[5] == pytest.approx(0.05, abs=0.02)


def test_a_fix_ten_metres_off_is_refused_and_a_row_of_them_is_believed_in_the_end() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0)
    for _ in range(50):
        filtered.predict(0.1)
        filtered.see_speed(0.0, 0.05)
        filtered.see_position(0.0, 0.0, 0.1)
    assert not filtered.see_position(10.0, 0.0, 0.1)
    believed = [filtered.see_position(10.0, 0.0, 0.1) for _ in range(10)]
    assert not any(believed[:3])
    assert believed[-1]
    assert filtered.state[0] == pytest.approx(10.0, abs=0.3)


def driven(
    *, until_s: float, push: float, blow: float
) -> tuple[KartFilter, list[float], list[bool]]:
    """Drive east at 8 m/s; two seconds on the kart is pushed `push` m to the left within 0.1 s.

    Returns the filter, how far it was off each 0.02 s since, and which fixes it believed.
    """
    filtered, chance = KartFilter(0.0, 0.0, 0.0, lever=LEVER), np.random.default_rng(2)
    errors, believed = [], []
    for turn in range(1, round(50 * until_s)):
        time_s = turn * 0.02
        x, y = 8.0 * time_s, push * min(max((time_s - 2.0) / 0.1, 0.0), 1.0)
        filtered.predict(0.02, blow=blow if 2.0 < time_s < 2.12 else 0.0)
        filtered.see_speed(8.0, 0.1)
        filtered.see_yaw_rate(0.0, 0.02)
        if turn % 5 == 0:
            fix = np.array([x, y]) + chance.normal(0.0, 0.02, 2)
            believed.append(filtered.see_position(*fix, 0.02))
        if time_s > 2.0:
            errors.append(math.hypot(*(antenna_at(filtered.state, LEVER) - (x, y))))
    return filtered, errors, believed


def test_after_a_blow_the_next_fix_is_believed_and_puts_the_place_right() -> None:
    filtered, errors, believed = driven(until_s=4.0, push=0.7, blow=30.0)
    assert all(believed[20:])
    assert max(errors[10:]) < 0.15
    assert abs(filtered.state[2]) < 0.05


def test_a_place_that_was_lost_without_a_blow_does_not_turn_the_heading_over() -> None:
    filtered, errors, believed = driven(until_s=4.0, push=0.7, blow=0.0)
    assert not all(believed[20:])
    assert max(errors) < 0.8  # never further off than it was pushed
    assert max(errors[-25:]) < 0.1
    assert abs(filtered.state[2]) < 0.05


def test_a_blow_is_what_no_tyre_can_have_caused() -> None:
    unit = Loop("kart").run(4.0).unit
    assert unit.fusion is not None
    assert unit.fusion.blow((-6.5, 7.2)) == 0.0
    assert unit.fusion.blow((-24.0, 7.0)) == pytest.approx(25.0)
    assert unit.fusion.blow(None) == 0.0


def test_a_spin_does_not_lose_the_place() -> None:
    # East at 8 m/s, and from 2 s on the kart turns, faster and faster, and slides straight on.
    line = np.stack([np.arange(80.0), np.zeros(80), np.zeros(80), np.zeros(80)], axis=1)
    unit = ControlUnit.of(KART_30, CourseFence(line, np.full((80, 2), 8.0), 0.5))
    chance, errors = np.random.default_rng(4), []
    for turn in range(160):
        time_s = turn * 0.02
        rate = max(time_s - 2.0, 0.0)
        heading = 0.5 * rate * rate
        fix = None
        if turn % 5 == 0:
            x, y = chance.normal((8.0 * time_s, 0.0), 0.02)
            fix = Fix(float(x), float(y), 0.02)
        unit.sense(Readings(time_s, 8.0 * math.cos(heading), rate, 0.0, (0.0, 0.0), fix))
        assert fix is None or time_s < 1.0 or unit._fix_s == time_s  # none is refused
        told = unit.pose()
        assert told is not None
        errors.append(math.hypot(told.x - 8.0 * time_s, told.y))
    assert max(errors[50:]) < 0.15
    assert told.speed == pytest.approx(8.0 * math.cos(0.708), abs=0.3)
    assert told.lateral_speed == pytest.approx(-8.0 * math.sin(0.708), abs=0.5)


def test_the_heading_is_wrapped_where_it_turns_over() -> None:
    filtered = KartFilter(0.0, 0.0, 3.1, lever=0.0)
    filtered.state[4] = 1.0
    filtered.predict(0.1)
    assert filtered.state[2] == pytest.approx(3.2 - 2.0 * math.pi)


# The reflex


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


def test_full_throttle_does_not_help_against_the_reflex() -> None:
    verdict = watch_obstacles(wall_ahead(5.0, 10.0), 10.0, 0.0, 0.0, LIMITS)
    command = combine(Control(0.3, 1.0), 10.0, [verdict], LIMITS, game_speed=99.0, thrust=5.0)
    assert (command.steering, command.throttle, command.brake) == (0.3, 0.0, 1.0)
    assert command.cause is Cause.OBSTACLE


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
    assert unit._watch_ahead(0.0, 0.0, 2.0).brake == 1.0
    seen = unit.alert().danger
    assert (seen.stage, seen.kind) == (DangerStage.FULL, RayHit.OBSTACLE)
    assert (seen.distance, seen.bearing, seen.time_s) == (1.0, 0.0, 0.5)
    unit.echoes = unit.loose = Echoes.nothing()
    for later_s, brake in ((0.1, 1.0), (UNSEEN_S - 0.2, 1.0), (0.2, 0.0)):
        unit._time_s += later_s
        assert unit._watch_ahead(0.0, 0.0, 0.0).brake == brake
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


# The whole loop


class Loop:
    """A session, a plant and its control unit on one clock; the driver keeps to the middle."""

    def __init__(self, scale: str = "1/10", **sensors: float) -> None:
        vehicle, size = (TT02, 1.0) if scale == "1/10" else (KART_30, 5.0)
        course = ring(radius=4.0 * size, half_width=0.8 * size)
        rules = Rules(laps=2, countdown_s=0.5)
        self.session = Session("test", Scenario(course, karts=2, vehicles=(vehicle,), rules=rules))
        self.session.join("real", "track", tracked=True)
        self.session.join("other", "track")
        self.session.start()
        self.around = Surroundings(course.borders)
        place = tuple(float(value) for value in course.grid[0])
        self.plant = Plant.of(vehicle, self.around, place, Sensors(**sensors), seed=5)
        fence = CourseFence(course.line, course.half_widths, course.kerb)
        self.unit = ControlUnit.of(vehicle, fence)
        self.vehicle, self.sequence, self.pace, self.foot_down = vehicle, 0, 2.0 * size**0.7, False
        self.events: list[Event] = []
        self.hears = True

    def run(self, seconds: float) -> "Loop":
        for _ in range(round(seconds * 60)):
            tick = self.session.tick
            now_s = tick / 60.0
            self.unit.sense(self.plant.read(now_s + 77.0))  # a separate clock
            if self.hears and tick % 3 == 0:
                self.session.observe()
                self.unit.hear(hud_of(self.session, self.session.seats[0]), now_s + 77.0)
                values = self.session.view(0).copy()
                self.control = self._steer(Observation(tick, self.session.layout("track"), values))
            self.unit.drive(self.control, now_s + 77.0)
            self.plant.act(self.unit.decide(now_s + 77.0))
            self._tell(round(now_s * 1e6))
            self.session.follow(round(now_s * 1e6))
            self.events += self.session.advance(1)
        return self

    def _steer(self, seen: Observation) -> Control:
        bend = math.atan(self.vehicle.wheelbase * seen["curvature_ahead"][0])
        size = self.vehicle.length
        turn = -0.5 * seen.scalar("lateral_offset") / size - seen.scalar("heading_error")
        share = (bend + 0.5 * turn) / self.vehicle.steering_limit
        throttle = max(-1.0, min(2.0 * (self.pace - seen.scalar("speed")), 1.0))
        if seen.scalar("lights") > 0.0:
            throttle = 0.0
        throttle = 1.0 if self.foot_down else max(throttle, 0.0)
        return Control(max(-1.0, min(share, 1.0)), throttle)

    def _tell(self, now_us: int) -> None:
        pose, hud = self.unit.pose(), self.unit.hud
        if pose is None or hud is None or not self.hears:
            return
        self.sequence += 1
        self.session.receive_pose(
            0, 1, self.sequence, pose, arrived_us=now_us, acknowledged=hud.sequence
        )


@pytest.mark.parametrize("scale", ["1/10", "kart"])
def test_a_plant_drives_laps_where_the_server_says_it_is(scale: str) -> None:
    loop = Loop(scale).run(6.0)
    errors = []
    for _ in range(60):
        loop.run(1 / 60)
        body = loop.session.world.bodies[0, 0]
        errors.append(math.hypot(body.x - loop.plant.body.x, body.y - loop.plant.body.y))
    speed = loop.plant.body.speed
    assert speed > 1.0
    # The server shows the kart as of the tick that comes, the body is one tick on.
    assert np.median(errors) < 0.1 + 2.0 * speed / 60.0
    loop.run(24.0 if scale == "1/10" else 30.0)
    assert loop.session.world.racers["laps"][0, 0] >= 1
    assert loop.session.tracked_karts.trackers[0].trust is Trust.TRUSTED
    assert loop.plant.scrapes == 0


def test_a_plant_obeys_an_effect() -> None:
    loop = Loop().run(4.0)
    names = [item.name for item in items()]
    world = loop.session.world
    before = loop.plant.body.speed
    pulse = world.items[names.index("pulse") + 1]
    assert before > 1.0
    effect = world.players[0, 0].effects[0]
    effect["source"], effect["until_tick"] = names.index("pulse") + 1, loop.session.tick + 120
    effect["speed_scale"], effect["thrust_scale"] = 0.1, pulse.thrust_scale
    effect["grip_scale"] = 1.0
    loop.run(1.5)
    assert loop.unit.hud is not None
    assert len(loop.unit.hud.effects) == 1
    assert loop.plant.body.speed == pytest.approx(0.1 * TT02.top_speed, abs=0.15)
    loop.run(2.0)
    assert loop.plant.body.speed > 1.0


def test_the_reflex_stops_a_plant_before_a_person_with_the_throttle_full() -> None:
    loop = Loop().run(4.0)
    body = loop.plant.body
    angle = math.atan2(body.y, body.x) + 0.6  # 2.4 m on along the ring of 4 m
    person = Person(4.0 * math.cos(angle), 4.0 * math.sin(angle), 0.07)
    loop.around.people.append(person)
    loop.foot_down = True
    loop.run(2.0)
    assert loop.control.throttle == 1.0
    assert abs(body.speed) < 0.02
    assert loop.unit.command.cause & Cause.OBSTACLE
    assert 0.0 < gap_to(person, body) < 1.5
    loop.foot_down = False
    loop.around.people.clear()
    loop.run(UNSEEN_S + 1.0)
    assert body.speed > 0.5


def test_a_plant_whose_link_is_cut_stops_by_itself_and_is_parked() -> None:
    loop = Loop().run(4.0)
    speed, x, y = loop.plant.body.speed, loop.plant.body.x, loop.plant.body.y
    loop.hears = False
    loop.control = Control(loop.control.steering, 1.0)  # the driver's foot stays down
    loop.run(1.5)
    body = loop.plant.body
    assert abs(body.speed) < 0.02
    assert math.hypot(body.x - x, body.y - y) < speed + speed**2 / 3.0
    assert EventKind.FLAG in [event.kind for event in loop.events]
    loop.run(2.5)
    raced = loop.session.world.bodies[0, 0]
    assert raced.trust == Trust.SUSPENDED
    assert raced.status == Status.RACING
    loop.hears = True
    loop.run(2.0)
    assert raced.trust == Trust.TRUSTED
    assert body.speed > 0.5


def test_a_kart_that_hears_nothing_at_all_never_moves() -> None:
    unit = Loop().unit
    unit.drive(Control(0.0, 1.0), 0.0)
    assert unit.decide(0.0).brake == 1.0


def test_the_reflex_of_a_fast_kart_counts_on_less_than_its_brakes_promise() -> None:
    limits = Limits.of(KART_60)
    assert limits.braking == pytest.approx(0.7 * 0.75 * 9.81)
    assert limits.top_speed == pytest.approx(1.25 * 60.0 / 3.6)
