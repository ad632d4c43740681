"""What a tracker believes of a real kart: poses, gates, clock, orders."""

import math
from dataclasses import replace

import pytest

from race_server.core.link_clock import LinkClock
from race_server.core.messages import (
    Pose,
    PoseFault,
    Trust,
)
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.session.tracked.orders import Orders
from race_server.session.tracked.plausibility import PlausibilityLimits, doubt_of, is_jump, predict
from race_server.session.tracked.tracker import Tracker

GATES = PlausibilityLimits.of(TT02)


def test_a_kart_that_goes_straight_is_two_metres_on_after_half_a_second_at_four() -> None:
    later = predict(Pose(0, 1.0, 2.0, math.pi / 2, 4.0), 0.5)
    assert (later.x, later.y) == pytest.approx((1.0, 4.0))


def test_a_kart_that_turns_drives_an_arc() -> None:
    # A quarter of a circle of radius 2 m: 1 rad/s at 2 m/s for pi/2 s.
    later = predict(Pose(0, 0.0, 0.0, 0.0, 2.0, yaw_rate=1.0), math.pi / 2)
    assert (later.x, later.y, later.heading) == pytest.approx((2.0, 2.0, math.pi / 2))


def test_a_slow_turn_is_nearly_straight() -> None:
    straight, bent = (predict(Pose(0, 0, 0, 0, 5.0, yaw_rate=w), 1.0) for w in (0.9e-4, 1.1e-4))
    assert math.hypot(straight.x - bent.x, straight.y - bent.y) < 1e-3


@pytest.mark.parametrize(
    ("pose", "age_s", "inside", "doubt"),
    [
        (Pose(0, 0, 0, 0, 5.0), 0.09, True, PoseFault.NONE),
        (Pose(0, 0, 0, 0, 5.0), 0.5, True, PoseFault.STALE),
        (Pose(0, 0, 0, 0, 14.0), 0.0, True, PoseFault.SPEED),  # 36 km/h are 10 m/s
        (Pose(0, 0, 0, 0, -3.0), 0.0, True, PoseFault.SPEED),
        (Pose(0, 0, 0, 0, 5.0), 0.0, False, PoseFault.OFF_WORLD),
        (Pose(0, 0, 0, 0, 5.0, quality=0.1), 0.0, True, PoseFault.POOR),
        (Pose(0, 0, 0, 0, 5.0, deviation=0.5), 0.0, True, PoseFault.POOR),
    ],
)
def test_what_speaks_against_a_pose(
    pose: Pose, age_s: float, inside: bool, doubt: PoseFault
) -> None:
    assert doubt_of(pose, age_s, GATES, is_inside=inside) is doubt


def test_a_kart_may_miss_its_prediction_by_half_a_length_but_not_by_ten() -> None:
    gates, before = PlausibilityLimits.of(KART_60), Pose(0, 0.0, 0.0, 0.0, 10.0)
    assert not is_jump(before, Pose(0, 1.0 + 0.9, 0.0, 0.0, 10.0), 0.1, gates)
    assert is_jump(before, Pose(0, 1.0 + 10.0, 0.0, 0.0, 10.0), 0.1, gates)


def test_time_that_runs_backwards_is_a_jump() -> None:
    assert is_jump(Pose(0, 0, 0, 0, 0), Pose(0, 0, 0, 0, 0), -0.1, GATES)


def test_the_clock_takes_the_quickest_message_and_half_of_its_round_trip() -> None:
    clock = LinkClock()
    # The kart's clock is 5 s behind ours; messages take 90, 120 and 95 ms.
    for sent_us, delay_us in ((0, 90_000), (100_000, 120_000), (200_000, 95_000)):
        arrived_us = 5_000_000 + sent_us + delay_us
        clock.record(sent_us, arrived_us, echo_us=arrived_us - 2 * delay_us)
    assert clock.delay_us == 90_000
    assert clock.offset_us == 5_000_000


def test_a_kart_that_echoes_nothing_is_as_late_as_assumed() -> None:
    clock = LinkClock(assumed_s=0.09)
    clock.record(0, 190_000)
    assert clock.offset_us == 100_000


def test_a_clock_that_was_set_anew_is_measured_anew() -> None:
    clock = LinkClock()
    clock.record(60_000_000, 61_000_000)
    clock.record(0, 61_020_000)
    assert clock.offset_us == 61_020_000


@pytest.mark.parametrize("step_s", [-1.0, -0.2, 0.2, 1.0])
def test_a_clock_that_steps_by_less_than_two_seconds_is_known_after_five_messages(
    step_s: float,
) -> None:
    # 50 messages a second that take 20 ms each way; after 10 s the kart's clock steps.
    clock, step_us = LinkClock(), round(step_s * 1e6)
    for number in range(505):
        sent_us = 20_000 * number
        arrived_us = sent_us + 20_000
        stamp_us = sent_us + (step_us if number >= 500 else 0)
        clock.record(1_000_000 + stamp_us, 1_000_000 + arrived_us, 1_000_000 + sent_us - 20_000)
        assert clock.offset_us == (0 if number < 504 else -step_us)


