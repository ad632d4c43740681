"""What a parking driver sees and answers in a session, beside what it does in training."""

from pathlib import Path

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core.clock import ticks_of
from race_server.core.messages import Event
from race_server.core.stages.sightings import REMEMBERED
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.rerun import Rerun
from race_server.tools.drills.park_answers import ROUNDING, compare_answers
from support.lots import Beeline, lot_session, open_lot

pytestmark = pytest.mark.live

LEARNED = "learned:parking-2"
PARKS_AT, LIMIT_S = 33, 8.0  # tick: between two decisions of the policy, which come every 6 ticks


def recorded(folder: Path, valet: str = LEARNED) -> Recording:
    """Return a session of 8 s in which the parking driver drives one of two vehicles."""
    session = lot_session(open_lot(2, people=2), 2, limit_s=LIMIT_S)
    advance = session.advance
    with Logbook(folder, "lot", print) as book, ServerLink(free_address(), "lot", 2) as link:
        server = RaceServer(session, link, LOCKSTEP, ("avoider",), logbook=book, valet=valet)

        def advance_and_park(ticks: int = 1) -> list[Event]:
            if session.tick == PARKS_AT:
                server._wheels.park(0)
            return advance(ticks)

        session.advance = advance_and_park  # type: ignore[method-assign]
        assert server.run(0) is not None
    (path,) = folder.glob("*.mcap")
    return read_recording(path)


def test_a_policy_sees_and_answers_in_a_session_what_it_does_in_training(tmp_path: Path) -> None:
    answers = compare_answers(recorded(tmp_path), LEARNED)
    assert answers.decisions > 100  # 20 a second
    assert answers.seen <= ROUNDING
    assert answers.answered <= ROUNDING
    assert answers.apart == 0


def test_answers_of_another_driver_differ_though_it_sees_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("race_server.live.server.wheels.driver_named", lambda _: Beeline())
        recording = recorded(tmp_path)
    answers = compare_answers(recording, LEARNED)
    assert answers.seen <= ROUNDING
    assert answers.apart > 50


def test_a_resumed_session_remembers_what_its_vehicles_have_seen(tmp_path: Path) -> None:
    recording = recorded(tmp_path)
    seen = []
    for is_blind in (False, True):
        rerun = Rerun(recording, is_blind=is_blind)
        for _ in rerun.run():
            pass
        sightings = rerun.session.world.sight.sightings
        # What was met longer ago is no longer remembered.
        sightings[sightings["seen"] < rerun.session.tick - ticks_of(REMEMBERED)] = 0
        seen.append(sightings)
    np.testing.assert_array_equal(*seen)
    assert seen[0]["seen"].any()
