"""A real kart over zenoh on loopback: poses up, orders down, acknowledged."""

import threading
import time
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from race_agents.onboard.client import take_part
from race_agents.onboard.grounds import fence_of
from race_agents.onboard.kart import KartHere
from race_agents.onboard.program import KartProgram
from race_agents.plant.body import Body
from race_agents.plant.incident import FastestSpeed, is_view_clear
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Person
from race_agents.unit.readings import Readings
from race_agents.unit.safety import Command
from race_server.competition.launch import free_address
from race_server.core.messages import Flag, Trust
from race_server.core.telemetry import Sensor, SensorState
from race_server.core.vehicle_presets import KART_30, TT02
from race_server.errors import SeatError
from race_server.live.client.seat import ClientSeat, take_seat
from race_server.live.server import LOCKSTEP, REAL, RaceServer
from race_server.live.server.hud import hud_of
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import CourseSheet, Join
from race_server.net.wire.sheets import course_sheet
from race_server.net.wire.telemetry import decode_telemetries
from race_server.scenario.race import ABSENT
from race_server.tools.drills.mixed import judge_both, way_to_stop
from support.courses import SMALL_RING
from support.real_karts import Gentle, kart_of
from support.servers import running, waiting
from support.sessions import session_on_ring

pytestmark = pytest.mark.live
WELL, SILENT = SensorState.WELL, SensorState.SILENT


class Unplugged:
    """A plant whose radar is pulled out."""

    def __init__(self, plant: Plant) -> None:
        self.plant, self.act, self.hands = plant, plant.act, plant.hands

    def read(self, now_s: float) -> Readings:
        return replace(self.plant.read(now_s), echoes=None)


