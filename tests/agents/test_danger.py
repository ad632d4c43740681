"""What a kart makes of its echoes: objects, how dangerous they are, and when it brakes."""

import math
from collections.abc import Sequence
from dataclasses import asdict, fields
from functools import partial

import numpy as np
import pytest

from race_agents.plant.encounter import ADULT, KMH, WALKS, Case, meet
from race_agents.plant.moves import crosses, goes_ahead
from race_agents.plant.radar import ERRS
from race_agents.plant.sensors import Sensors
from race_agents.unit.danger import assess, danger_of, watch_danger, worst_ahead
from race_agents.unit.drift import Arcs, Drift
from race_agents.unit.ego import Ego, EgoMotion
from race_agents.unit.limits import Limits
from race_agents.unit.objects import Objects
from race_agents.unit.safety import STOP_FOR_OBSTACLE, Echoes, Verdict
from race_agents.unit.track import Track, correct
from race_server.core import codes
from race_server.core.alert import Advice, Danger, DangerStage
from race_server.core.vehicle_presets import KART_60

LIMITS = Limits.of(KART_60)
SCAN_S = 0.05


def echo(x: float, y: float, closing: float, kind: int = codes.PERSON) -> Echoes:
    return Echoes(np.array([x]), np.array([y]), np.array([closing]), np.array([kind], np.uint8))


def looked(scans: list[Echoes], speed: float = 10.0) -> Objects:
    """Return what is there after scans of a kart that drives straight on."""
    objects = Objects()
    for scan in scans:
        objects.look(scan, Ego(speed * SCAN_S, 0.0, 0.0, speed), SCAN_S)
    return objects


def test_a_track_in_another_frame_is_the_same_thing() -> None:
    numbers = dict(zip((each.name for each in fields(Track)), range(12), strict=False))
    there = Track(**numbers).with_motion(np.ones(4), np.eye(4), numbers["eye"])
    assert {**asdict(there), "state": 0, "covariance": 1} == numbers


def test_an_echo_that_nothing_confirms_is_no_object() -> None:
    stray = looked([echo(10.0, 0.0, 10.0)])
    assert len(stray.seen.x) == 0
    # Half a metre nearer after a twentieth of a second at 10 m/s: the same thing.
    again = looked([echo(10.0, 0.0, 10.0), echo(9.5, 0.0, 10.0)])
    assert len(again.seen.x) == 1
    elsewhere = looked([echo(10.0, 0.0, 10.0), echo(7.0, 2.0, 10.0)])
    assert len(elsewhere.seen.x) == 0


def test_a_track_finds_how_somebody_walks() -> None:
    # Two metres to the right, 1.5 m/s to the left, 30 m ahead of a kart at 10 m/s.
    scans = []
    for turn in range(20):
        x, y = 30.0 - 0.5 * turn, -2.0 + 1.5 * SCAN_S * turn
        far = math.hypot(x, y)
        scans.append(echo(x, y, (10.0 * x - 1.5 * y) / far))
    (track,) = looked(scans).tracks
    assert track.velocity == pytest.approx((0.0, 1.5), abs=0.3)
    assert track.state[:2] == pytest.approx((20.5, -0.575), abs=0.2)


def test_a_child_that_comes_from_behind_a_parked_kart_is_not_the_kart() -> None:
    # The kart is seen five times, and then not, while the child 0.7 m beside it is.
    scans = [echo(8.0 - 0.5 * turn, -1.7, 9.8, codes.KART_HIT) for turn in range(5)]
    scans += [echo(5.5 - 0.5 * turn, -1.0, 9.8) for turn in range(4)]
    assert {track.kind for track in looked(scans).tracks} == {codes.KART_HIT, codes.PERSON}


def test_a_track_is_gone_after_six_scans_without_it() -> None:
    seen = [echo(10.0 - 0.5 * turn, 0.0, 10.0) for turn in range(5)]
    assert len(looked(seen + [Echoes.nothing()] * 5).tracks) == 1
    assert looked(seen + [Echoes.nothing()] * 6).tracks == []


