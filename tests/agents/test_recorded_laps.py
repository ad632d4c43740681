"""Demonstrations out of recordings: a drive in a live race teaches like one that was watched."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_agents.training import recorded
from race_agents.training.demonstrations import Demonstrations, pairs_for
from race_agents.training.demonstrator import demonstrate
from race_agents.training.settings_toml import read_settings
from race_server.cli.main import app
from race_server.competition.launch import free_address
from race_server.competition.time_trial.run import Attempt
from race_server.competition.time_trial.run_spec import RunSpec, scenario_of
from race_server.core.driver import driver_named
from race_server.errors import RecordingError
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.load import load_course
from race_server.session.interventions import Intervention, InterventionKind
from race_server.session.journal_entries import Inputs
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_recording

pytestmark = pytest.mark.live

CELL = RunSpec("follow_gap", "oval", seed=1, laps=1)


def record(scenario: Scenario, folder: Path) -> Path:
    """Return the recording of a race in which a driver fills all seats."""
    said: list[str] = []
    with (
        Logbook(folder, "cup", said.append) as book,
        ServerLink(free_address(), "cup", scenario.karts) as link,
    ):
        session = Session("cup", scenario)
        RaceServer(session, link, LOCKSTEP, (CELL.driver,), logbook=book).run(0)
    (path,) = folder.glob("*.mcap")
    return path


@pytest.fixture(scope="module")
def watched() -> Demonstrations:
    return demonstrate(CELL.driver, [CELL.track], CELL.vehicle, CELL.laps, CELL.seed, 0.0)[0]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A live race with the setting of a trial."""
    course = load_course(CELL.track)
    attempt = Attempt(CELL, course, driver_named(CELL.driver))
    seed = int(attempt.batch.world.races["seed"][0])
    scenario = with_line(replace(scenario_of(CELL, course), seed=seed), solve=True)
    return record(scenario, tmp_path_factory.mktemp("recordings"))


def test_a_recording_shows_what_was_shown_to_whoever_watched(
    watched: Demonstrations, recording: Path
) -> None:
    shown, drive = recorded.demonstrations_in(recording, 0)
    assert shown.about == watched.about
    assert np.array_equal(shown.controls, watched.controls)
    assert np.array_equal(shown.observations, watched.observations)
    assert drive.laps == 2  # before a flying start comes a lap


def test_a_command_makes_a_file_from_which_a_learner_learns(
    recording: Path, tmp_path: Path
) -> None:
    path = tmp_path / "laps.npz"
    words = ["demonstrate", "--recording", str(recording), "--seat", "0", "--out", str(path)]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    seen, actions = pairs_for(read_settings("time-trial-ppo", ["lidar.rays=21"]), path)
    assert len(seen) == len(actions) == json.loads(done.stdout)["decisions"]


def test_nothing_is_shown_while_the_lights_are_on_or_after_the_finish(tmp_path: Path) -> None:
    rules = replace(scenario_of(CELL, load_course("oval")).rules, laps=1, countdown_s=0.5)
    path = record(Scenario(load_course("oval"), karts=2, rules=rules), tmp_path)
    shown, drive = recorded.demonstrations_in(path, 1)
    lights = shown.observations[:, _place("lights", shown)]
    finished = shown.observations[:, _place("finished", shown)]
    assert not lights.any()
    assert not finished.any()
    assert drive.laps == 1
    last = read_recording(path).last_tick
    assert len(shown.observations) <= (last - 30) // 3 + 1


def test_what_the_parking_driver_of_the_server_drove_is_left_out(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, _ = recorded.demonstrations_in(recording, 0)
    led = read_recording(recording)
    # From tick 30 to tick 60 are ten decisions.
    for tick, has_wheel in ((30, 1.0), (60, 0.0)):
        place = next(n for n, entry in enumerate(led.entries) if entry.tick > tick)
        led.entries.insert(place, Intervention(tick, InterventionKind.WHEEL, 0, has_wheel))
    monkeypatch.setattr(recorded, "read_recording", lambda _: led)
    rest, _ = recorded.demonstrations_in(recording, 0)
    assert np.array_equal(rest.controls, np.delete(own.controls, np.s_[10:20], axis=0))
    assert np.array_equal(rest.observations, np.delete(own.observations, np.s_[10:20], axis=0))


def test_a_seat_that_only_the_parking_driver_of_the_server_drove_shows_nothing(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    led = read_recording(recording)
    led.entries.insert(0, Intervention(0, InterventionKind.WHEEL, 0, 1.0))
    monkeypatch.setattr(recorded, "read_recording", lambda _: led)
    with pytest.raises(RecordingError, match="only while the server's parking driver drove it"):
        recorded.demonstrations_in(recording, 0)


def _place(part: str, shown: Demonstrations) -> int:
    from race_server.core.observation import layout_of

    return layout_of(shown.about.parts, shown.about.lidar_rays).slices[part].start


def test_a_seat_that_shows_nothing_is_named(recording: Path) -> None:
    with pytest.raises(RecordingError, match=r"seat 3 is empty; choose one of 0 \(follow_gap\)"):
        recorded.demonstrations_in(recording, 3)


def test_a_race_that_is_another_one_here_shows_nothing(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = read_recording(recording)
    first = next(entry for entry in other.entries if isinstance(entry, Inputs))
    place = other.entries.index(first)
    other.entries[place] = replace(first, controls=np.zeros_like(first.controls))
    monkeypatch.setattr(recorded, "read_recording", lambda _: other)
    with pytest.raises(
        RecordingError, match="the simulated race differs from the recorded one from"
    ):
        recorded.demonstrations_in(recording, 0)


@pytest.mark.parametrize("words", [[], ["raceline", "--recording", "race.mcap"]])
def test_a_driver_or_a_recording_is_wanted(words: list[str]) -> None:
    done = CliRunner().invoke(app, ["demonstrate", *words])
    assert "give one of the two" in str(done.exception)
