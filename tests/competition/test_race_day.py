"""A whole race day on a small course, and drivers that do not behave."""

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.competition.race_day import race as race_module
from race_server.competition.race_day.day import run_day
from race_server.competition.race_day.formats import Format, Obstacles, Races, TimeTrial
from race_server.competition.race_day.picture import SUFFIXES
from race_server.competition.race_day.plan import DayPlan, teams_of
from race_server.competition.race_day.race import LocalRace
from race_server.competition.race_day.record import Team
from race_server.competition.race_day.report import day_document
from race_server.core.driver import Briefing, driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.vehicle_presets import TT02
from race_server.errors import RaceError, ScenarioError
from race_server.pictures import check_picture
from race_server.scenario.race import Rules, Scenario
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import all_laps, races
from race_server.storage.results.store import Store
from race_server.storage.results.writer import Writer
from support.courses import TINY_RING, ring

TINY = Format(
    "tiny",
    "Tiny",
    (
        TimeTrial("Qualification", "A", laps=1, failure_s=40.0),
        Races("Race", "A", laps=1, most=2),
    ),
)


class Circler:
    """Keeps to the ring with what it is told of its place on it."""

    preset = "track"

    def reset(self, briefing: Briefing) -> None:
        self.steps = 0

    def act(self, observation: Observation) -> Control:
        self.steps += 1
        if observation.scalar("lights") > 0.0:
            return Control(brake=1.0)
        offset = observation.scalar("lateral_offset")
        wanted = 0.103 - 0.5 * offset - observation.scalar("heading_error")
        return Control(steering=min(max(wanted / 0.314, -1.0), 1.0), throttle=0.3)


class Raiser(Circler):
    def act(self, observation: Observation) -> Control:
        if self.steps > 100:
            raise ZeroDivisionError("division by zero")
        return super().act(observation)


class Sleeper(Circler):
    def act(self, observation: Observation) -> Control:
        while self.steps > 70:
            try:
                time.sleep(0.001)
            except Exception:
                continue
        return super().act(observation)


class Quitter(Circler):
    def act(self, observation: Observation) -> Control:
        raise SystemExit(1)


class Mute(Circler):
    def act(self, observation: Observation) -> Control:
        return None  # type: ignore[return-value]


class Wild(Circler):
    def act(self, observation: Observation) -> Control:
        return Control(throttle=float("nan"))


class Forgetful(Circler):
    def reset(self, briefing: Briefing) -> None:
        raise KeyError("model.zip")


class Foreign(Circler):
    preset = "sonar"


class Lame(Circler):
    def act(self, observation: Observation) -> Control:
        return Control(brake=1.0)


DRIVERS = {
    kind.__name__.lower(): kind
    for kind in (Circler, Raiser, Sleeper, Quitter, Mute, Wild, Forgetful, Foreign, Lame)
}


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(race_module, "driver_named", lambda name: DRIVERS[name]())
    monkeypatch.setattr(race_module, "DECISION_S", 0.3)


def plan_of(*drivers: str, form: Format = TINY, seed: int = 1) -> DayPlan:
    return DayPlan(form, teams_of(drivers), {"A": TINY_RING}, TT02, seed)


def run(plan: DayPlan) -> tuple[dict[str, object], list[str]]:
    """Return the document of a day and what was announced."""
    heard: list[str] = []
    ledger = run_day(plan, None, heard.append)
    return day_document(plan, ledger), heard


def remarks(*drivers: str) -> list[str]:
    """Return the remark on each driver after one lap in one race; none for one that finished."""
    rules = Rules(laps=1, items=False, countdown_s=0.5, stuck_s=0.0, stopped_limit_s=5.0)
    race = LocalRace("test", Scenario(TINY_RING, karts=len(drivers), rules=rules), None)
    teams = teams_of(drivers)
    by_team = {drive.team: drive for drive in race.run(teams, 1).drives}
    assert all((by_team[team.name].place > 0) == (team.driver == "circler") for team in teams)
    return [by_team[team.name].remark for team in teams]


def test_teams_of_the_same_driver_have_names_of_their_own() -> None:
    assert [team.name for team in teams_of(("a", "b", "a"))] == ["a", "b", "a 2"]
    # "a 2" is a driver, so the second "a" is the third one in name.
    assert [team.name for team in teams_of(("a", "a", "a 2"))] == ["a", "a 3", "a 2"]
    assert [team.name for team in teams_of(("a 2", "a", "a"))] == ["a 2", "a", "a 3"]


def test_a_driver_that_raises_is_out_and_the_race_goes_on() -> None:
    assert remarks("raiser", "circler") == [
        "raised ZeroDivisionError: division by zero, lap 1",
        "",
    ]


def test_a_driver_that_ends_the_program_ends_its_race_only() -> None:
    assert remarks("quitter", "circler") == ["raised SystemExit: 1, lap 1", ""]


def test_a_driver_that_stalls_is_interrupted_and_out() -> None:
    assert remarks("circler", "sleeper") == ["", "no answer within 0.3 s, lap 1"]


def test_a_driver_that_answers_nonsense_is_out() -> None:
    mute, wild = remarks("mute", "wild")
    assert mute.startswith("raised AttributeError")
    assert wild.startswith("control out of range: 0.0, nan, 0.0")


