"""A lorry in a running session: recorded, driven again, killed and taken up."""

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.driver import Briefing
from race_server.core.messages import Control, Ending
from race_server.core.observation import Observation
from race_server.core.vehicle_presets import LORRY
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.live.server.resume import restore_session
from race_server.net.transport import ServerLink
from race_server.scenario.parking import parking_scenario
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.rerun import Rerun

pytestmark = pytest.mark.live


class Weaver:
    """Drives forward in a slalom, so that the hitch bends to both sides."""

    preset = "lot_trailer"

    def reset(self, briefing: Briefing) -> None:
        assert briefing.vehicle == LORRY

    def act(self, observation: Observation) -> Control:
        return Control(0.2 * math.sin(observation.tick / 30.0), 0.5)


@contextmanager
def serving(session: Session, folder: Path) -> Iterator[RaceServer]:
    with ExitStack() as stack:
        link = stack.enter_context(ServerLink(free_address(), "lot", 1))
        book = stack.enter_context(Logbook(folder, "lot", print))
        yield RaceServer(session, link, LOCKSTEP, ("weaver",), logbook=book)


def bend(session: Session) -> float:
    """Return the angle at the hitch [rad]."""
    body = session.world.bodies[0, 0]
    return float(body.heading - body.trailers[0].heading)


def test_a_lorry_is_recorded_driven_again_and_taken_up_after_a_kill(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_server.live.local_drivers.driver_named", lambda _: Weaver())
    session = Session("lot", parking_scenario("grid-150", limit_s=15.0))
    with serving(session, tmp_path) as server:
        result = server.run(0)
    assert result is not None
    assert [row.parking.ending for row in result.standings if row.parking] == [Ending.LATE]
    (path,) = tmp_path.glob("*.mcap")
    rerun = Rerun(read_recording(path))
    assert sum(map(len, rerun.run())) > 0
    assert rerun.difference is None
    assert rerun.session.digest() == result.digest
    assert bend(rerun.session) == bend(session) != 0.0
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    path.unlink()
    recording = read_recording(cut)
    again, events = restore_session(recording, None)
    assert 0 < again.tick < 900
    assert bend(again) != 0.0
    with serving(again, tmp_path) as server:
        outcome = server.resume(recording, events)
    assert [row.parking.ending for row in outcome.standings if row.parking] == [Ending.LATE]
