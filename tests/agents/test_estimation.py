"""Where a kart is: late fixes, ranges, wheels that slip, and a filter that knows how sure it is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_agents.plant.sensors import Sensors
from race_agents.plant.trip import Course, Trip, drive, follow
from race_agents.unit import motion
from race_agents.unit.ekf import KartFilter
from race_agents.unit.estimator import Estimator
from race_agents.unit.inertial import Inertial
from race_agents.unit.motion import DELAY, HEADING, SPEED, YAW_RATE, Agility, X, Y, drive_on
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.wheels import Wheels
from race_server.core.vehicle_presets import KART_60
from support.courses import ring

STEP = 0.02
# 95 % of chi-square sums of 3 and of 2 numbers in 40 runs lie between these, divided by 40.
NEES_BAND, NIS_BAND = (2.29, 3.80), (1.43, 2.67)


def runs(count: int, seconds: float) -> tuple[list[float], list[float]]:
    """Return NEES of (x, y, heading) and NIS of the last fix of karts that move as is assumed."""
    nees, nis = [], []
    noise = Agility(compliance_drift=0.0).noise(feels=True)
    for seed in range(count):
        chance = np.random.default_rng(seed)
        truth = np.zeros(motion.SIZE)
        truth[SPEED], truth[YAW_RATE] = 8.0, 0.5
        filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0)
        sure = np.diag([1.0, 1.0, 0.01, 0.25, 0.04, 1e-6, 0.01, 1e-8, 1e-12, 1e-6])
        filtered.covariance = sure
        filtered.state = truth + chance.multivariate_normal(np.zeros(motion.SIZE), sure)
        truth[DELAY] = filtered.state[DELAY]
        for turn in range(round(seconds / STEP)):
            half = 0.5 * STEP * noise
            truth = truth + chance.multivariate_normal(np.zeros(motion.SIZE), half)
            truth = drive_on(truth, STEP)
            truth = truth + chance.multivariate_normal(np.zeros(motion.SIZE), half)
            filtered.predict(STEP, push=(0.0, 0.0))
            wheels = (1.0 + truth[motion.SCALE]) * truth[SPEED]
            filtered.see_speed(wheels + chance.normal(0.0, 0.05), 0.05)
            gyro = truth[YAW_RATE] + truth[motion.BIAS]
            filtered.see_yaw_rate(gyro + chance.normal(0.0, 0.02), 0.02)
            if turn % 5 == 4:
                fix = truth[:2] + chance.normal(0.0, 0.1, 2)
                filtered.see_position(*fix, 0.1)
        off = filtered.state[:3] - truth[:3]
        off[2] = motion.wrap(off[2])
        nees.append(float(off @ np.linalg.solve(filtered.covariance[:3, :3], off)))
        nis.append(filtered.squares["position"])
    return nees, nis


def test_a_kart_that_moves_as_is_assumed_is_off_by_as_much_as_the_filter_says() -> None:
    nees, nis = runs(40, 4.0)
    assert NEES_BAND[0] < np.mean(nees) < NEES_BAND[1]
    assert NIS_BAND[0] < np.mean(nis) < NIS_BAND[1]


def test_a_kart_knows_its_place_no_better_than_its_first_fix_told_it() -> None:
    for told, known in ((5.0, 5.0), (0.02, 1.0)):  # in each of two directions
        estimator = Estimator(KART_60, Fix(0.0, 0.0, told), 0.0, 0.0)
        assert estimator.deviation == pytest.approx(math.sqrt(2.0) * known)


def trip(seconds: float, **sensors: float | bool) -> Trip:
    course = ring(radius=20.0, half_width=4.0)
    return drive(
        Course(course.line, course.borders),
        KART_60,
        replace(Sensors(), **sensors),  # type: ignore[arg-type]
        seconds=seconds,
        seed=3,
        grip_share=0.5,
    )


def test_fixes_100_ms_late_cost_nothing_where_their_stamp_is_used() -> None:
    late = trip(20.0)
    known = follow(late)
    ignored = follow(
        late,
        change=lambda given: replace(
            given, fix=given.fix and replace(given.fix, stamp_s=given.time_s)
        ),
    )
    assert np.sqrt(np.mean(known.off[500:] ** 2)) < 0.04
    assert np.sqrt(np.mean(ignored.off[500:] ** 2)) > 0.5  # about 10 m/s for 0.1 s
    assert known.refused == 0


def test_the_delay_of_fixes_without_a_stamp_is_found() -> None:
    # 200 ms, and 10 ms in the mean until the next reading.
    found = follow(trip(40.0, fix_stamped=False, fix_delay_s=0.2))
    assert found.delays[-1] == pytest.approx(0.21, abs=0.02)


def test_a_delay_of_300_ms_is_found_though_the_kart_drove_off_meanwhile() -> None:
    found = follow(trip(20.0, fix_stamped=False, fix_delay_s=0.3))
    assert found.delays[-1] == pytest.approx(0.31, abs=0.02)
    assert found.refused <= 3


def test_a_fix_of_a_kart_that_was_slower_then_tells_how_late_it_is_and_how_surely() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0, heading_deviation=0.01)
    filtered.covariance = np.diag([1e-6] * motion.SIZE)
    filtered.covariance[DELAY, DELAY] = 0.12**2
    filtered.state[[SPEED, DELAY]] = 3.96, 0.1
    filtered.predict(0.01, push=(4.0, 0.0))  # to 4 m/s
    # It is of 0.2 s before what it was taken for, when the kart was 0.8 m - 0.08 m back.
    assert filtered.see_position(filtered.state[X] - 0.72, 0.0, 0.001, lag=0.1)
    off = abs(float(filtered.state[DELAY]) - 0.3)
    assert off < 0.02
    assert 0.5 * off < math.sqrt(filtered.covariance[DELAY, DELAY]) < 2.0 * off


def test_a_fix_that_was_taken_for_newer_than_the_delay_says_by_now_tells_the_same() -> None:
    # The delay is 0.2 s; the filter is where the kart was 0.3 s ago, at 4 m/s and 4 m/s² more.
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0, heading_deviation=0.01)
    filtered.covariance = np.diag([1e-6] * motion.SIZE)
    filtered.covariance[DELAY, DELAY] = 0.12**2
    filtered.state[[SPEED, DELAY]] = 3.96, 0.1
    filtered.predict(0.01, push=(4.0, 0.0))
    on = 4.0 * 0.1 + 0.5 * 4.0 * 0.1**2
    assert filtered.see_position(filtered.state[X] + on, 0.0, 0.001, lag=0.3)
    assert filtered.state[DELAY] == pytest.approx(0.2, abs=0.005)


def test_a_range_by_a_detour_weighs_little_and_one_that_is_absurd_nothing() -> None:
    moved = []
    for excess in (0.1, 0.4, 3.0):
        filtered = KartFilter(10.0, 0.0, 0.0, lever=0.0, heading_deviation=0.01)
        filtered.covariance = np.diag([0.01, 0.01, *np.full(8, 1e-6)])
        believed = filtered.see_range(0.0, 0.0, 10.0 + excess, 0.1)
        moved.append(float(filtered.state[X]) - 10.0)
        assert believed == (excess < 1.0)
    # One deviation of 0.14 m moves by half of the excess; 0.4 m are 2.8 of them: less than half.
    assert moved[0] == pytest.approx(0.05)
    assert 0.05 < moved[1] < 0.15
    assert moved[2] == 0.0


def test_the_first_echo_does_not_carry_off_a_kart_that_is_not_sure_of_its_place() -> None:
    filtered = KartFilter(10.0, 0.0, 0.0, lever=0.0, heading_deviation=0.01)
    filtered.covariance = np.diag([1.0, 1.0, *np.full(8, 1e-6)])
    assert filtered.see_range(0.0, 0.0, 14.4, 0.1)
    # 4.4 m are over four deviations, and move it no farther than one and a half.
    assert filtered.state[X] == pytest.approx(11.5, abs=0.02)


def test_a_wrong_place_is_doubted_though_each_fifth_range_fits_it() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0, heading_deviation=0.01)
    filtered.covariance = np.diag([0.01, 0.01, *np.full(8, 1e-6)])
    for _ in range(100):
        for y in (-100.0, 100.0, -100.0, 100.0):
            filtered.see_range(0.0, y, abs(3.0 - y), 0.1)
        assert filtered.see_range(1000.0, 0.0, 1000.0, 0.1)
    assert filtered.state[Y] == pytest.approx(3.0, abs=0.05)


def test_ranges_to_three_beacons_find_a_place() -> None:
    filtered = KartFilter(1.0, 1.0, 0.0, lever=0.0)
    for _ in range(30):
        for x, y in ((0.0, 0.0), (20.0, 0.0), (0.0, 20.0)):
            filtered.see_range(x, y, math.hypot(2.0 - x, 1.5 - y), 0.1)
    assert filtered.state[[X, Y]] == pytest.approx([2.0, 1.5], abs=0.02)


def test_two_antennas_and_the_course_over_the_ground_tell_the_heading() -> None:
    for see in ("antennas", "course"):
        filtered = KartFilter(0.0, 0.0, 0.3, lever=0.4)
        filtered.state[SPEED] = 5.0
        for _ in range(20):
            if see == "antennas":
                filtered.see_heading(0.0, 0.01)
            else:
                filtered.see_velocity(5.0, 0.0, 0.1)
        assert filtered.state[HEADING] == pytest.approx(0.0, abs=0.03)


def test_antennas_that_go_wrong_for_good_never_turn_a_good_heading_over() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0, heading_deviation=0.02)
    assert not any(filtered.see_heading(1.0, 0.01) for _ in range(100))
    assert filtered.state[HEADING] == 0.0


def test_what_gyro_and_accelerometer_say_at_rest_is_their_error() -> None:
    inertial, chance = Inertial(), np.random.default_rng(1)
    for turn in range(100):
        felt = tuple(chance.normal((0.4, -0.2), 0.3).tolist())
        inertial.watch(0.0, 0.02, (felt[0], felt[1]), turn * STEP)
    assert inertial.rests
    assert inertial.bias == pytest.approx([0.4, -0.2], abs=0.1)
    inertial.miss(2.0)
    assert not inertial.rests  # nothing told so, for a moment
    inertial.watch(0.0, 0.02, (0.4, -0.2), 2.02)
    assert inertial.rests
    inertial.miss(2.1)  # 0.08 s: it may have driven off meanwhile
    inertial.watch(0.0, 0.02, (0.4, -0.2), 2.12)
    assert not inertial.rests
    inertial.watch(1.0, 0.02, (0.4, -0.2), 2.14)
    assert not inertial.rests


def test_a_message_of_the_bus_that_is_missing_does_not_take_a_bend_for_a_jolt() -> None:
    # 10 m/s, 0.6 rad/s: 6 m/s² across. Each tenth time nothing comes from wheels, gyro, steering.
    speed, rate, none = 10.0, 0.6, math.nan
    estimator = Estimator(
        KART_60, Fix(KART_60.rear_axle, 0.0, 0.02, heading=0.0), 0.0, 0.0, compliance=0.0
    )
    estimator.filter.state[[SPEED, YAW_RATE]] = speed, rate
    felt = -KART_60.rear_axle * rate**2, speed * rate
    steering = math.atan(rate * KART_60.wheelbase / speed)
    slides = []
    for turn in range(1, 201):
        told = (speed, rate, steering) if turn % 10 else (none, none, none)
        estimator.sense(Readings(0.01 * turn, *told, felt))
        slides.append(abs(float(estimator.state[motion.SLIDE])))
    assert max(slides[50:]) < 0.05


def test_a_gyro_that_speaks_again_tells_its_change_over_the_time_of_its_silence() -> None:
    # From 0 to 0.5 rad/s within 0.1 s in which it was silent: 5 rad/s², and not 50 for a moment.
    estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.02), 0.0, 0.0)
    for turn, rate in enumerate([0.0, *[math.nan] * 9, 0.5], start=1):
        tick = estimator._tick(Readings(0.01 * turn, 5.0, rate, math.nan, (0.0, 0.0)), 0.0)
        estimator._time_s = 0.01 * turn
        assert tick.felt is not None
        expected = -5.0 * KART_60.rear_axle if rate == 0.5 else 0.0
        assert tick.felt[1] == pytest.approx(expected, abs=1e-9)


def test_wheels_that_tell_a_metre_a_second_less_than_is_seen_are_not_used() -> None:
    for seen, is_used in ((0.0, True), (0.9, True), (1.1, False)):
        estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.02), 0.0, 0.0)
        tick = estimator._tick(Readings(0.01, 0.0, 0.0, 0.0), seen)
        assert (tick.wheel is not None) == is_used


def test_wheels_under_load_turn_faster_and_braked_ones_slower_than_the_kart_drives() -> None:
    # Tyres as stiff as ten times their load: under a pull of 1 g they slip by a tenth.
    for way in (1.0, -1.0):
        for rim, pull, speed in ((11.0, 9.81, 10.0), (9.0, -9.81, 10.0), (12.0, 0.0, 12.0)):
            told = Wheels.of(KART_60).trusted(way * rim, way * speed, way * pull, 0.0)
            assert told is not None
            assert told[0] == pytest.approx(way * speed)


def test_wheels_that_lock_are_not_believed_until_they_agree_again() -> None:
    wheels = Wheels.of(KART_60)
    told = []
    for turn in range(100):  # the kart slows down by 5 m/s²; from 0.4 to 1.0 s its wheels stand
        speed = 12.0 - 5.0 * turn * STEP
        rim = 0.0 if 20 <= turn < 50 else speed
        told.append(wheels.trusted(rim, speed, -5.0, turn * STEP) is not None)
    assert all(told[:20])
    assert not any(told[20:54])
    assert all(told[62:])


def test_wheels_that_lock_after_the_clock_was_set_back_are_noticed() -> None:
    wheels = Wheels.of(KART_60)
    for turn in range(50):
        assert wheels.trusted(12.0, 12.0, 0.0, 5000.0 + turn * STEP) is not None
    for turn in range(50):
        assert wheels.trusted(12.0, 12.0, 0.0, 1400.0 + turn * STEP) is not None
    told = [wheels.trusted(0.0, 12.0, -5.0, 1401.0 + turn * STEP) for turn in range(5)]
    assert None in told
    # Nor are they lost for ever where they were lost before it.
    again = [wheels.trusted(12.0, 12.0, 0.0, 100.0 + turn * STEP) for turn in range(10)]
    assert again[-1] is not None


def test_a_kart_with_locked_wheels_keeps_its_place_by_what_it_feels() -> None:
    slides = follow(trip(20.0, wheels_lock=0.2))
    assert np.quantile(slides.off[500:], 0.99) < 0.15
    assert slides.refused <= 0.05 * slides.fixes


def test_ten_seconds_without_fixes_end_within_twice_of_what_is_told() -> None:
    lost = follow(
        trip(32.0),
        change=lambda given: replace(given, fix=given.fix if given.time_s < 20.0 else None),
    )
    place = int(np.searchsorted(lost.times, 30.0))
    assert lost.off[place] < 2.0 * lost.deviations[place]
    assert lost.deviations[place] < 4.0
