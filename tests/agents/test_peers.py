"""Other karts tell where they are: what a kart makes of it, and what it never does."""

import math
import random
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest

from race_agents.onboard.peers import Peers, peer_of
from race_agents.plant.encounter import FreeRun, OpenPlace
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.danger import danger_of
from race_agents.unit.fence import CourseFence
from race_agents.unit.limits import Limits
from race_agents.unit.peers import MOST_PEERS, Whereabouts, tracks_of
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.records import MOST_TOLD, Report
from race_agents.unit.safety import Echoes
from race_server.core import codes
from race_server.core.alert import DangerStage
from race_server.core.messages import Control, Pose
from race_server.core.peer import Peer
from race_server.core.vehicle_presets import KART_60
from race_server.net.wire.peer import PeerFrame, decode_peer, encode_peer
from support.courses import ring

NOW_S = 20.0
OWN = Whereabouts(0.0, 0.0, 0.0, 0.02, 0.0, NOW_S)
# It stands 20 m ahead, along the same way.
AHEAD = Peer(round(1e6 * NOW_S), 20.0, 0.0, 0.0, 0.0, deviation=0.0, length=2.0, width=1.2)


def driving(speed: float, echoes: list[Echoes] | None = None) -> tuple[ControlUnit, float]:
    """Return a unit that drives east from the origin, and the time; echoes: its scans."""
    unit, now_s = ControlUnit.of(KART_60, OpenPlace()), 0.0
    scans = echoes if echoes is not None else [Echoes.nothing()]
    turns = 25
    for turn in range(turns):
        now_s = NOW_S + 0.05 * (turn - turns)
        behind = speed * 0.05 * (turn - turns)
        scan = scans[min(max(turn - turns + len(scans), 0), len(scans) - 1)]
        fix = Fix(behind + KART_60.rear_axle, 0.0, 0.02, stamp_s=now_s)
        noise = 1e-4 * (turn % 7)  # a sensor that repeats itself has failed
        unit.sense(Readings(now_s, speed + noise, noise, noise, None, fix, scan))
        unit.hear(FreeRun(), now_s)
        unit.drive(Control(0.0, 1.0), now_s)
        unit.decide(now_s)
    return unit, now_s


def at(now_s: float, **told: float) -> Peer:
    """Return what a kart tells now."""
    return replace(AHEAD, stamp_us=round(1e6 * now_s), **told)


# What counts


def test_a_kart_that_tells_makes_a_track_of_its_rear_its_middle_and_its_front() -> None:
    tracks = tracks_of([AHEAD], OWN, OpenPlace(), 0.7)
    # Its body is 2 m long, and each place is 2 cm nearer: this kart knows its own to 2 cm.
    assert [float(track.state[0]) for track in tracks] == pytest.approx([18.98, 19.98, 20.98])
    assert {track.kind for track in tracks} == {codes.KART_HIT}


def test_a_message_is_moved_on_by_its_age() -> None:
    drives = replace(AHEAD, stamp_us=round(1e6 * (NOW_S - 0.1)), speed=10.0, heading=0.5 * math.pi)
    middle = tracks_of([drives], OWN, OpenPlace(), 0.7)[1]
    # A metre north in a tenth of a second, and nearer by what it may have changed meanwhile, and by
    # half its width, 0.6 m, since it comes across.
    assert middle.state[:2] == pytest.approx((19.4, 0.97), abs=0.05)
    assert middle.velocity == pytest.approx((0.0, 10.0), abs=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        {"stamp_us": round(1e6 * (NOW_S - 0.6))},  # old
        {"stamp_us": round(1e6 * (NOW_S + 0.1))},  # of the future
        {"x": math.nan},
        {"speed": math.inf},
        {"deviation": 0.8},  # it does not know on which side of the way it is
    ],
)
def test_what_is_old_of_the_future_no_number_or_too_unsure_is_ignored(
    wrong: dict[str, float],
) -> None:
    assert tracks_of([replace(AHEAD, **wrong)], OWN, OpenPlace(), 0.7) == []  # type: ignore[arg-type]


