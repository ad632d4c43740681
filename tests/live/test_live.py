"""Races over zenoh on loopback: server, drivers, spectators, and who misbehaves."""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from race_server.cli.main import main
from race_server.competition.launch import RaceSpec, free_address, run_race
from race_server.core.driver import driver_named
from race_server.core.messages import Control, Phase, Status
from race_server.errors import DriverError, LinkError, SeatError
from race_server.live.client.driver import run_driver
from race_server.live.client.seat import take_seat
from race_server.live.client.spectator import Spectator
from race_server.live.server import LOCKSTEP, REAL, RaceServer, ServerTiming
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join, encode_join
from race_server.session.session import Session
from race_server.terminal import Console
from support.courses import TINY_RING
from support.servers import LiveServer, running, wait_until, waiting
from support.sessions import session_on_ring

pytestmark = pytest.mark.live

NAMES = ["pure_pursuit", "follow_gap"]


@contextmanager
def served(
    karts: int = 2,
    *,
    pace: str = LOCKSTEP,
    drivers: int | None = None,
    fillers: Sequence[str] = (),
) -> Iterator[LiveServer]:
    """Serve one race of one lap; the block ends with it."""
    rules: dict[str, float] = {"countdown_s": 0.5, "finish_limit_s": 60.0, "limit_s": 90.0}
    session = session_on_ring("race", karts, seed=7, course=TINY_RING, laps=1, **rules)
    with ServerLink(free_address(), "race", karts) as link:
        server = RaceServer(session, link, pace, tuple(fillers))
        with running(server, karts if drivers is None else drivers) as live:
            yield live
            live.thread.join(100.0)


def start_driver(driver: str, name: str, address: str, seat: int) -> threading.Thread:
    thread = threading.Thread(
        target=run_driver,
        args=(driver_named(driver), name),
        kwargs={"address": address, "wanted": seat},
    )
    thread.start()
    return thread


def drive_all(address: str, names: list[str]) -> None:
    threads = [start_driver(name, name, address, seat) for seat, name in enumerate(names)]
    for thread in threads:
        thread.join(90.0)


def test_a_race_over_the_network_is_the_race_in_one_process() -> None:
    with served() as apart:
        drive_all(apart.address, NAMES)
    alone = Session("race", apart.server.session.scenario)
    with ServerLink(free_address(), "race", 2) as link:
        together = RaceServer(alone, link, LOCKSTEP, tuple(NAMES)).run(0)
    assert together is not None
    assert apart.results[0].digest == together.digest
    assert [row.lap_times_us for row in apart.results[0].standings] == [
        row.lap_times_us for row in together.standings
    ]


def test_a_server_that_fills_seats_races_again_with_whoever_comes_next() -> None:
    session = session_on_ring("race", 3, seed=7, course=TINY_RING, laps=1, countdown_s=0.5)
    address = free_address()
    with ServerLink(address, "race", 3) as link:
        server = RaceServer(session, link, LOCKSTEP, ("avoider", "pure_pursuit"))
        for seat in (0, 2):
            thread = start_driver("follow_gap", "guest", address, seat)
            result = server.run(1)
            assert result is not None
            drivers = {row.seat: row.driver for row in result.standings}
            assert drivers.pop(seat) == "guest"
            assert set(drivers.values()) <= {"avoider", "pure_pursuit"}
            assert len(drivers) == 2
            thread.join(10.0)
            server.reopen()
            assert all(not seat.is_taken or seat.driver == "guest" for seat in session.seats)


def test_drivers_that_call_before_the_server_answers_still_get_their_seats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_server.net.transport.client.QUERY_TIMEOUT_S", 0.5)
    session = session_on_ring("race", 2, seed=7, course=TINY_RING, laps=1, countdown_s=0.5)
    address = free_address()
    with ServerLink(address, "race", 2) as link:
        server = RaceServer(session, link, LOCKSTEP)
        threads = [start_driver(name, name, address, seat) for seat, name in enumerate(NAMES)]
        time.sleep(1.2)  # a server that compiles listens but does not answer
        result = server.run(2)
        for thread in threads:
            thread.join(10.0)
    assert result is not None
    assert {row.status for row in result.standings} == {Status.FINISHED}


