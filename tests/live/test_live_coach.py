"""A coach beside a race: what it says of laps that it only sees, and whom it refuses."""

import json
import threading

import pytest
from click.testing import Result
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.competition.launch import free_address
from race_server.competition.lessons import lesson_of_driver
from race_server.competition.live_coach import LiveCoach
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.driver import driver_named
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import RaceError, ScenarioError
from race_server.live.client.driver import run_driver
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.hint import decode_hint
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.track.load import load_course
from race_server.session.session import Session
from support.servers import running
from support.sessions import session_on_ring

pytestmark = pytest.mark.live


def coached(*words: str) -> Result:
    return CliRunner().invoke(app, ["coach", *words])


def test_a_driver_of_a_race_is_told_the_same_as_alone_though_no_pedal_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    course, vehicle = load_course("hangar-400"), vehicle_named("kart-60")
    line = reference_line(course, vehicle, solve=True)
    rules = Rules(laps=3, items=False)
    session = Session("race", Scenario(course, 1, (vehicle,), rules, line=line))
    listens, ask = threading.Event(), LiveCoach.ask

    heard: list[bytes] = []

    def noted(coach: LiveCoach) -> None:
        ask(coach)
        listens.set()

    monkeypatch.setattr(LiveCoach, "ask", noted)
    with (
        ServerLink(free_address(), "race", 1) as link,
        running(RaceServer(session, link, LOCKSTEP), 1) as live,
        ClientLink(live.address, "race") as page,
    ):
        page.listen(topics.COACH, heard.append, 0)

        def drive() -> None:
            assert listens.wait(60.0)
            run_driver(driver_named("raceline"), "Ada", address=live.address)

        driver = threading.Thread(target=drive)
        driver.start()
        told = coached("--live", "--tell", "--connect", live.address, "--json")
        driver.join(60.0)
    assert told.exit_code == 0, told.output
    assert "Ada, lap 1" in told.stderr
    (lesson,) = json.loads(told.stdout)["lessons"]
    alone = lesson_of_driver(RunSpec("raceline", "hangar-400", "kart-60", laps=2)).as_json()
    assert lesson["driver"] == "Ada"
    assert lesson["best_s"] == pytest.approx(alone["best_s"], abs=0.005)
    kinds = [(tip["corner"], tip["fault"]) for tip in lesson["tips"]]
    assert set(kinds) & {(row["corner"], row["fault"]) for row in alone["corners"]}
    assert [lap["not_compared"] for lap in lesson["laps"]] == ["from the start", "", ""]
    hints = [decode_hint(data)[1] for data in heard]
    laps = [hint for hint in hints if not hint.is_cue]
    assert len(laps) < len(hints)
    assert [(hint.lap, hint.reason) for hint in laps] == [(1, "from the start"), (2, ""), (3, "")]
    assert laps[2].behind_us is not None
    assert {hint.corner for hint in hints if hint.is_cue} <= {
        row["corner"] for row in alone["corners"]
    }


def test_a_race_on_a_course_that_is_not_known_here_is_refused() -> None:
    with (
        ServerLink(free_address(), "race", 2) as link,
        running(RaceServer(session_on_ring("race"), link, LOCKSTEP), 2) as live,
    ):
        told = coached("--live", "--connect", live.address)
    assert isinstance(told.exception, RaceError)
    assert "ring" in str(told.exception)


def test_the_course_of_a_race_is_not_chosen_by_its_coach() -> None:
    told = coached("--live", "--track", "hangar-400")
    assert isinstance(told.exception, ScenarioError)
    assert "--track hangar-400: is of a driver that drives here" in str(told.exception)


@pytest.mark.parametrize("words", [(), ("raceline", "--live"), ("raceline", "--tell")])
def test_a_coach_has_one_source(words: tuple[str, ...]) -> None:
    told = coached(*words)
    assert isinstance(told.exception, ScenarioError)
    assert "--live" in str(told.exception)