def test_a_kart_far_outside_of_the_course_is_in_nobodys_way() -> None:
    course = ring(radius=12.0, half_width=3.0)
    fence = CourseFence.of(course.line, course.half_widths, course.kerb, course.borders)
    x, y = (float(value) for value in course.line[0, :2])
    outward = math.atan2(y, x)
    for far, count in ((4.0, 3), (15.0, 0)):
        told = replace(AHEAD, x=x + far * math.cos(outward), y=y + far * math.sin(outward))
        assert len(tracks_of([told], OWN, fence, 0.7)) == count, far


def test_of_a_flood_of_peers_the_nearest_count() -> None:
    flood = [replace(AHEAD, x=10.0 + number) for number in range(500)]
    tracks = tracks_of(reversed(flood), OWN, OpenPlace(), 0.7)
    assert len(tracks) == 3 * MOST_PEERS
    assert max(float(track.state[0]) for track in tracks) < 10.0 + MOST_PEERS + 1.0


def test_a_kart_behind_costs_no_time() -> None:
    assert tracks_of([replace(AHEAD, x=-6.0, speed=30.0)], OWN, OpenPlace(), 0.7) == []
    assert len(tracks_of([replace(AHEAD, x=-6.0, y=6.0)], OWN, OpenPlace(), 0.7)) == 3


def test_a_kart_that_stands_ahead_and_tells_so_is_braked_for_without_any_echo() -> None:
    unit, now_s = driving(10.0)
    assert unit.decide(now_s).brake == 0.0
    unit.hear_peers((at(now_s, x=12.0),))
    command = unit.decide(now_s)
    assert (command.brake, command.throttle) == (1.0, 0.0)
    assert unit.alert().danger.stage is DangerStage.FULL


def test_a_kart_ahead_that_tells_that_it_brakes_is_braked_for_at_once_or_after_two_scans() -> None:
    for scans in (0, 1, 2):
        unit, now_s = driving(14.0)
        drives = at(now_s, x=9.0, speed=14.0)
        unit.hear_peers((drives,))
        assert unit.decide(now_s).brake == 0.0
        unit.hear_peers((replace(drives, braking=7.0),))
        for scan in [Echoes.nothing()] * scans + [None]:
            now_s += 0.001
            unit.sense(Readings(now_s, 14.0, 1e-4, 1e-4, None, None, scan))
            assert (unit.decide(now_s).brake == 0.0) == (scan is not None)
    unit.hear_peers((drives,))
    assert unit.decide(now_s).brake == 0.0
    unit.hear_peers((replace(drives, braking=7.0),))
    for _ in range(3):
        unit.sense(Readings(now_s, 14.0, 1e-4, 1e-4, None, None, Echoes.nothing()))
        brake = unit.decide(now_s).brake
    assert brake > 0.0


def test_a_kart_that_brakes_for_a_bend_gives_its_follower_no_warning_yet() -> None:
    limits = Limits.of(KART_60)
    bend = at(NOW_S, x=16.0, speed=14.0, braking=5.0)
    rear = tracks_of([bend], OWN, OpenPlace(), 0.7)[0]
    danger = danger_of(rear, 14.0, 0.0, limits)
    assert 0.5 < danger.needed / limits.promised < 0.75  # for which a slower kart would warn
    assert danger.stage is DangerStage.INFORM


def test_the_kart_tells_what_it_asks_of_its_brakes() -> None:
    unit, now_s = driving(10.0)
    assert unit.braking == 0.0
    unit.drive(Control(brake=0.5), now_s)
    unit.decide(now_s)
    assert unit.braking == pytest.approx(0.5 * unit.limits.promised)


# What peers never do