def test_a_seat_whose_driver_never_shows_up_is_free_again() -> None:
    session = session_on_ring("race", karts=2)
    address = free_address()
    with ServerLink(address, "race", 2) as link:
        server = RaceServer(session, link, LOCKSTEP, timing=ServerTiming(show_up_s=0.3))
        with waiting(server, drivers=2), ClientLink(address, "race") as client:
            client.ask(topics.JOIN, encode_join(Join("ghost", "lidar", 1)))
            take_seat(client, Join("guest", "lidar", 0))
            assert session.seats[1].driver == "ghost"
            deadline = time.monotonic() + 3.0
            while session.seats[1].is_taken and time.monotonic() < deadline:
                time.sleep(0.02)
            assert not session.seats[1].is_taken
            assert session.seats[0].driver == "guest"


def test_a_race_in_real_time_takes_its_time_and_every_kart_finishes() -> None:
    begun = time.perf_counter()
    with served(pace=REAL) as live:
        drive_all(live.address, NAMES)
    result = live.results[0]
    assert {row.status for row in result.standings} == {Status.FINISHED}
    assert time.perf_counter() - begun >= result.ticks / 60 * 0.98


def test_a_late_spectator_gets_course_rules_standings_and_recent_events() -> None:
    with served(pace=REAL, drivers=0, fillers=NAMES) as live:
        while live.server.session.phase is not Phase.RUNNING:
            time.sleep(0.01)
        with ClientLink(live.address, "race") as link:
            watcher = Spectator(link)
            rules, items = watcher.rules()
            assert watcher.course().name == "ring"
            assert rules["laps"] == "1"
            assert "oil" in items
            assert watcher.standings is not None
            assert [row.driver for row in watcher.standings.rows]
            assert watcher.events
            time.sleep(0.3)
            snapshot = watcher.snapshot()
            assert snapshot is not None
            assert len(snapshot.karts) == 2
        live.server.stop()


def test_a_spectator_keeps_the_end_of_a_race_when_the_next_one_opens() -> None:
    with (
        ServerLink(free_address(), "race", 2) as link,
        running(
            RaceServer(session_on_ring("race", karts=2), link, LOCKSTEP, NAMES), repeatedly=True
        ) as live,
        ClientLink(live.address, "race") as client,
    ):
        watcher = Spectator(client)
        wait_until(lambda: watcher.final and live.server.session.epoch > 0)
        assert watcher.final is not None
        assert {row.status for row in watcher.final.rows} == {Status.FINISHED}


class Faulty:
    """Drives a while, then raises."""

    preset = "track"

    def __init__(self) -> None:
        self.turns = 0

    def reset(self, briefing: object) -> None:
        pass

    def act(self, observation: object) -> Control:
        self.turns += 1
        if self.turns > 30:
            raise RuntimeError("my wheels came off")
        return Control(throttle=0.2)


def test_a_driver_that_raises_is_out_and_the_race_goes_on() -> None:
    with served() as live:
        other = start_driver("pure_pursuit", "good", live.address, 0)
        with pytest.raises(DriverError, match="'bad' failed in act: RuntimeError: my wheels came"):
            run_driver(Faulty(), "bad", address=live.address, wanted=1)
        other.join(90.0)
    good, bad = sorted(live.results[0].standings, key=lambda row: row.seat)
    assert good.status is Status.FINISHED
    assert bad.status is Status.RETIRED


def test_rubbish_on_the_control_topic_is_counted_and_the_race_goes_on() -> None:
    with served() as live, ClientLink(live.address, "race") as link:
        rude = take_seat(link, Join("rude", "track", 1))
        stranger = link.sender(0, "no badge of that seat")
        rude.act(topics.READY)
        other = start_driver("pure_pursuit", "good", live.address, 0)
        for _ in range(100):
            for size in (100, 300, 4000):
                rude.send(os.urandom(size))
                stranger(os.urandom(size))
            time.sleep(0.002)
        rude.act(topics.LEAVE)
        other.join(90.0)
    refused = live.results[0].refused
    assert {"foreign", "oversized", "control without the seat's badge"} <= set(refused)
    assert min(live.results[0].standings, key=lambda row: row.seat).status is Status.FINISHED