def test_the_pit_wall_sees_within_half_a_second_that_a_sensor_of_a_real_kart_is_dead() -> None:
    session = session_on_ring("race", karts=1, laps=1, countdown_s=0.5, limit_s=60.0)
    address, seen, heard = free_address(), {}, []
    with ServerLink(address, "race", 1) as link:
        server = RaceServer(session, link, REAL)

        def turn(onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
            side = kart.side
            if session.tick > 90 and "pulled" not in seen:
                seen["pulled"] = now_s
                side.hardware = Unplugged(side.hardware)
            told = [(at, frame.karts[0]) for at, frame in heard if 0 in frame.karts]
            dead = [at for at, kart in told if kart.health.sensors[Sensor.RADAR] is SILENT]
            if dead:
                seen["shown"], seen["told"] = dead[0], told
            return not dead and now_s - seen.get("pulled", now_s) < 3.0

        def hear(data: bytes) -> None:
            heard.append((time.monotonic(), decode_telemetries(data)))

        with running(server, drivers=1), ClientLink(address, "race") as wall:
            wall.listen(topics.TELEMETRIES, hear)
            take_part(Gentle(), kart_of, name="real", address=address, each_turn=turn)
    assert seen["shown"] - seen["pulled"] < 0.5
    well = [kart for at, kart in seen["told"] if at < seen["pulled"]]
    assert len(well) >= 5  # in 1.5 s, five a second
    known = well[-1]
    assert known.health.sensors[Sensor.FIXES] is known.health.sensors[Sensor.GYRO] is WELL
    assert known.health.sensors[Sensor.LIDAR] is SensorState.ABSENT
    assert known.deviation is not None
    assert known.deviation < 0.3
    assert known.health.link_s is not None
    assert known.health.link_s < 0.3
    assert known.health.battery == pytest.approx(1.0, abs=0.01)


def test_a_real_kart_is_trusted_obeys_a_stop_and_is_missed_when_it_falls_silent() -> None:
    session = session_on_ring("race", karts=1, laps=1, countdown_s=0.5, limit_s=60.0)
    address, seen = free_address(), {}
    with ServerLink(address, "race", 1) as link:
        server = RaceServer(session, link, REAL)

        def turn(onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
            del now_s
            tracker = session.tracked_karts.trackers[0]
            if tracker.trust is Trust.TRUSTED and session.tick > 90:
                seen.setdefault("trusted", (onboard.sequence, tracker.clock.delay_us))
                onboard.is_cut = True
            if onboard.is_cut:
                seen["command"] = kart.side.unit.command
            return tracker.trust is not Trust.DOUBTFUL or "trusted" not in seen

        with running(server, drivers=1):
            take_part(
                Gentle(),
                kart_of,
                name="real",
                address=address,
                delay_s=0.05,
                clock=lambda: time.monotonic() + 1234.5,
                each_turn=turn,
            )
    poses, delay_us = seen["trusted"]
    assert poses > 20
    assert 45_000 < delay_us < 150_000
    assert isinstance(seen["command"], Command)
    assert session.tracked_karts.orders(0).acknowledged >= 1
    assert session.world.racers["yellow"][0, 0] == 1


def test_in_an_event_a_real_kart_stands_on_its_place_in_the_order_of_the_race() -> None:
    session = session_on_ring("race", karts=2, laps=1, countdown_s=2.0, limit_s=1.0)
    session.is_event = True
    grid, address, placed = SMALL_RING.grid, free_address(), []

    def on_its_place(seat: ClientSeat, sheet: CourseSheet, link: ClientLink) -> KartHere:
        placed.append(sheet.grid[seat.number].tolist())
        return kart_of(seat, sheet, link)

    def turn(_onboard: KartProgram, _kart: KartHere, _now_s: float) -> bool:
        return session.tracked_karts.trackers[0].trust is not Trust.TRUSTED

    def serve() -> None:
        server.lobby.wait_for(1)
        server.drive(replace(session.scenario, grid_order=(1, ABSENT)))
        session.is_event = False
        server.see_off()

    with ServerLink(address, "race", 2) as link:
        server = RaceServer(session, link, REAL)
        thread = threading.Thread(target=serve)
        thread.start()
        take_part(Gentle(), on_its_place, name="real", address=address, each_turn=turn)
        thread.join(20.0)
    assert placed == [grid[1].tolist()]
    assert session.world.racers["false_started"][0, 0] == 0


def test_the_control_loop_turns_on_while_the_kart_asks_for_its_seat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_agents.onboard.client.RETRY_S", 0.1)
    monkeypatch.setattr("race_server.net.transport.client.QUERY_TIMEOUT_S", 0.8)
    session, address = session_on_ring("race", karts=1, countdown_s=5.0), free_address()
    turns: list[float] = []
    with ServerLink(address, "race", 1) as link, running(RaceServer(session, link), 1) as live:

        def turn(onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
            del onboard
            if kart.side.unit.hud is not None and not turns:
                live.server.stop()  # the link stays, and no request is answered
            if kart.side.unit.hud is not None:
                turns.append(now_s)
            return len(turns) < 40

        take_part(Gentle(), kart_of, name="real", address=address, each_turn=turn)
    # 40 turns of 20 ms, in which a request waits for 0.8 s.
    assert max(later - now for now, later in pairwise(turns)) < 0.5


def test_a_real_kart_stands_through_a_pause_and_drives_on_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_agents.onboard.client.GIVE_UP_S", 0.5)
    session, address = session_on_ring("race", karts=1, countdown_s=0.0), free_address()
    may_drive: list[bool] = []
    paused_at: list[float] = []
    with ServerLink(address, "race", 1) as link, running(RaceServer(session, link), 1):

        def turn(onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
            del onboard
            if kart.side.unit.hud is None or session.tick < 3:
                return True
            if not paused_at:
                session.race_control.pause()
                paused_at.append(now_s)
            elif now_s > paused_at[0] + 1.0:
                session.race_control.pause(is_paused=False)
            if may_drive[-1:] != [kart.side.unit.hud.speed_cap > 0.0]:
                may_drive.append(kart.side.unit.hud.speed_cap > 0.0)
            return may_drive != [True, False, True] and not kart.side.unit.is_home

        take_part(Gentle(), kart_of, name="real", address=address, each_turn=turn)
    assert may_drive == [True, False, True]


def test_the_orders_of_a_pause_have_their_own_number() -> None:
    session = session_on_ring("race", karts=1)
    session.join("real", "track", tracked=True)
    session.start()
    session.follow(0)
    told = [hud_of(session, session.seats[0])]
    for is_paused in (True, False):
        session.race_control.pause(is_paused=is_paused)
        session.tracked_karts.give_orders(session.world, 0, is_paused=is_paused)
        told.append(hud_of(session, session.seats[0]))
    assert [hud.sequence for hud in told] == [1, 2, 3]
    assert [hud.flag for hud in told] == [Flag.GREEN, Flag.RED, Flag.GREEN]


def test_a_real_kart_gets_no_seat_where_the_world_waits() -> None:
    session = session_on_ring("race", karts=1)
    address = free_address()
    with ServerLink(address, "race", 1) as link:
        server = RaceServer(session, link, LOCKSTEP)
        join = Join("real", "track", tracked=True)
        with waiting(server, drivers=1), ClientLink(address, "race") as client:
            with pytest.raises(SeatError, match="serve with --pace real"):
                take_seat(client, join)
            take_seat(client, replace(join, tracked=False))


def test_a_kart_that_is_cut_off_has_as_far_to_stop_as_its_brakes_need() -> None:
    # 0.35 s at 8.33 m/s are 2.9 m; then half of 7.36 m/s² of brakes: 9.5 m.
    assert way_to_stop(KART_30, 30.0 / 3.6) == pytest.approx(12.4, abs=0.1)


@pytest.mark.parametrize(
    ("name", "doubts", "is_busy", "is_well"),
    [
        ("pedestrian", [], False, True),
        ("pedestrian", ["silent"], False, False),
        ("pedestrian", ["silent"], True, True),
        ("pedestrian", ["jump"], True, False),
        ("cut", ["silent"], False, True),
        ("cut", ["stale", "silent"], False, False),
    ],
)
def test_only_a_busy_machine_excuses_a_doubt_and_only_a_late_pose(
    name: str, doubts: list[str], is_busy: bool, is_well: bool
) -> None:
    kart = {"worst_excess_share": 0.0, "slowdowns": 1}
    part = {"seat": 2, "laps": 1, "items_used": 1, "kart": kart, "doubts": doubts}
    assert (judge_both({name: part}, is_busy=is_busy) == []) is is_well


def test_on_a_small_course_a_kart_is_fast_near_the_fastest_that_it_was() -> None:
    pace, body = FastestSpeed(), Body(TT02, 0.0, 0.0, 0.0)
    for speed, is_fast in ((2.0, True), (1.0, False), (1.8, True), (4.6, True), (3.0, False)):
        body.speed = speed
        assert pace.is_fast(body) is is_fast


def test_the_fence_of_a_course_is_its_kerb() -> None:
    session = session_on_ring("race", karts=1)
    fence = fence_of(course_sheet(session.scenario))
    x, y = SMALL_RING.line[0, :2]
    assert partial(fence.beyond, x)(y) == pytest.approx(-0.7)


def test_poses_are_heard_on_the_seats_of_real_karts_only() -> None:
    address = free_address()
    with ServerLink(address, "race", 2) as link, ClientLink(address, "race") as client:
        link.expect_tracked({1})
        send = [client.sender(seat, "nobody's", topics.POSE) for seat in (0, 1)]
        deadline = time.monotonic() + 5.0
        while not link.dropped and time.monotonic() < deadline:
            for pose in send:
                pose(b"rubbish")
            time.sleep(0.02)
        assert {seat for _, seat in link.dropped} == {1}
        link.expect_tracked(())
        time.sleep(0.1)
        before = link.dropped.copy()
        send[1](b"rubbish")
        time.sleep(0.1)
        assert link.dropped == before


def test_nobody_steps_out_behind_another_kart() -> None:
    body, somebody = Body(KART_30, 0.0, 0.0, 0.0), Person(10.0, 0.0, 0.3)
    none, ahead, abreast, beyond, behind, aside = (
        np.array(karts, float).reshape(-1, 5)
        for karts in (
            [],
            [5.0, 0.5, 0.0, 8.0, 0.0],
            [0.5, 1.6, 0.0, 8.0, 0.0],
            [14.0, 0.0, 0.0, 8.0, 0.0],
            [-6.0, 0.0, 0.0, 8.0, 0.0],
            [5.0, 4.0, 0.0, 8.0, 0.0],
        )
    )
    assert all(is_view_clear(somebody, body, karts) for karts in (none, beyond, behind, aside))
    assert not any(is_view_clear(somebody, body, karts) for karts in (ahead, abreast))
