"""Lessons: from laps to corners, faults and tips."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.coaching.advice import tips_for
from race_server.coaching.corners import Corner
from race_server.coaching.faults import Fault, FaultKind
from race_server.coaching.lesson import Coach, Lesson
from race_server.competition import lesson_picture, lessons
from race_server.competition.lesson_picture import draw_lesson
from race_server.competition.lessons import lesson_of_driver
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import ScenarioError
from support.courses import SMALL_RING

T1, T2, T3, T4 = (Corner(f"T{n}", 0.0, 10.0, 15.0, 30.0, 40.0, 60.0, 1) for n in (1, 2, 3, 4))


@pytest.fixture(scope="module")
def lesson() -> Lesson:
    return lesson_of_driver(RunSpec("raceline", "hangar-400", "kart-60", laps=2))


def fault(corner: Corner, cost_s: float, kind: FaultKind = FaultKind.EARLY_BRAKES) -> Fault:
    return Fault(corner, kind, 6.0, "m", round(cost_s * 1e6))


def test_tips_are_the_three_faults_that_cost_most_and_come_back() -> None:
    often = [fault(T1, 0.1), fault(T2, 0.3), fault(T4, 0.05, FaultKind.COASTING)]
    laps = [[*often, fault(T3, 0.9)], often, [*often, fault(T3, 0.2, FaultKind.UNKNOWN)]]
    tips = tips_for(laps)
    # T3 was driven badly once, and lost time for another reason once.
    assert [tip.corner.name for tip in tips] == ["T2", "T1", "T4"]
    assert (tips[0].laps, tips[0].of, tips[0].cost_us) == (3, 3, 300_000)
    assert tips[0].words == "T2: brake 6 m later; the limit brakes 20 m before the apex"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (FaultKind.EARLY_BRAKES, "T1: lift 6 m later; no brakes are needed here"),
        (FaultKind.COASTING, "T1: stay on the throttle 6 m longer; no brakes are needed here"),
    ],
)
def test_where_the_limit_does_not_brake_no_tip_says_to(kind: FaultKind, words: str) -> None:
    (tip,) = tips_for([[fault(replace(T1, is_braked=False), 0.1, kind)]])
    assert tip.words == words


def test_what_has_no_name_is_the_last_tip() -> None:
    tips = tips_for([[fault(T1, 0.5, FaultKind.UNKNOWN), fault(T2, 0.1)]])
    assert [tip.kind for tip in tips] == [FaultKind.EARLY_BRAKES, FaultKind.UNKNOWN]


def test_without_laps_there_are_no_tips() -> None:
    assert tips_for([]) == ()


def test_the_costs_of_every_lap_add_up_to_what_it_is_behind(lesson: Lesson) -> None:
    document = lesson.as_json()
    assert len(document["laps"]) == 2
    for lap in document["laps"]:
        behind_us = round(1e6 * (lap["lap_s"] - document["limit_s"]))
        assert lap["line_us"] + sum(lap["corners_us"]) == lap["behind_limit_us"] == behind_us


def test_the_best_lap_costs_nothing_against_itself(lesson: Lesson) -> None:
    best = lesson.best
    assert best is not None
    assert best.against_best is not None
    assert [corner.total_us for corner in best.against_best.corners] == [0] * 5


def test_a_lap_that_is_not_compared_is_listed_with_its_reason(lesson: Lesson) -> None:
    laps = [(one.number, one.lap, "not clean" * (one.number == 1)) for one in lesson.laps]
    other = Coach(lesson.course, lesson.vehicle).lesson("raceline", laps)
    assert [one.number for one in other.compared] == [2]
    assert other.as_json()["laps"][0]["not_compared"] == "not clean"
    assert other.laps[0].against_limit is None


def test_a_report_is_drawn_but_not_without_a_lap(lesson: Lesson, tmp_path: Path) -> None:
    draw_lesson(lesson, tmp_path / "report.svg")
    assert "what to try" in (tmp_path / "report.svg").read_text()
    laps = [(one.number, one.lap, "in traffic") for one in lesson.laps]
    none = Coach(lesson.course, lesson.vehicle).lesson("raceline", laps)
    with pytest.raises(ScenarioError, match=r"no lap of raceline .*lap 1: in traffic"):
        draw_lesson(none, tmp_path / "none.png")
    with pytest.raises(ScenarioError, match=r"report.pdf: write the picture as"):
        draw_lesson(lesson, tmp_path / "report.pdf")


def test_pictures_of_several_drivers_are_named_by_their_seats(
    lesson: Lesson, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, drawn = tmp_path / "race.mcap", list[str]()
    by_seat = {0: lesson, 3: replace(lesson, laps=(), pieces=None), 5: lesson}
    monkeypatch.setattr(lessons, "lessons_of_recording", lambda *_: by_seat)
    monkeypatch.setattr(lesson_picture, "draw_lesson", lambda _, path: drawn.append(path.name))
    words = ["coach", str(recording), "--json", "--picture", str(tmp_path / "report.png")]
    told = CliRunner().invoke(app, words)
    assert len(json.loads(told.stdout)["lessons"]) == 3
    assert drawn == ["report-0.png", "report-5.png"]  # of seat 3 no lap is compared
    by_seat.update({0: by_seat[3], 5: by_seat[3]})
    told = CliRunner().invoke(app, words)
    assert len(json.loads(told.stdout)["lessons"]) == 3
    assert "report.png: nothing is drawn" in str(told.exception)


def test_a_circle_has_no_corner_to_teach() -> None:
    with pytest.raises(ScenarioError, match="has no corner for tt02"):
        Coach(SMALL_RING, vehicle_named("tt02"))


def test_the_command_prints_a_document_with_at_most_three_tips() -> None:
    words = ["coach", "raceline", "--laps", "1", "--json"]
    (document,) = json.loads(CliRunner().invoke(app, words).stdout)["lessons"]
    assert (document["track"], document["vehicle"]) == ("hangar-400", "kart-60")
    assert [row["corner"] for row in document["corners"]] == ["T1", "T2", "T3", "T4", "T5"]
    assert 0 < len(document["tips"]) <= 3
    assert all(np.isfinite(row["best_against_limit_s"]) for row in document["corners"])


def test_a_file_that_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "race.mcap"
    path.write_bytes(b"nothing")
    result = CliRunner().invoke(app, ["coach", str(path)])
    assert "is no recording" in str(result.exception)
    assert result.exit_code != 0