def test_an_echo_of_a_wall_taken_for_a_person_stays_a_wall() -> None:
    def wall(kind: int) -> Echoes:
        y = np.arange(-2.0, 2.1, 0.5)
        kinds = np.full(len(y), codes.BORDER, np.uint8)
        kinds[4] = kind
        return Echoes(np.full(len(y), 10.0), y, np.zeros(len(y)), kinds)

    objects = looked([wall(codes.BORDER), wall(codes.BORDER), wall(codes.PERSON)], speed=0.0)
    assert set(objects.seen.kinds.tolist()) == {codes.BORDER}


@pytest.mark.parametrize(("runs", "kinds"), [(4.0, {codes.KART_HIT}), (2.0, None)])
def test_what_drives_with_a_kart_around_it_is_of_that_kart(
    runs: float, kinds: set[int] | None
) -> None:
    # Two of three scans take one echo in the middle of a kart's back for a person, which could be
    # one who comes from behind it; but no person runs at 4 m/s with it.
    def back(kind: int) -> Echoes:
        y = np.arange(-0.4, 0.5, 0.1)
        found = np.full(len(y), codes.KART_HIT, np.uint8)
        found[4] = kind
        return Echoes(np.full(len(y), 6.0), y, np.full(len(y), 10.0 - runs), found)

    objects = looked([back(codes.KART_HIT), back(codes.PERSON), back(codes.PERSON)])
    seen = set(objects.seen.kinds.tolist())
    assert seen == (kinds or {codes.KART_HIT, codes.PERSON})


def test_the_way_since_the_last_scan_adds_up() -> None:
    motion = EgoMotion()
    for _ in range(50):  # a quarter of a circle of radius 10 m
        motion.advance(math.pi * 5.0, 0.0, 0.5 * math.pi, 0.02)
    ego = motion.take(5.0, 0.0)
    assert (ego.ahead, ego.left) == pytest.approx((10.0, 10.0), abs=0.02)
    assert motion.take(5.0, 0.0).ahead == 0.0


def track_at(
    x: float, y: float, vx: float = 0.0, vy: float = 0.0, kind: int = codes.PERSON
) -> Track:
    """Return something that is well known, `x` [m] ahead of the bumper."""
    state = np.array([x + LIMITS.nose, y, vx, vy])
    return Track(state, 1e-4 * np.eye(4), kind, 0.2, scans=20, began=60.0)


@pytest.mark.parametrize(
    ("distance", "stage"),
    [
        (60.0, DangerStage.NONE),
        (34.0, DangerStage.INFORM),
        (24.0, DangerStage.WARN),
        (11.0, DangerStage.FULL),
    ],
)
def test_a_danger_comes_in_stages(distance: float, stage: DangerStage) -> None:
    # 10 m/s and 5.15 m/s²: 9.7 m to stop, 2 m of reaction, half a metre to stand off.
    assert danger_of(track_at(distance, 0.0), 10.0, 0.0, LIMITS).stage is stage


def test_who_will_have_left_the_way_is_no_danger_and_who_walks_into_it_is_one() -> None:
    # At 10 m/s the kart is there in 1.5 s: who walks 1.5 m/s is 2.2 m farther by then.
    leaves = danger_of(track_at(15.0, 1.3, vy=1.5), 10.0, 0.0, LIMITS)
    enters = danger_of(track_at(15.0, -2.2, vy=1.5), 10.0, 0.0, LIMITS)
    assert leaves.stage is DangerStage.NONE
    assert enters.stage >= DangerStage.WARN


@pytest.mark.parametrize(
    ("vy", "unsure", "stage"),
    [(-1.5, 0.5, DangerStage.WARN), (-1.5, 0.1, DangerStage.NONE), (1.5, 0.5, DangerStage.NONE)],
)
def test_who_may_walk_faster_than_it_seems_is_warned_of_but_not_braked_for(
    vy: float, unsure: float, stage: DangerStage
) -> None:
    # The kart passes within 1.2 s, when who seems to walk 1.5 m/s is 0.9 m beside its corridor. A
    # berth of 0.45 m and 0.6 m that it may have walked more reach that; 0.1 m more do not.
    track = track_at(10.0, 2.7 + LIMITS.half_width, vy=vy)
    track.covariance = np.diag([0.0, 0.0, 0.5 * unsure**2, 0.5 * unsure**2])
    assert danger_of(track, 10.0, 0.0, LIMITS).stage is stage


