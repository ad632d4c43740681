"""What a client does about a slow network, and a bridge between two sites."""

import math
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Control
from race_server.core.observation import Observation, layout_of
from race_server.core.vehicle_presets import TT02
from race_server.errors import RaceError
from race_server.live.client.bridge import GhostKart, Site, relay
from race_server.live.client.latency_limiter import FRESH_S, REACH, LatencyLimiter
from race_server.live.client.predictor import Predictor, moved_scan
from race_server.live.server import RaceServer
from race_server.net.transport import ServerLink
from race_server.net.wire.drive import HudFrame
from race_server.net.wire.pose import decode_pose
from race_server.scenario.race import Scenario
from race_server.session.failsafe import FRESH_TICKS, SLOW_TICKS, grace_of
from race_server.session.session import Session
from race_server.tools.drills.lossy_link import LinkConditions
from race_server.tools.drills.sites import drill_sites
from support.courses import SMALL_RING
from support.servers import waiting

FULL = Control(steering=0.3, throttle=1.0)
FIELD = math.radians(200.0)


def observation(speed: float = 0.0, yaw_rate: float = 0.0) -> Observation:
    """Return what the driver of a kart in the middle of a round room of 3 m sees."""
    layout = layout_of("lidar", 201)
    values = np.zeros(layout.size, np.float32)
    values[layout.slices["lidar"]] = values[layout.slices["lidar_before"]] = 3.0
    values[layout.slices["speed"]], values[layout.slices["yaw_rate"]] = speed, yaw_rate
    values[layout.slices["speed_cap"]] = 10.0
    return Observation(60, layout, values)


def late(age_s: float) -> LatencyLimiter:
    limiter = LatencyLimiter(TT02)
    for _ in range(200):
        limiter.record(age_s + 0.05, 0.1)
    return limiter


def test_on_a_good_network_no_control_is_touched() -> None:
    limiter = late(0.05)
    assert not limiter.is_needed
    assert limiter.limit(FULL, 5.0) is FULL


def test_the_older_the_view_the_slower_the_kart() -> None:
    slow, slower = late(0.4), late(0.8)
    assert slow.speed_limit() == pytest.approx(REACH * TT02.length / 0.4, rel=0.05)
    assert slower.speed_limit() < slow.speed_limit()
    assert late(FRESH_S - 0.05).speed_limit() == math.inf


def test_too_fast_for_its_view_a_kart_brakes_and_from_rest_it_may_start() -> None:
    limiter = late(0.8)
    fast = limiter.limit(FULL, 4.0)
    assert fast.throttle == 0.0
    assert fast.brake > 0.1
    still = limiter.limit(FULL, 0.0)
    assert 0.2 < still.throttle <= 1.0
    assert still.brake == 0.0
    assert still.steering == FULL.steering
    assert limiter.limit(Control(throttle=-1.0), -4.0).throttle == 0.0


def test_a_scan_seen_from_further_ahead_is_shorter_in_front_and_longer_at_the_sides() -> None:
    moved = moved_scan(np.full(201, 3.0), 1.0, 0.0, 0.0, FIELD)
    assert moved[100] == pytest.approx(2.0, abs=0.02)
    assert moved[0] > 3.0


def test_a_turn_moves_what_is_seen_to_the_other_side() -> None:
    ranges = np.full(201, 5.0)
    ranges[100] = 1.0  # a post right ahead
    moved = moved_scan(ranges, 0.0, 0.0, math.radians(10.0), FIELD)
    assert int(np.argmin(moved)) == 90  # now ten degrees to the right


def test_drop_outs_are_no_walls() -> None:
    assert (moved_scan(np.zeros(201), 0.5, 0.0, 0.0, FIELD) == 0.0).all()
    ranges = np.full(201, 3.0)
    ranges[::2] = 0.0
    assert moved_scan(ranges, 0.0, 0.0, 0.0, FIELD).min() > 2.9


def test_a_fresh_view_is_shown_as_it_is() -> None:
    seen = observation(speed=1.0)
    assert Predictor(TT02, FIELD).ahead(seen, 100.0, 0.02, 0.02) is seen


def test_an_old_view_is_moved_on_by_what_was_sent_meanwhile() -> None:
    predictor = Predictor(TT02, FIELD)
    for tenth in range(10):
        predictor.record(99.0 + 0.1 * tenth, Control(throttle=0.2))
    shown = predictor.ahead(observation(speed=1.0), 100.0, 0.6, 0.3)
    assert shown["lidar"][100] == pytest.approx(3.0 - 0.7, abs=0.1)
    assert shown.scalar("speed") == pytest.approx(1.07, abs=0.1)
    assert shown.tick == 60


def test_a_slow_kart_may_go_on_unheard_for_as_long_as_it_takes_for_its_own_length() -> None:
    assert grace_of(10.0, 0.45) == 0
    assert grace_of(0.9, 0.45) == 30 - FRESH_TICKS
    assert grace_of(0.0, 0.45) == SLOW_TICKS


# Karts of another site


class FakeSeat:
    number = 2

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send(self, data: bytes) -> None:
        self.sent.append(data)


def test_a_guest_is_told_of_as_a_real_kart_that_acknowledges_what_it_heard() -> None:
    seat = FakeSeat()
    ghost = GhostKart(seat)  # type: ignore[arg-type]
    names = ("x", "y", "heading", "speed", "lateral_speed", "yaw_rate", "steering")
    row = {name: 0.1 * place for place, name in enumerate(names)}
    ghost.send_pose(row, 1234)
    assert seat.sent == []  # no heads-up data was received yet
    effects = np.zeros(0)
    ghost.hud = HudFrame(3, 60, 9.0, 1.0, 1.0, 0, 0.0, effects, sequence=5, monotonic_us=77)
    ghost.send_pose(row, 1234)
    frame = decode_pose(seat.sent[0])
    assert (frame.epoch, frame.sequence, frame.acknowledged) == (3, 1, 5)
    assert (frame.pose.stamp_us, frame.pose.speed) == (1234, pytest.approx(0.3))


@pytest.mark.live
def test_halls_that_race_on_different_courses_are_told_so() -> None:
    sites = []
    with ExitStack() as life:
        for name in ("north", "south"):
            address = free_address()
            session = Session(name, Scenario(replace(SMALL_RING, digest=name), karts=2))
            link = life.enter_context(ServerLink(address, name, 2))
            life.enter_context(waiting(RaceServer(session, link), drivers=2))
            sites.append(Site(address, name, ()))
        with pytest.raises(RaceError, match="different courses"):
            relay(*sites, timeout_s=5.0)


def test_without_root_the_drill_of_two_halls_is_skipped_with_a_word(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    document = drill_sites(LinkConditions())
    assert document == {"ok": True, "why": "", "skipped": "network namespaces need root"}
