"""Sessions in a car park: over zenoh on loopback, recorded, replayed, taken up again."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control, Ending, Event, EventKind
from race_server.core.observation import Observation
from race_server.errors import SeatError
from race_server.live.client.driver import run_driver
from race_server.live.client.seat import take_seat
from race_server.live.server import LOCKSTEP, RaceResult, RaceServer
from race_server.live.server.resume import restore_session
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.admin import Decision
from race_server.net.wire.lobby import Join
from race_server.session.interventions import Intervention
from race_server.session.session import Session
from race_server.storage.recording.channels import LOTS
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_lines, read_recording
from race_server.storage.recording.rerun import Rerun
from race_server.storage.recording.to_json import to_json
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import races
from race_server.storage.results.store import Store
from race_server.storage.results.writer import Writer
from support.lots import Beeline, lot_session, one_slot, open_lot
from support.servers import running

pytestmark = pytest.mark.live

TOKEN = "steward one"


VEHICLES = 3


class Waiter:
    """Stands with the brake on: another driver is to park."""

    preset = "track"

    def reset(self, briefing: Briefing) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return Control(brake=1.0)


@pytest.fixture
def valets(monkeypatch: pytest.MonkeyPatch) -> list[Beeline]:
    """The parking drivers that a server makes, oldest first; all other drivers wait."""
    made: list[Beeline] = []

    def make_valet(_: str) -> Driver:
        made.append(Beeline())
        return made[-1]

    monkeypatch.setattr("race_server.live.server.wheels.driver_named", make_valet)
    monkeypatch.setattr("race_server.live.local_drivers.driver_named", lambda _: Waiter())
    return made


@contextmanager
def serving(
    session: Session, *, folder: Path | None = None, fill: str = ""
) -> Iterator[RaceServer]:
    with ExitStack() as stack:
        link = stack.enter_context(ServerLink(free_address(), "lot", len(session.seats)))
        book = folder and stack.enter_context(Logbook(folder, "lot", print))
        fillers = (fill,) if fill else ()
        yield RaceServer(session, link, LOCKSTEP, fillers, logbook=book, token=TOKEN)


def order_all(server: RaceServer, *, every: int = 100) -> None:
    """Let the steward ask one vehicle after the other to park."""
    session, advance = server.session, server.session.advance
    steward, turns = server._steward, count()

    def advance_and_park(ticks: int = 1) -> list[Event]:
        turn = next(turns)
        if turn % every == every // 2 and turn // every < VEHICLES:
            decision = Decision(TOKEN, "park", turn // every, -1.0, steward.challenge)
            steward.decide(decision)
        return advance(ticks)

    session.advance = advance_and_park  # type: ignore[method-assign]


def endings(result: RaceResult) -> list[Ending]:
    return [row.parking.ending for row in result.standings if row.parking]


@pytest.fixture
def recorded(tmp_path: Path, valets: list[Beeline]) -> tuple[RaceResult, Path]:
    """A session of three vehicles that park on command, and its recording."""
    session = lot_session(open_lot(VEHICLES, people=1), VEHICLES, level="report-a-2")
    with serving(session, folder=tmp_path, fill="waiter") as server:
        order_all(server)
        result = server.run(0)
    assert result is not None
    assert len(valets) == VEHICLES
    (path,) = tmp_path.glob("*.mcap")
    return result, path


def test_vehicles_of_a_running_session_park_on_command_and_nobody_is_hit(
    recorded: tuple[RaceResult, Path],
) -> None:
    result, _ = recorded
    assert endings(result) == [Ending.PARKED] * VEHICLES
    kinds = [event.kind for event in result.events]
    assert EventKind.HIT_PERSON not in kinds
    assert kinds.count(EventKind.PARKED) == VEHICLES
    ways = [row.parking.way for row in result.standings if row.parking]
    assert min(ways) > 15.0  # the starts are 20 to 40 m away, a slot is 3 m long


def test_the_replay_of_a_session_in_which_the_wheel_changed_hands_has_its_digest(
    recorded: tuple[RaceResult, Path],
) -> None:
    result, path = recorded
    recording = read_recording(path)
    rerun = Rerun(recording)
    assert sum(map(len, rerun.run())) > 0
    assert rerun.difference is None
    assert rerun.session.digest() == result.digest
    kinds = [entry.kind.name for entry in recording.entries if isinstance(entry, Intervention)]
    assert kinds == ["PARK", "WHEEL"] * VEHICLES


def test_a_server_that_was_killed_goes_on_and_has_its_wheels_again(
    recorded: tuple[RaceResult, Path], valets: list[Beeline], tmp_path: Path
) -> None:
    _, path = recorded
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    path.unlink()
    recording = read_recording(cut)
    session, events = restore_session(recording, None)
    led = [seat.number for seat in session.seats if seat.is_led]
    assert led[0] == 0
    made = len(valets)
    with serving(session, folder=tmp_path) as server:
        outcome = server.resume(recording, events)
    assert len(valets) > made
    assert endings(outcome)[0] is Ending.PARKED


def test_a_recording_holds_what_was_drawn_for_the_round(recorded: tuple[RaceResult, Path]) -> None:
    _, path = recorded
    rounds = [to_json(line) for line in read_lines(path) if line and line.kind is LOTS]
    assert len(rounds) > 10  # two a second
    assert [goal["y"] for goal in rounds[0]["goals"]] == [goal["y"] for goal in rounds[-1]["goals"]]
    assert len(rounds[0]["goals"]) == VEHICLES


def test_a_driver_over_the_network_is_handed_its_order_and_parks() -> None:
    beeline = Beeline()
    with serving(lot_session(one_slot())) as server, running(server, 1) as live:
        run_driver(beeline, "beeline", address=live.address, session="lot")
        live.thread.join(20.0)
    (order,) = beeline.orders
    assert order.slot == (0.0, 0.0, 0.0, 3.0, 2.0)
    assert order.level.within == 0.5
    assert order.walls.shape == (4, 4)
    (row,) = live.results[0].standings
    assert row.parking is not None
    assert row.parking.ending is Ending.PARKED


def test_a_seat_that_does_not_drive_cannot_be_parked_and_no_seat_where_there_is_no_car_park(
    valets: list[Beeline],
) -> None:
    with serving(lot_session(open_lot(1))) as server:
        server.session.join("me", "lot")
        with pytest.raises(SeatError, match="no race is on"):
            server._steward.decide(Decision(TOKEN, "park", 0, -1.0, server._steward.challenge))
        server.session.start()
        with pytest.raises(SeatError, match=r"slot 1\.5 is no number of a slot"):
            server._steward.decide(Decision(TOKEN, "park", 0, 1.5, server._steward.challenge))
    assert valets == []


class Standing(Beeline):
    """Is told to park, and stands."""

    def act(self, observation: Observation) -> Control:
        """Return a full brake."""
        return Control(brake=1.0)


def test_a_driver_asks_to_be_parked_and_takes_the_wheel_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = [Standing(), Beeline()]
    valets = iter(made)
    monkeypatch.setattr("race_server.live.server.wheels.driver_named", lambda _: next(valets))
    with serving(lot_session(one_slot(), limit_s=3600.0)) as server, running(server, 1) as live:
        session = server.session
        with ClientLink(live.address, "lot") as link:
            seat = take_seat(link, Join("me", "track"))
            seat.act(topics.READY)
            assert seat.receive(20.0) is not None  # and is not answered
            led = []
            for wanted in (True, False, True):
                seat.act(topics.PARK, ready=wanted)
                led.append(session.seats[0].is_led)
            live.thread.join(20.0)
    assert led == [True, False, True]
    assert [len(valet.orders) for valet in made] == [1, 1]
    assert endings(live.results[0]) == [Ending.PARKED]


def test_no_tick_waits_for_a_driver_that_has_handed_over_the_wheel(valets: list[Beeline]) -> None:
    session = lot_session(one_slot())
    with serving(session) as server:
        session.join("me", "track")
        session.start()
        assert session.waits_for() == [0]
        server._wheels.park(0)
        assert session.waits_for() == []
        server._wheels.release(0)
        assert session.waits_for() == [0]
    assert len(valets) == 1


def test_the_results_file_keeps_how_each_way_ended(valets: list[Beeline], tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    session = lot_session(open_lot(VEHICLES), VEHICLES, level="report-a-2", limit_s=8.0)
    with Store(path) as store, Writer(store, print) as writer, serving(session, fill="x") as server:
        server._persistence._keeper = Keeper(writer)
        result = server.run(0)
    assert result is not None
    (race,) = races(path)
    rows = [(row["ending"], row["way"], row["moves"]) for row in race["entries"]]
    assert rows == [("late", 0.0, 0)] * VEHICLES  # all of them wait
    assert valets == []


def test_a_server_without_a_parking_driver_says_so_and_records_nothing() -> None:
    with serving(lot_session(open_lot(1))) as server:
        server.session.join("me", "lot")
        server.session.start()
        server.session.journal.is_recorded = True
        server._wheels._valet = "no-valet"
        with pytest.raises(SeatError, match="driver 'no-valet' is unknown"):
            server._steward.decide(Decision(TOKEN, "park", 0, -1.0, server._steward.challenge))
        assert server.session.journal.drain() == []
