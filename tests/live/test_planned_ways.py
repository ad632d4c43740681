"""Ways that drivers of the server plan, and drives from outside measured against them."""

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Ending, PlannedWay, Standing
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError
from race_server.live.client.driver import run_driver
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.storage.recording.channels import LOTS, STANDINGS
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_lines
from race_server.storage.recording.to_json import to_json
from support.lots import Beeline, lot_session, one_slot
from support.servers import running

pytestmark = pytest.mark.live

PLAN = PlannedWay(time_s=10.0, path_m=20.0, direction_changes=1)
WAY = [[0.0, 1.0], [2.0, 1.0]]


class Planner(Beeline):
    """A beeline that says what it would have planned, at once."""

    def __init__(self, *, fails: bool = False) -> None:
        super().__init__()
        self.fails = fails
        self.asked: list[tuple[Floats, ParkingOrder]] = []

    def way_ahead(self) -> Floats:
        return np.array(WAY)

    def ask_plan(
        self, vehicle: Vehicle, start: Floats, order: ParkingOrder
    ) -> "Future[PlannedWay | None]":
        self.asked.append((start.copy(), order))
        answer: Future[PlannedWay | None] = Future()
        if self.fails:
            answer.set_exception(PlanError("the planner's process has ended"))
        else:
            answer.set_result(PLAN)
        return answer


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> Planner:
    """The driver that plans, whatever its name."""
    made = Planner()
    monkeypatch.setattr("race_server.live.server.yardstick.driver_named", lambda _: made)
    monkeypatch.setattr("race_server.live.local_drivers.driver_named", lambda _: made)
    return made


@contextmanager
def serving(folder: Path, *, fill: tuple[str, ...] = ()) -> Iterator[RaceServer]:
    session = lot_session(one_slot())
    with ServerLink(free_address(), "lot", 1) as link, Logbook(folder, "lot", print) as book:
        yield RaceServer(session, link, LOCKSTEP, fill, logbook=book, measures=True)


def parked_from_outside(folder: Path) -> Standing:
    """Return how a driver over the network did."""
    with serving(folder) as server, running(server, 1) as live:
        run_driver(Beeline(), "by hand", address=live.address, session="lot")
        live.thread.join(20.0)
    (row,) = live.results[0].standings
    assert row.parking is not None
    assert row.parking.ending is Ending.PARKED
    return row


def test_a_drive_from_outside_stands_beside_the_plan_for_the_same_task(
    planner: Planner, tmp_path: Path
) -> None:
    row = parked_from_outside(tmp_path)
    assert row.planned == PLAN
    assert row.as_json()["planned"] == {"time_s": 10.0, "path_m": 20.0, "direction_changes": 1}
    assert Standing.of_json(row.as_json()) == row
    ((start, order),) = planner.asked
    assert order.slot == (0.0, 0.0, 0.0, 3.0, 2.0)
    assert (start[:2] <= 0.0).all()  # where the lot lets vehicles start
    assert np.hypot(*start[:2]) > 1.0


def test_a_recording_ends_with_how_all_ended(planner: Planner, tmp_path: Path) -> None:
    row = parked_from_outside(tmp_path)
    (path,) = tmp_path.glob("*.mcap")
    tables = [to_json(line) for line in read_lines(path) if line and line.kind is STANDINGS]
    (last,) = tables[-1]["rows"]
    assert last["parking"]["ending"] == "parked"
    assert last["planned"] == row.as_json()["planned"]


def test_where_no_plan_is_made_the_drive_stands_alone(planner: Planner, tmp_path: Path) -> None:
    planner.fails = True
    row = parked_from_outside(tmp_path)
    assert row.planned is None
    assert "planned" not in row.as_json()


def test_a_driver_inside_shows_its_way_and_is_not_measured(
    planner: Planner, tmp_path: Path
) -> None:
    with serving(tmp_path, fill=("planner",)) as server:
        result = server.run(0)
    assert result is not None
    assert result.standings[0].planned is None
    assert planner.asked == []
    (path,) = tmp_path.glob("*.mcap")
    lots = [to_json(line) for line in read_lines(path) if line and line.kind is LOTS]
    assert lots[1]["ways"] == [{"seat": 0, "points": WAY}]