def any_peer(chance: random.Random, now_s: float) -> Peer:
    """Return what a kart tells: as a rule one in the way, else anything."""
    told = replace(
        AHEAD,
        stamp_us=round(1e6 * (now_s - chance.uniform(0.0, 0.15))),
        x=chance.uniform(2.0, 25.0),
        y=chance.uniform(-1.5, 1.5),
        heading=chance.choice((0.0, chance.uniform(-3.0, 3.0))),
        speed=chance.uniform(-2.0, 10.0),
        yaw_rate=chance.uniform(-1.0, 1.0),
        braking=chance.choice((0.0, chance.uniform(0.0, 12.0))),
        deviation=chance.uniform(0.0, 0.5),
    )
    if chance.random() < 0.2:
        name = chance.choice([each.name for each in fields(Peer)[1:]])
        return replace(told, **{name: chance.choice((math.nan, math.inf, -1e5, 1e5))})
    return told


def any_scans(chance: random.Random, speed: float) -> list[Echoes]:
    """Return three scans of up to three things, most of which stand."""
    count = chance.randrange(4)
    x, y = (np.array([chance.uniform(*of) for _ in range(count)]) for of in ((3, 30), (-2, 2)))
    closing = np.array([chance.choice((speed, chance.uniform(-5.0, 20.0))) for _ in range(count)])
    kinds = (codes.PERSON, codes.KART_HIT, codes.OBSTACLE, codes.BORDER)
    met = np.array([chance.choice(kinds) for _ in range(count)], np.uint8)
    return [Echoes(x + 0.05 * closing * back, y, closing, met) for back in (2, 1, 0)]


@pytest.mark.slow
def test_with_peers_the_verdict_is_at_least_as_strict_as_without() -> None:
    chance, seen = random.Random(65), Counter[str]()
    for _ in range(400):
        speed = chance.uniform(0.0, 17.0)
        unit, now_s = driving(speed, any_scans(chance, speed))
        unit.drive(Control(chance.uniform(-0.3, 0.3), 0.8), now_s)
        unit._is_braking = chance.random() < 0.3  # it began for a person, and is not through
        held = unit._is_braking, unit._met, unit._met_s
        alone, stage = unit.decide(now_s), unit.alert().danger.stage
        after = unit._is_braking, unit._met, unit._met_s
        tracks = [track.state.copy() for track in unit.objects.tracks]
        unit._is_braking, unit._met, unit._met_s = held
        unit.hear_peers(tuple(any_peer(chance, now_s) for _ in range(chance.randrange(4))))
        both = unit.decide(now_s)
        assert both.brake >= alone.brake
        assert abs(both.throttle) <= abs(alone.throttle)
        assert both.cause & alone.cause == alone.cause
        assert both.steering == alone.steering
        assert unit.alert().danger.stage >= stage
        # Neither the radar's tracks nor what the kart still brakes for are touched.
        assert all(map(np.array_equal, tracks, [track.state for track in unit.objects.tracks]))
        assert (unit._is_braking, unit._met, unit._met_s) == after
        seen["stricter"] += both.brake > alone.brake
        seen["radar brakes beside peers"] += alone.brake > 0.0 and bool(unit.others.peers)
    assert min(seen.values()) > 20, seen


def test_a_peer_that_says_it_is_gone_deletes_no_track() -> None:
    # A kart stands 8 m ahead by the radar; its own word has it 30 m ahead, and fast.
    scans = [
        Echoes(*np.array([(8.0 + 0.5 * back, 0.0, 10.0)]).T, np.array([codes.KART_HIT], np.uint8))
        for back in range(8, -1, -1)
    ]
    unit, now_s = driving(10.0, scans)
    assert unit.decide(now_s).brake == 1.0
    unit.hear_peers((at(now_s, x=30.0, speed=20.0),))
    assert unit.decide(now_s).brake == 1.0
    assert len(unit.objects.tracks) == 1


# What the game's side takes from the network


def frame_of(stamp_us: int, **told: float) -> bytes:
    """Return a message of another kart in epoch 1, by its own clock."""
    return encode_peer(PeerFrame(1, replace(AHEAD, stamp_us=stamp_us, **told)))