def test_a_kart_ahead_that_brakes_hard_is_braked_for_before_it_is_close() -> None:
    ahead = track_at(3.0, 0.0, vx=10.0, kind=codes.KART_HIT)
    assert danger_of(ahead, 10.0, 0.0, LIMITS).stage is DangerStage.NONE
    ahead.state[2], ahead.slowing = 8.0, 6.0
    assert danger_of(ahead, 10.0, 0.0, LIMITS).stage is DangerStage.FULL


@pytest.mark.parametrize("closing", [2.0, 4.0, 8.0])
def test_who_closes_in_on_a_kart_that_drives_is_warned_a_second_before_full_brakes(
    closing: float,
) -> None:
    def reached(stage: DangerStage) -> float:
        """Return from how far behind on a danger is of a stage [m]."""
        behind = (0.01 * number for number in range(3000, 0, -1))
        drives = partial(track_at, y=0.0, vx=12.0 - closing, kind=codes.KART_HIT)
        return next(x for x in behind if danger_of(drives(x), 12.0, 0.0, LIMITS).stage >= stage)

    warned_s = (reached(DangerStage.WARN) - reached(DangerStage.FULL)) / closing
    assert warned_s == pytest.approx(0.95, abs=0.01)


def test_for_a_driver_who_brakes_already_no_way_is_lost_until_brakes_bite() -> None:
    # 2 m/s faster than the kart 1.2 m ahead, to which 0.6 m are kept: 0.4 m pass until brakes bite.
    ahead = track_at(1.2, 0.0, vx=8.0, kind=codes.KART_HIT)
    idle, brakes = (assess([ahead], 10.0, 0.0, 0.0, LIMITS, braking=by) for by in (0.0, 6.0))
    assert (idle.stage, idle.needed) == (DangerStage.FULL, pytest.approx(2.0**2 / (2.0 * 0.2)))
    # At 6 m/s² he is 0.8 m/s faster after 0.28 m of the 0.6 m.
    assert brakes.stage < DangerStage.EASE
    assert brakes.needed == pytest.approx(0.8**2 / (2.0 * 0.32))


@pytest.mark.parametrize(
    ("missed", "stage"), [(0, DangerStage.FULL), (2, DangerStage.FULL), (3, DangerStage.EASE)]
)
def test_a_kart_that_three_scans_did_not_show_is_not_braked_fully_for(
    missed: int, stage: DangerStage
) -> None:
    across = track_at(6.0, 0.0, kind=codes.KART_HIT)
    across.missed = missed
    assert assess([across], 10.0, 0.0, 0.0, LIMITS).stage is stage


def test_a_kart_that_is_passed_and_drives_into_the_flank_is_not_braked_fully_for() -> None:
    # 7 m/s slower, a metre before the bumper and 1.6 m to the left, it comes over at 2.5 m/s: after
    # 0.4 s it is 1.8 m behind the bumper. One that is 5 m ahead would be met by the bumper.
    flank = danger_of(track_at(1.0, 1.6, 9.0, -2.5, kind=codes.KART_HIT), 16.0, 0.0, LIMITS)
    front = danger_of(track_at(5.0, 1.6, 9.0, -2.5, kind=codes.KART_HIT), 16.0, 0.0, LIMITS)
    assert flank.stage is DangerStage.EASE
    assert front.stage is DangerStage.FULL


@pytest.mark.parametrize(("over", "stage"), [(0.6, DangerStage.EASE), (1.6, DangerStage.FULL)])
def test_a_kart_beside_that_drifts_over_keeps_its_lane_and_one_that_comes_over_does_not(
    over: float, stage: DangerStage
) -> None:
    # 2 m/s slower, 1.1 m before the bumper: it is met at the flank, after more than a second.
    beside = track_at(1.1, 0.6 + 1.3 * over, 12.0, -over, kind=codes.KART_HIT)
    assert danger_of(beside, 14.0, 0.0, LIMITS).stage is stage


