"""Tasks of an exam that failed, driven again in a session."""

from pathlib import Path

import pytest

from race_server.competition.parking_exam import ExamSpec, drive_exam
from race_server.competition.parking_recordings import record_tasks
from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control, Ending
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.rerun import Rerun

pytestmark = pytest.mark.net

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


def test_a_failed_task_is_recorded_as_the_same_task_and_driven_again_it_has_its_digest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, told = ExamSpec("zone-30", [SEED], limit_s=1.0), []

    def make(_: str) -> Driver:
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
    assert (body.x, body.y, body.heading) == pytest.approx(failed.start)