def test_a_stamp_is_set_to_this_karts_clock_whatever_the_other_one_shows() -> None:
    others = Peers(seat=0)
    for turn in range(5):
        others.store(3, frame_of(7_000_000 + 20_000 * turn), 100.0 + 0.02 * turn)
        (peer,) = others.hear(1, None, 100.0 + 0.02 * turn)
    assert peer.stamp_us == pytest.approx(100_080_000, abs=2)
    # A message that was held up for 0.2 s is as old as that.
    others.store(3, frame_of(7_100_000), 100.3)
    (peer,) = others.hear(1, None, 100.3)
    assert peer.stamp_us == pytest.approx(100_100_000, abs=2)


def test_two_karts_find_each_others_delay_by_what_they_answer() -> None:
    # Each message takes 30 ms; the second clock is 500 s ahead.
    ways = {0: Peers(0), 1: Peers(1)}
    sent: list[tuple[float, int, bytes]] = []
    pose = Pose(0, 0.0, 0.0, 0.0, 5.0)

    class Air:
        def __init__(self, seat: int) -> None:
            self.seat = seat

        def tell(self, data: bytes) -> None:
            sent.append((now + 0.03, self.seat, data))

        def close(self) -> None:
            pass

    now = 0.0
    for seat, each in ways.items():
        each.radio = Air(seat)
    for turn in range(40):
        now = 10.0 + 0.02 * turn
        while sent and sent[0][0] <= now:
            due, seat, data = sent.pop(0)
            other = 1 - seat
            ways[other].store(seat, data, due + 500.0 * other)
        heard = {}
        for seat, each in ways.items():
            own_s = now + 500.0 * seat
            heard[seat] = each.hear(1, pose, own_s)
            told = replace(pose, stamp_us=round(1e6 * own_s))
            each.tell(Report(pose=told), KART_60, 1, own_s)
    for seat, peers in heard.items():
        age_s = now + 500.0 * seat - 1e-6 * peers[0].stamp_us
        assert 0.03 <= age_s <= 0.05 + 1e-6, seat


@pytest.mark.parametrize(
    ("seat", "data"),
    [
        (0, frame_of(1_000_000)),  # this kart's own seat
        (3, b"rubbish"),
        (3, encode_peer(PeerFrame(2, AHEAD))),  # another race
        (3, frame_of(1_000_000, y=math.nan)),
        (3, frame_of((1 << 64) - 1)),  # a stamp that no clock shows
    ],
)
def test_messages_of_the_own_seat_another_race_or_no_message_are_ignored(
    seat: int, data: bytes
) -> None:
    others = Peers(seat=0)
    others.store(seat, data, 5.0)
    assert others.hear(1, None, 5.0) == ()
    assert others.ignored == 1


def test_a_message_that_is_repeated_makes_nothing_younger() -> None:
    others = Peers(seat=0)
    others.store(3, frame_of(1_000_000), 5.0)
    assert len(others.hear(1, None, 5.0)) == 1
    others.store(3, frame_of(1_000_000), 5.4)
    assert len(others.hear(1, None, 5.4)) == 1
    assert others.hear(1, None, 5.6) == ()


def test_from_many_karts_the_nearest_are_passed_on() -> None:
    others = Peers(seat=0)
    for seat in range(1, 60):
        others.store(seat, frame_of(1_000_000, x=1000.0 - seat), 5.0)
    passed = others.hear(1, Pose(0, 0.0, 0.0, 0.0, 0.0), 5.0)
    assert len(passed) == MOST_TOLD
    assert passed[0].x == 1000.0 - 59


def test_a_kart_tells_of_the_middle_of_its_body() -> None:
    vehicle = replace(KART_60, box_offset=0.5)
    pose = Pose(1, 2.0, 3.0, 0.5 * math.pi, 4.0, lateral_speed=0.0, yaw_rate=2.0)
    told = decode_peer(encode_peer(PeerFrame(1, peer_of(Report(pose=pose), pose, vehicle)))).peer
    # It faces north; the middle is half a metre ahead, and swings to the left.
    assert (told.x, told.y, told.lateral_speed) == pytest.approx((2.0, 3.5, 1.0))