@pytest.mark.parametrize(
    ("place", "velocity", "speed"),
    [
        # It comes over at 1.5 m/s: 1.2 m/s less, and it stays 0.4 m beside the way until passed.
        ((4.0, -1.3), (9.0, 1.5), 16.0),
        # It crosses at 2.7 m/s, 2 m ahead: 1.2 m/s more, and it is through before it is met.
        ((2.0, -1.1), (5.1, 2.7), 8.5),
    ],
)
def test_a_kart_beside_that_may_be_slower_or_faster_than_it_seems_may_not_be_met(
    place: tuple[float, float], velocity: tuple[float, float], speed: float
) -> None:
    beside = track_at(*place, *velocity, kind=codes.KART_HIT)
    assert danger_of(beside, speed, 0.0, LIMITS).stage is DangerStage.FULL
    beside.covariance[3, 3] = 1.2**2
    assert danger_of(beside, speed, 0.0, LIMITS).stage is DangerStage.EASE


@pytest.mark.parametrize("over", [2.5, 3.0, 3.5])
def test_a_kart_that_cuts_in_is_braked_fully_for_though_its_speed_is_not_known_well(
    over: float,
) -> None:
    # 5 m/s slower, 3 m before the bumper and half a metre clear of it: in at most 0.6 s.
    cuts_in = track_at(3.0, 0.7 + 0.25 * over, 8.0, -over, kind=codes.KART_HIT)
    cuts_in.covariance[3, 3] = 1.2**2
    assert danger_of(cuts_in, 13.0, 0.0, LIMITS).stage is DangerStage.FULL


def test_a_kart_that_crosses_is_braked_fully_for_though_its_speed_is_not_known_well() -> None:
    # It comes out 4 m beside the way at 20 km/h: 1.2 m/s less, and the kart would be past it.
    across = track_at(6.0, -4.0, 0.0, 5.5, kind=codes.KART_HIT)
    across.covariance[3, 3] = 1.2**2
    assert danger_of(across, 8.0, 0.0, LIMITS).stage is DangerStage.FULL


@pytest.mark.parametrize("speed", [8.0, 14.0, 18.0, 30.0])
def test_a_kart_that_stands_straight_ahead_is_braked_for_at_each_distance(speed: float) -> None:
    # As soon as the way to stop is not longer than what is left, and until the bumper touches it.
    way = 0.2 * speed + speed**2 / (2.0 * LIMITS.braking)
    near = np.arange(1.0, way, 0.07)
    stages = {
        assess([track_at(x, 0.1, kind=codes.KART_HIT)], speed, 0.0, 0.0, LIMITS).stage for x in near
    }
    assert stages == {DangerStage.FULL}


def test_how_a_kart_moves_that_was_hit_is_not_known() -> None:
    for told, is_known in ((9.6, True), (1.0, False)):
        track = track_at(10.0, 4.0, 10.0, -1.0, kind=codes.KART_HIT)
        x, y = track.state[:2]
        ray = np.array([x, y]) / math.hypot(x, y)
        correct(track, track.state[:2].copy(), ray, told * ray[0])
        across = track.velocity[0] * -ray[1] + track.velocity[1] * ray[0]
        assert (abs(across) > 1.0) == is_known


def slowing_after(speeds: Sequence[float]) -> float:
    """Return by how much a kart straight ahead slows down that is seen at these speeds [m/s]."""
    places, kinds = np.array([-0.3, 0.0, 0.3]), np.full(3, codes.KART_HIT, np.uint8)
    ways = 10.0 + SCAN_S * np.cumsum(speeds)
    scans = [
        Echoes(np.full(3, way), places, np.full(3, -speed), kinds)
        for way, speed in zip(ways, speeds, strict=True)
    ]
    (track,) = looked(scans, speed=0.0).tracks
    return track.slowing


def test_a_kart_that_is_hit_slows_down_at_once_and_no_more() -> None:
    braking = [10.0] * 10 + [10.0 - 0.3 * number for number in range(1, 9)]  # 6 m/s²
    hit = [10.0] * 10 + [5.0, 5.0]
    assert slowing_after(braking) == pytest.approx(6.0, abs=1.5)
    assert slowing_after(hit) < 2.0


