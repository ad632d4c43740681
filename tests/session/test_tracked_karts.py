"""Real karts in a race among simulated ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.alert import Alert, Cause, Danger, DangerStage
from race_server.core.messages import (
    Button,
    Control,
    EventKind,
    KartFlag,
    PoseFault,
    RayHit,
    Retirement,
    Status,
)
from race_server.core.rules.items import items
from race_server.core.vehicle_presets import TT02
from race_server.errors import SeatError, WireError
from race_server.live.server.hud import hud_of
from race_server.live.server.publisher import snapshot_of
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from support.tracked import COURSE, RADIUS, TICK_US, Real, drive, mixed


def test_a_real_kart_is_where_its_poses_say_and_drives_laps() -> None:
    session, real = mixed()
    events = drive(session, real, 60 * 23)
    body = session.world.bodies[0, 0]
    assert math.hypot(body.x, body.y) == pytest.approx(RADIUS, abs=1e-3)
    assert EventKind.LAP in events
    assert EventKind.FINISH in events
    assert hud_of(session, session.seats[0]).speed_cap == 0.0  # home: it is to stop


def test_poses_at_ten_a_second_over_a_slow_link_are_moved_on_to_now() -> None:
    session, real = mixed()
    late_us = 90_000
    worst = 0.0
    for turn in range(240):
        now_us = session.tick * TICK_US
        real.angle += real.speed / RADIUS / 60.0
        if turn % 6 == 0:
            sent = Real(session)
            sent.speed, sent.angle = 3.0, real.angle - real.speed / RADIUS * late_us / 1e6
            pose = replace(sent.pose(now_us - late_us), echo_us=round(now_us - 2 * late_us))
            real.sequence += 1
            session.receive_pose(
                0,
                1,
                real.sequence,
                pose,
                arrived_us=round(now_us),
                acknowledged=session.tracked_karts.orders(0).sequence,
            )
        session.follow(round(now_us))
        session.advance(1)
        body, here = session.world.bodies[0, 0], real.pose(now_us)
        if turn > 60:
            worst = max(worst, math.hypot(body.x - here.x, body.y - here.y))
    assert session.tracked_karts.trackers[0].clock.delay_us == pytest.approx(late_us, abs=2)
    assert worst < 0.01  # against 0.57 m that the kart drives in the 190 ms of its oldest pose


def test_a_simulated_kart_bounces_off_a_real_one_which_is_not_moved() -> None:
    session, real = mixed()
    real.speed = 0.0
    drive(session, real, 5)
    body, other = session.world.bodies[0, 0], session.world.bodies[0, 1]
    other.x, other.y, other.heading = body.x, body.y - 0.6, math.pi / 2
    other.speed, before = 4.0, (float(body.x), float(body.y))
    events = drive(session, real, 30)
    assert EventKind.CONTACT_KART in events
    assert other.y < body.y - 0.4
    assert other.speed < 1.0
    assert (body.x, body.y) == pytest.approx(before, abs=1e-5)


def test_a_doubtful_kart_touches_nobody_and_calls_a_yellow_flag_around_it() -> None:
    session, real = mixed()
    real.speed = 0.0
    drive(session, real, 5)
    events = drive(session, real, 40, silent=True)
    assert EventKind.POSE in events
    assert EventKind.FLAG in events
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    other_body, other_racer = session.world.bodies[0, 1], session.world.racers[0, 1]
    assert body.trust == codes.DOUBTFUL
    other_body.x, other_body.y, other_body.heading, other_body.speed = (
        body.x,
        body.y - 0.6,
        math.pi / 2,
        4.0,
    )
    other_racer.progress = racer.progress - 0.6
    contacts = int(other_racer.contacts)
    session.receive_control(1, 1, 1, session.tick, Control(throttle=1.0))
    events = drive(session, real, 12, silent=True)
    assert other_racer.contacts == contacts
    assert other_body.y > body.y
    assert other_racer.yellow == 1
    assert other_body.speed_cap == pytest.approx(0.4 * TT02.top_speed)
    session.observe()
    flag = session.view(1)[session.layout("track").slices["flag"]]
    assert flag == 1.0
    snapshot = snapshot_of(session)
    assert snapshot.karts["flags"][0] & (16 | 32)
    assert snapshot.karts["flags"][1] & KartFlag.YELLOW


def test_a_kart_far_from_the_trouble_sees_no_flag() -> None:
    session, real = mixed()
    drive(session, real, 40, silent=True)
    other = session.world.racers[0, 1]
    other.progress = (session.world.racers[0, 0].progress + 31.4) % COURSE.length
    session.world.bodies["x"][0, 1], session.world.bodies["y"][0, 1] = RADIUS, 0.0
    real.session.advance(1)
    session.advance(1)
    assert session.world.races[0].flag == codes.GREEN


def test_a_pose_off_the_world_never_gets_into_it() -> None:
    session, real = mixed()
    drive(session, real, 60)
    drive(session, real, 60, moved=50.0)
    body = session.world.bodies[0, 0]
    assert body.trust == codes.DOUBTFUL
    assert math.hypot(body.x, body.y) == pytest.approx(RADIUS, abs=0.3)
    assert session.tracked_karts.trackers[0].doubt is PoseFault.OFF_WORLD


def test_a_kart_that_is_back_in_time_races_on_without_a_penalty() -> None:
    session, real = mixed()
    drive(session, real, 60)
    drive(session, real, 240, silent=True)
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    assert body.trust == codes.SUSPENDED
    assert body.speed_cap == 0.0
    session.observe()
    assert session.view(1)[session.layout("track").slices["karts_x"]][0] == 1000.0  # no kart there
    events = drive(session, real, 60)
    assert events.count(EventKind.POSE) == 1
    assert body.trust == codes.TRUSTED
    assert body.status == codes.RACING
    # It drove past gates unseen: they do not count, so the next lap does; no fine.
    drive(session, real, 60 * 42)
    assert racer.laps == 1
    assert racer.penalties == 0


def test_a_kart_that_stays_lost_is_out() -> None:
    session, real = mixed()
    drive(session, real, 60)
    drive(session, real, 60 * 24, silent=True)
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    assert body.status == codes.RETIRED
    assert racer.retired_for == Retirement.LOST
    assert racer.yellow == 0


def test_a_real_kart_uses_its_item_and_is_slowed_by_others() -> None:
    session, real = mixed()
    drive(session, real, 10)
    player, other = session.world.players[0, 0], session.world.players[0, 1]
    names = [item.name for item in items()]
    player.held = names.index("oil") + 1
    real.send(real.pose(session.tick * TICK_US), Button.USE_ITEM)
    session.advance(1)
    assert (player.held, player.items_used) == (0, 1)
    session.world.racers["rank"][0] = (1, 2)
    other.held = names.index("pulse") + 1
    session.receive_control(1, 1, 1, session.tick, Control(buttons=Button.USE_ITEM))
    session.advance(1)
    before = hud_of(session, session.seats[0])
    drive(session, real, 2)
    hud = hud_of(session, session.seats[0])
    assert hud.speed_cap == pytest.approx(0.5 * TT02.top_speed)
    assert len(hud.effects) == 1
    assert hud.sequence == before.sequence + 1
    assert session.tracked_karts.orders(0).is_open


def test_a_kart_that_never_acknowledges_is_doubtful() -> None:
    session, real = mixed()
    for _ in range(120):
        now_us = session.tick * TICK_US
        real.sequence += 1
        session.world.bodies["thrust_scale"][0, 0] = 0.5
        pose = replace(real.pose(now_us), speed=0.0, yaw_rate=0.0)
        session.tracked_karts.orders(0).change((float(session.tick > 60),), 0)
        session.receive_pose(0, 1, real.sequence, pose, arrived_us=round(now_us))
        session.follow(round(now_us))
        session.advance(1)
    assert session.tracked_karts.trackers[0].doubt is PoseFault.DEAF


def test_the_same_placements_give_the_same_race_again() -> None:
    session, real = mixed()
    rows: list[tuple[int, np.ndarray]] = []
    place = session.place_karts

    def note(placements: np.ndarray) -> None:
        rows.append((session.tick, placements.astype(np.float32)))
        place(placements)

    session.place_karts = note  # type: ignore[method-assign]
    session.start()
    real.sequence = 0
    start_us = 0
    drive(session, real, 200)
    drive(session, real, 60, silent=True)
    digest = session.digest()
    again, _ = mixed()
    again.start(start_us)
    kept = dict(rows)
    for tick in range(260):
        if tick in kept:
            again.place_karts(kept[tick].astype(np.float64))
        again.advance(1)
    assert again.digest() == digest


def test_a_real_kart_sends_no_controls_and_a_simulated_one_no_poses() -> None:
    session, real = mixed()
    with pytest.raises(WireError, match="seat 0, which is a real kart"):
        session.receive_control(0, 1, 999, session.tick, Control())
    with pytest.raises(WireError, match="seat 1, whose kart is simulated"):
        session.receive_pose(1, 1, 1, real.pose(0.0), arrived_us=0)


def test_a_pose_of_another_epoch_or_again_is_refused() -> None:
    session, real = mixed()
    with pytest.raises(WireError, match="pose for epoch 9"):
        session.receive_pose(0, 9, 999, real.pose(0.0), arrived_us=0)
    with pytest.raises(WireError, match="pose 1 again"):
        session.receive_pose(0, 1, 1, real.pose(0.0), arrived_us=0)


def test_no_real_kart_takes_part_where_the_world_waits() -> None:
    session = Session("test", Scenario(COURSE, karts=1), takes_tracked=False)
    with pytest.raises(SeatError, match="cannot wait for others; serve with --pace real"):
        session.join("real", "track", tracked=True)


def test_a_real_kart_whose_driver_leaves_is_out() -> None:
    session, real = mixed()
    session.leave(0)
    drive(session, real, 2)
    assert session.world.bodies["status"][0, 0] == Status.RETIRED


def test_what_a_real_kart_says_holds_for_a_second_and_changes_no_world() -> None:
    session, _ = mixed()
    alerts, before = session.tracked_karts.alerts, session.digest()
    brakes = Alert(0, Danger(DangerStage.FULL, RayHit.PERSON, 0.0, 4.0), Cause.OBSTACLE)
    alerts.receive(0, 1, brakes, arrived_us=0)
    assert (alerts.has_news(0), alerts.by_seat) == (True, {0: brakes})
    assert not alerts.has_news(900_000)
    assert (alerts.has_news(1_100_000), alerts.by_seat) == (True, {})
    with pytest.raises(WireError, match="again"):
        alerts.receive(0, 1, brakes, arrived_us=0)
    assert session.digest() == before