def test_a_link_on_which_messages_wait_is_no_clock_that_was_set() -> None:
    # From 20 ms each way to 0.6 s up and 20 ms down: longer, but no longer than the round trip.
    clock = LinkClock()
    for number in range(600):
        up_us = 600_000 if number >= 500 else 20_000
        sent_us = 1_000_000 + 20_000 * number
        clock.record(sent_us, sent_us + up_us, sent_us - 20_000)
        assert clock.offset_us == 0


def test_orders_stay_open_until_the_newest_is_acknowledged() -> None:
    orders = Orders()
    orders.change((3.0,), 0)
    orders.change((3.0,), 100)
    orders.change((1.0,), 200)
    assert (orders.sequence, orders.is_open) == (2, True)
    orders.acknowledge(1, 300)
    assert orders.is_open
    orders.acknowledge(2, 400)
    assert not orders.is_open
    orders.acknowledge(7, 500)  # never given
    assert orders.acknowledged == 2


def test_orders_that_nobody_hears_are_noticed() -> None:
    orders = Orders()
    orders.change((3.0,), 0)
    assert not orders.is_unheard(1_000_000)
    assert orders.is_unheard(1_600_000)


def standing(tracker: Tracker, first_s: float, last_s: float, **where: float) -> None:
    """Let poses of a standing kart arrive, fifty a second."""
    for turn in range(round(first_s * 50), round(last_s * 50)):
        now_us = turn * 20_000
        pose = replace(Pose(now_us, 0.0, 0.0, 0.0, 0.0), **where)
        tracker.receive(pose, now_us, is_inside=True)
        tracker.follow(now_us)


def test_a_kart_is_believed_after_some_poses_that_agree() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 0.2)
    assert tracker.trust is Trust.SIMULATED
    standing(tracker, 0.2, 0.3)
    assert tracker.trust is Trust.TRUSTED


def test_one_pose_that_jumps_is_dropped_and_nothing_else_happens() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 1.0)
    assert tracker.receive(Pose(1_000_000, 30.0, 0.0, 0.0, 0.0), 1_000_000, is_inside=True) is (
        PoseFault.JUMP
    )
    standing(tracker, 1.02, 1.5)
    assert tracker.trust is Trust.TRUSTED
    assert tracker.refused == {PoseFault.JUMP: 1}
    pose = tracker.pose_at(1_500_000)
    assert pose is not None
    assert pose.x == 0.0


def test_silence_makes_a_kart_doubtful_then_parks_it_then_ends_its_race() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 1.0)
    seen = []
    for tenth in range(10, 300):
        tracker.follow(tenth * 100_000)
        seen.append(tracker.trust)
    assert seen[0] is Trust.TRUSTED
    first = {trust: seen.index(trust) / 10 + 1.0 for trust in set(seen)}
    assert first[Trust.DOUBTFUL] == pytest.approx(1.4, abs=0.11)
    assert first[Trust.SUSPENDED] == pytest.approx(3.5, abs=0.11)
    assert first[Trust.OUT] == pytest.approx(23.6, abs=0.11)
    assert tracker.doubt is PoseFault.SILENT


def test_at_the_start_a_kart_has_until_the_lights_go_out_to_be_heard() -> None:
    tracker = Tracker(GATES).at_start(Pose(0, 0.0, 0.0, 0.0, 0.0), 0, lights_s=3.0)
    tracker.follow(2_900_000)
    assert tracker.trust is Trust.SIMULATED
    tracker.follow(3_100_000)
    assert tracker.trust is Trust.DOUBTFUL


def test_a_kart_whose_race_is_over_may_leave() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 1.0)
    for second in range(1, 40):
        tracker.follow(second * 1_000_000, is_racing=False)
    assert tracker.trust is Trust.TRUSTED


def test_poses_that_all_come_late_are_named_as_what_they_are() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 1.0)
    tracker.receive(Pose(1_000_000, 0.0, 0.0, 0.0, 0.0), 1_380_000, is_inside=True)
    tracker.follow(1_450_000)
    assert (tracker.trust, tracker.doubt) == (Trust.DOUBTFUL, PoseFault.STALE)


def test_a_kart_comes_back_elsewhere_once_its_poses_agree_for_a_while() -> None:
    tracker = Tracker(GATES)
    standing(tracker, 0.0, 1.0)
    standing(tracker, 1.0, 1.36, x=5.0)
    assert tracker.trust is Trust.TRUSTED  # still bridged
    standing(tracker, 1.36, 1.5, x=5.0)
    assert tracker.trust is Trust.TRUSTED  # believed at the new place, in doubt for one tick only
    pose = tracker.pose_at(1_500_000)
    assert pose is not None
    assert pose.x == 5.0