@pytest.mark.parametrize(("slide", "stage"), [(0.5, DangerStage.FULL), (2.5, DangerStage.NONE)])
def test_a_kart_that_slides_round_a_bend_does_not_go_where_its_front_wheels_point(
    slide: float, stage: DangerStage
) -> None:
    # 15 m ahead at 13 m/s, on the straight way that its steering asks for; it turns with a radius
    # of 25 m, and a rear axle that moves aside by 2.5 m/s, or 11 degrees, turns it.
    drift = Drift.of(13.0, slide, -13.0 / 25.0, LIMITS)
    post = echo(15.0 + LIMITS.nose, 1.0, 13.0, codes.OBSTACLE)
    danger = worst_ahead([], post, Arcs(13.0, -1.0 / 25.0, 0.0, drift), LIMITS)
    assert danger.stage is stage


def test_a_kart_in_a_bend_beside_does_not_slow_down() -> None:
    # 5 m ahead and 2.5 m to the right at 14 m/s; its tyres pull it to the left by 5 m/s², 2.2 m/s²
    # of which are along the ray.
    beside = track_at(5.0 - LIMITS.nose, -2.5, vx=14.0, kind=codes.KART_HIT)
    ray = np.array([5.0, -2.5]) / math.hypot(5.0, 2.5)
    for _ in range(20):
        beside.slow_down(ray, 5.0 * 2.5 / math.hypot(5.0, 2.5))
    assert beside.slowing == pytest.approx(0.0, abs=0.01)
    # Straight ahead it is all slowing.
    ahead = track_at(5.0, 0.0, vx=14.0, kind=codes.KART_HIT)
    for _ in range(20):
        ahead.slow_down(np.array([1.0, 0.0]), 5.0)
    assert ahead.slowing == pytest.approx(5.0, abs=0.1)


def test_a_kart_that_has_braked_and_drives_on_slows_down_no_more() -> None:
    ahead = track_at(5.0, 0.0, vx=14.0, kind=codes.KART_HIT)
    for less in (8.0, 8.0, 8.0, 8.0, 0.0, 0.0):
        ahead.slow_down(np.array([1.0, 0.0]), less)
    # A quarter of what the last two scans took away is left of 7.5 m/s².
    assert ahead.slowing == pytest.approx(0.25 * 7.5)


def test_the_bearing_is_to_the_left_where_somebody_stands_left() -> None:
    danger = danger_of(track_at(10.0, 1.0), 10.0, 0.0, LIMITS)
    assert danger.bearing == pytest.approx(0.1, abs=0.01)
    assert danger.distance == pytest.approx(10.0, abs=0.3)
    assert danger.advice is Advice.BRAKE


def test_only_the_last_stage_brakes_fully() -> None:
    assert watch_danger(Danger(DangerStage.WARN)) == Verdict()
    assert watch_danger(Danger(DangerStage.EASE)).motor == 0.0
    assert watch_danger(Danger(DangerStage.FULL)) == STOP_FOR_OBSTACLE


@pytest.mark.parametrize("speed", [20.0, 50.0])
def test_with_a_radar_that_errs_a_kart_stops_for_who_crosses(speed: float) -> None:
    walks = partial(crosses, pace=WALKS, side=-1.0, at=0.0, x=ADULT)
    outcome = meet(Case("crosses", speed * KMH, walks), KART_60, Sensors(radar=ERRS), 1)
    assert outcome.impact is None
    assert outcome.lead_s > 0.8


@pytest.mark.parametrize("built", [1, 4])  # one reading of the second's gyro bent its arc
def test_with_a_radar_that_errs_a_kart_passes_who_stands_a_metre_beside_its_way(built: int) -> None:
    stands = partial(goes_ahead, pace=0.0, at=0.65 + 1.0 + ADULT, x=0.0)
    outcome = meet(Case("beside", 50 * KMH, stands), KART_60, Sensors(radar=ERRS), built)
    assert outcome.braked_s == math.inf
    assert outcome.least_gap == pytest.approx(1.0, abs=0.05)
