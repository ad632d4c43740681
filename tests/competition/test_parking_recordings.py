"""Tasks of an exam that failed, driven again in a session."""

import json
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from race_agents.commands.exam import app
from race_server.competition.parking_exam import ExamSpec, drive_exam
from race_server.competition.parking_recordings import record_tasks
from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control, Ending
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.errors import RecordingError
from race_server.scenario.places import own_folder
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.rerun import Rerun

pytestmark = pytest.mark.live

SEED = 7


class Brake:
    """Never comes to its slot."""

    preset = "lot"
    orders: list[ParkingOrder]

    def __init__(self) -> None:
        self.orders = []

    def reset(self, briefing: Briefing) -> None:
        assert briefing.decision_s == 0.1

    def park(self, order: ParkingOrder) -> None:
        self.orders.append(order)

    def act(self, _: Observation) -> Control:
        return Control(brake=1.0)


def test_a_lot_given_by_its_path_is_recorded_under_its_own_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a yard of long words, with a comma.toml"
    path.write_text((own_folder("lots") / "zone-30.toml").read_text(encoding="utf-8"))
    monkeypatch.setattr("race_server.live.local_drivers.driver_named", lambda _: Brake())
    spec = ExamSpec(str(path), [SEED], limit_s=1.0)
    tries = list(drive_exam(spec, "brake", lambda _: Brake()))
    (recorded,) = record_tasks(spec, "brake", tries, tmp_path / "failures", print)
    # 32 characters with the seed, as many as a session's name has.
    assert recorded.path.name.startswith("a-yard-of-long-words--with-a-c-7-")


def test_a_driver_that_raises_where_it_is_handed_a_slot_leaves_that_task_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Lost(Brake):
        def park(self, order: ParkingOrder) -> None:
            raise ValueError("no idea")

    spec, told = ExamSpec("zone-30", [SEED, SEED + 1], limit_s=1.0), list[str]()
    tries = list(drive_exam(spec, "brake", lambda _: Brake()))
    drivers = iter([Lost(), Brake()])
    monkeypatch.setattr("race_server.live.local_drivers.driver_named", lambda _: next(drivers))
    (recorded,) = record_tasks(spec, "brake", tries, tmp_path, told.append)
    assert recorded.seed == SEED + 1
    assert told == [f"seed {SEED} is not recorded: driver 'brake' raised ValueError: no idea"]


def failing(folder: Path, *more: str) -> Result:
    """Hold an exam whose one task fails, and record that into a folder."""
    words = ["parking", "--lot", "yard-70", "--seeds", "1", "--limit-s", "1"]
    return CliRunner().invoke(app, [*words, "--record", str(folder), *more])


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_server.competition.parking_exam.drive_exam", None)
    (tmp_path / "file").touch()
    refused = failing(tmp_path / "file")
    assert isinstance(refused.exception, RecordingError)
    assert "recordings cannot be written to" in str(refused.exception)


@pytest.mark.parametrize("form", ["table", "--json"])
def test_what_was_driven_is_told_where_it_cannot_be_recorded(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RecordingError("the disk is full")

    monkeypatch.setattr("race_server.competition.parking_recordings.record_tasks", fail)
    done = failing(tmp_path, *([form] if form == "--json" else []))
    assert str(done.exception) == "the disk is full"
    if form == "--json":
        document = json.loads(done.stdout)
        assert document["recordings"] == []
        assert document["rows"][0]["failures"] == {"late": 1}
    else:
        assert "late 1, seeds 1" in done.output


def test_a_failed_task_is_recorded_as_the_same_task_and_driven_again_it_has_its_digest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = ExamSpec("zone-30", [SEED], limit_s=1.0)
    told: list[Brake] = []

    def make(_: str) -> Driver:
        # Meanwhile another exam records into the folder.
        (tmp_path / f"yard-70-{len(told)}.journal.mcap").touch()
        told.append(Brake())
        return told[-1]

    monkeypatch.setattr("race_server.live.local_drivers.driver_named", make)
    (failed,) = drive_exam(spec, "brake", make)
    assert failed.figures["ending"] == "late"
    (recorded,) = record_tasks(spec, "brake", [failed], tmp_path, print)
    assert (recorded.seed, recorded.endings) == (SEED, (Ending.LATE,))
    examined, again = told[0].orders[0], told[-1].orders[0]
    assert again.slot == examined.slot == failed.order.slot
    rerun = Rerun(read_recording(recorded.path))
    for _ in rerun.run():
        pass
    assert rerun.difference is None
    body = rerun.session.world.bodies[0, 0]
    assert (body.x, body.y, body.heading) == pytest.approx(failed.start[:3])