def test_rubbish_in_a_request_gets_a_refusal() -> None:
    with served(drivers=3) as live:
        with ClientLink(live.address, "race") as link:
            for topic in (topics.JOIN, topics.READY, topics.LEAVE):
                answer = link.ask(topic, b"rubbish")
                assert answer[4:8] == b"RRPL"
        live.server.stop()


def test_a_full_race_refuses_the_next_driver() -> None:
    with served(karts=1, drivers=2) as live:
        with ClientLink(live.address, "race") as link:
            take_seat(link, Join("first", "lidar"))
            with pytest.raises(SeatError, match="all 1 seats are taken"):
                take_seat(link, Join("second", "lidar"))
        live.server.stop()


def test_a_seat_in_the_lobby_is_free_again_when_its_link_is_gone() -> None:
    with served(drivers=3) as live:
        with ClientLink(live.address, "race") as link:
            take_seat(link, Join("first", "lidar", 0))
            time.sleep(0.1)
        deadline = time.monotonic() + 3.0
        while live.server.session.seats[0].is_taken and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not live.server.session.seats[0].is_taken
        live.server.stop()


def test_no_server_says_where_and_what_to_do() -> None:
    address = free_address()
    with pytest.raises(LinkError, match=f"no server answers at {address} within 0.5 s"):
        ClientLink(address, "race", timeout_s=0.5)


def test_an_address_in_use_says_so() -> None:
    address = free_address()
    with (
        ServerLink(address, "race", 1),
        pytest.raises(LinkError, match=r"cannot listen on .*choose another address"),
    ):
        ServerLink(address, "race", 1)


def test_a_driver_process_never_imports_numba() -> None:
    code = (
        "import os, sys; os.environ['RACE_SERVER_INTERPRET'] = '1';"
        "import race_server.live.client.driver, race_server.core.driver as d;"
        "[d.driver_named(n) for n in ('pure_pursuit', 'follow_gap', 'avoider')];"
        "sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_race_start_gives_the_same_race_again_and_in_one_process() -> None:
    command = [sys.executable, "-m", "race_server", "start", "--track", "oval", "--karts", "3"]
    command += ["--laps", "1", "--seed", "7", "--pace", "lockstep", "--json"]
    documents = [
        json.loads(subprocess.run(line, check=True, capture_output=True, timeout=100).stdout)
        for line in (command, command, [*command, "--one-process"])
    ]
    assert len({document["digest"] for document in documents}) == 1
    laps = [[kart["lap_times_us"] for kart in document["karts"]] for document in documents]
    assert laps[0] == laps[1] == laps[2]
    assert all(kart["status"] == "finished" for kart in documents[0]["karts"])


def test_a_race_that_is_over_before_anyone_can_look_has_its_result_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def late(*_: object, **__: object) -> ClientLink:
        time.sleep(0.2)
        raise LinkError("no answer")

    monkeypatch.setattr("race_server.competition.launch.ClientLink", late)
    serve = ["--track", "oval", "--karts", "1", "--laps", "1", "--pace", "lockstep", "--fresh"]
    plan = RaceSpec(tuple(serve), ("avoider",), free_address(), "unseen", in_process=True)
    document = run_race(plan, Console(quiet=True))
    assert [kart["status"] for kart in document["karts"]] == ["finished"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["start", "--track", "monza"], "track 'monza' is unknown; choose one of"),
        (["start", "--vehicle", "bus"], "vehicle 'bus' is unknown; choose one of"),
        (["start", "--drivers", "schumacher"], "driver schumacher is unknown; installed drivers"),
        (["start", "--pace", "warp"], "pace 'warp' is unknown; choose real or lockstep"),
        (["start", "--karts", "3", "--session", "a b"], "session name 'a b': use up to 32"),
        (
            ["drive", "avoider", "--connect", "tcp/127.0.0.1:9", "--patience", "0.5"],
            "no server",
        ),
        (["track", "check", "nowhere.toml"], "nowhere.toml: cannot be read"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(
    words: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.argv", ["race", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert message in " ".join(said.split())
    assert "Traceback" not in said