def test_a_driver_that_cannot_get_ready_is_out_before_the_start() -> None:
    forgetful, foreign, _ = remarks("forgetful", "foreign", "circler")
    assert forgetful == "did not start: raised KeyError: 'model.zip'"
    assert foreign.startswith("did not start: observation 'sonar' is unknown")


def test_a_driver_that_stands_is_removed() -> None:
    assert remarks("lame", "circler") == ["stood for 5 s, lap 1", ""]


def test_a_session_may_be_run_again_with_other_teams() -> None:
    rules = Rules(laps=1, items=False, countdown_s=0.5, stuck_s=0.0)
    race = LocalRace("test", Scenario(TINY_RING, karts=1, rules=rules), None)
    first = race.run([Team("a", "circler")], 5)
    assert race.run([Team("b", "forgetful")], 5).drives[0].place == 0
    again = race.run([Team("a", "circler")], 5)
    assert (again.digest, again.drives) == (first.digest, first.drives)


def test_a_whole_day_goes_from_qualification_to_podium_whoever_fails() -> None:
    plan = plan_of("circler", "raiser", "circler", "forgetful", "circler")
    document, heard = run(plan)
    assert document["podium"] == ["circler", "circler 2", "circler 3"]
    places = [(row["place"], row["team"]) for row in document["classification"]]
    assert places[3:] == [(None, "raiser"), (None, "forgetful")]
    assert len(heard) == plan.drives() == 2 * 5 + 3
    assert heard[0] == "Qualification: circler, attempt 1"
    assert heard[-1] == "Race 3, track A"


def test_the_same_seed_gives_the_same_sheet() -> None:
    plan = plan_of("circler", "circler", "raiser")
    first, again = run(plan)[0], run(plan)[0]
    assert first == again
    assert run(replace(plan, seed=2))[0] != first


def test_a_sheet_of_an_unknown_kind_is_refused() -> None:
    with pytest.raises(
        ScenarioError, match=r"sheet.doc: write the picture as .png or .svg or .pdf"
    ):
        check_picture(Path("sheet.doc"), SUFFIXES)


def test_every_race_and_lap_of_the_day_is_in_the_results(tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    plan = plan_of("circler", "raiser")
    with Writer(Store(path), print) as writer:
        run_day(plan, Keeper(writer), lambda _: None)
    kept = races(path, limit=-1)
    names = [row["session"] for row in reversed(kept)]
    assert names == ["day-tiny-1-qualification"] * 4 + ["day-tiny-1-race"]
    assert all(row["ended"] == "finished" for row in kept)
    assert [lap["driver"] for lap in all_laps(path)] == ["circler"] * 3


def test_a_course_without_room_for_a_race_is_refused_before_anything_runs() -> None:
    plan = plan_of(*["circler"] * 11, form=Format("x", "X", (Races("Race", "A", 1, most=11),)))
    with pytest.raises(ScenarioError, match="ring has 10 places on its grid, race needs 11"):
        plan.check()


def test_obstacles_of_a_trial_are_the_same_for_all_and_other_with_another_seed() -> None:
    stage = TimeTrial("Trial", "A", obstacles=Obstacles())
    form = Format("x", "X", (stage,))
    wide = {"A": ring(radius=6.0, half_width=0.9)}
    one, two = (replace(plan_of("circler", form=form, seed=s), courses=wide) for s in (1, 2))
    assert one.course_of(stage).obstacles == one.course_of(stage).obstacles
    assert one.course_of(stage).obstacles != two.course_of(stage).obstacles


def test_the_command_prints_one_document_and_draws_the_sheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_server.competition.race_day.formats.format_named", lambda _: TINY)
    monkeypatch.setattr(race_module, "driver_named", driver_named)
    sheet = tmp_path / "sheet.png"
    words = ["day", "--drivers", "avoider,pure_pursuit", "--tracks", "oval", "--json"]
    result = CliRunner().invoke(app, [*words, "--sheet", str(sheet)])
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document["tracks"] == {"A": "oval"}
    assert document["podium"] == ["pure_pursuit", "avoider"]
    assert sheet.read_bytes().startswith(b"\x89PNG")


def call(*words: str) -> str:
    """Return the error of `race day` with these words."""
    result = CliRunner().invoke(app, ["day", *words])
    assert isinstance(result.exception, RaceError)
    assert result.stdout == ""
    return str(result.exception)


def test_an_unknown_driver_is_refused_with_the_known_ones() -> None:
    error = call("--drivers", "avoider,none_such")
    assert error.startswith("driver none_such is unknown; installed drivers are avoider, ")


def test_an_unknown_format_is_refused_with_the_known_ones() -> None:
    assert (
        call("--format", "1999")
        == "format '1999' is unknown; choose one of 2023, 2025, time-trial, or a .toml file"
    )


def test_a_list_without_a_driver_is_refused() -> None:
    assert call("--drivers", ",") == "a race day needs drivers: give one or more"


def test_a_track_that_the_vehicle_cannot_lap_is_refused() -> None:
    assert call("--vehicle", "kart-30").startswith("covapsy-base cannot be used on this day: 0.9")


def test_too_few_tracks_are_refused() -> None:
    assert "format 2025 needs 3" in call("--format", "2025", "--tracks", "covapsy-base")


def test_a_results_file_that_is_none_is_refused_before_driving(tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    path.write_text(json.dumps({"not": "a results file"}) * 99)
    assert str(path) in call("--results", str(path))
