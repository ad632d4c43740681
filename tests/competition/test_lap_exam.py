"""The exam of laps: its courses, its figures, and what is kept of it."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from race_agents.commands.exam import app
from race_agents.commands.exam_laps import editions_of
from race_server.competition import kept_outcomes, lap_exam, lap_picture
from race_server.competition.lap_exam import (
    CourseTry,
    LapExamSpec,
    LapRow,
    courses_in,
    drawn_courses,
    drive_with_limit,
    examine,
    rows_of,
)
from race_server.competition.lap_picture import draw_laps
from race_server.competition.pool import Work
from race_server.competition.time_trial.gaps import gaps_named
from race_server.competition.time_trial.run import Run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.errors import RaceError, ScenarioError, TrackError
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.load import load_course


def one_try(course: str, clean: int, ratio: float) -> CourseTry:
    """Return a driver's two laps on a course whose limit is 10 s."""
    times = (10.0 * ratio, 10.0 * ratio)
    return CourseTry("raceline", course, 2, 10.0, times, clean, contacts=2 - clean, rescues=0)


def in_this_process(driven: list[RunSpec]) -> Any:
    """Return what stands in for the pool of processes, and notes the runs that it drives."""

    def run_all(
        work: Work[RunSpec, Run], specs: Sequence[RunSpec], _jobs: int, report: Any
    ) -> Iterator[tuple[int, Run]]:
        for number, spec in enumerate(specs):
            driven.append(spec)
            yield number, work.drive(spec, partial(report, number))

    return run_all


@pytest.fixture
def driven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[RunSpec]:
    """Return the runs of an exam, noted in the place of being driven; nothing else is kept."""
    runs: list[RunSpec] = []
    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(lap_exam, "run_all", in_this_process(runs))
    monkeypatch.setattr(lap_exam, "drive_with_limit", lambda spec, _: Run(spec))
    return runs


def test_three_of_four_laps_clean_on_one_of_two_courses() -> None:
    row = LapRow.of([one_try("a", 2, 1.02), one_try("b", 1, 1.06)])
    assert (row.courses, row.laps, row.contacts, row.rescues) == (2, 4, 1, 0)
    assert (row.clean_lap_rate, row.clean_course_rate) == (0.75, 0.5)
    assert row.ratio == pytest.approx(1.04)
    assert row.not_clean == {"b": 1}
    low, high = row.clean_lap_interval
    assert low < 0.75 < high


def test_a_lap_that_was_not_driven_is_not_clean() -> None:
    none = CourseTry("raceline", "a", 2, None, (), 0, 5, 1, "stood still for 10 s in lap 1")
    row = LapRow.of([none])
    assert (row.clean_lap_rate, row.ratio, row.rescues) == (0.0, None, 1)
    assert row.remarks == ("a: stood still for 10 s in lap 1",)


def test_courses_are_drawn_of_each_kind_in_turn_in_the_scale_of_the_vehicle() -> None:
    assert drawn_courses(4, 70, TT02) == (
        "generated:block:70",
        "generated:spline:71",
        "generated:circuit:72",
        "generated:block:73",
    )
    assert drawn_courses(2, 70, KART_60) == (
        "generated:spline:70:kart",
        "generated:circuit:71:kart",
    )


def test_each_gap_gets_a_row_of_its_own() -> None:
    nominal = [one_try("a", 2, 1.02), one_try("b", 2, 1.02)]
    late = [replace(one, gap="all", clean=1) for one in nominal]
    rows = rows_of([*nominal, *late])
    assert [(row.gap, row.clean_lap_rate) for row in rows] == [("none", 1.0), ("all", 0.5)]


def test_laps_of_the_warm_up_do_not_count() -> None:
    spec = LapExamSpec(("oval",), laps=5, warm_up=2, gaps=tuple(gaps_named(["none", "all"])))
    runs = spec.runs_of(["raceline"])
    assert [(run.gap.name, run.laps) for run in runs] == [("none", 6), ("all", 6)]
    assert runs[0].laps_driven == 7  # two of which are the warm-up


def test_courses_draw_different_gaps_and_drivers_on_one_course_the_same() -> None:
    spec = LapExamSpec(("oval", "s-curve"), gaps=tuple(gaps_named(["all"])))
    oval, curve, *others = (run.seed for run in spec.runs_of(["raceline", "idm"]))
    assert oval != curve
    assert others == [oval, curve]
    alone = replace(spec, courses=("folder/s-curve.toml",)).runs_of(["idm"])
    assert [run.seed for run in alone] == [curve]


def test_a_folder_without_courses_is_refused_by_its_name(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=f"{tmp_path}: no course file"):
        courses_in(tmp_path)


def test_a_file_that_describes_no_course_is_told_before_anything_is_driven(
    tmp_path: Path, driven: list[RunSpec]
) -> None:
    square, eight = "[0, 0], [9, 0], [9, 9], [0, 9]", "[0, 0], [9, 9], [9, 0], [0, 9]"
    for name, points in ("a", square), ("b", eight):
        words = f'form = "line"\nhalf_width = 1\npoints = [{points}]'
        (tmp_path / f"{name}.toml").write_text(words)
    with pytest.raises(TrackError, match=r"b\.toml: b: the line crosses itself"):
        list(examine(LapExamSpec(courses_in(tmp_path)), ("raceline",)))
    assert driven == []


def test_a_course_that_was_driven_is_not_driven_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven: list[RunSpec] = []
    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(lap_exam, "run_all", in_this_process(driven))
    (first,) = examine(LapExamSpec(("oval",), laps=1), ["raceline"])
    both = {one.driver: one for one in examine(LapExamSpec(("oval",), laps=1), ["raceline", "idm"])}
    assert [spec.driver for spec in driven] == ["raceline", "idm"]
    assert both["raceline"] == first
    assert (first.clean, first.contacts) == (1, 0)
    assert 0.98 < first.ratios[0] < 1.05


def test_what_an_earlier_solver_of_lines_led_to_is_not_taken_for_todays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    today = kept_outcomes.place_of("lap-exams", "oval")
    assert kept_outcomes.place_of("lap-exams", "oval") == today
    monkeypatch.setattr(kept_outcomes, "solver_digest", lambda: "an earlier one")
    assert kept_outcomes.place_of("lap-exams", "oval") != today


def test_what_earlier_code_of_a_session_led_to_is_not_taken_for_todays(tmp_path: Path) -> None:
    session = tmp_path / "session" / "laps.py"
    session.parent.mkdir()
    session.write_text("LAPS = 1")
    for name in ("live/local_drivers.py", "net/wire/drive.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    digest = kept_outcomes.deciding_digest.__wrapped__
    before = digest(tmp_path)
    assert digest(tmp_path) == before
    session.write_text("LAPS = 2")
    assert digest(tmp_path) != before


@pytest.mark.parametrize("name", kept_outcomes.DECIDING)
def test_what_decides_an_outcome_is_a_folder_or_a_file_of_the_package(name: str) -> None:
    assert (kept_outcomes.PACKAGE / name).exists()


def test_a_course_is_driven_again_once_its_limit_can_be_solved(
    driven: list[RunSpec], monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> None:
        raise RaceError("the reference limit needs CasADi")

    monkeypatch.setattr(lap_exam, "known_limit", lambda *_: None)
    spec = LapExamSpec(("oval",), laps=1)
    with monkeypatch.context() as without:
        without.setattr(lap_exam, "load_casadi", missing)
        list(examine(spec, ["raceline"]))
    monkeypatch.setattr(lap_exam, "load_casadi", lambda: None)
    for _ in range(2):  # no line fits, which the solver has found
        list(examine(spec, ["raceline"]))
    assert len(driven) == 2


def test_a_driver_whose_policy_has_changed_is_driven_again(driven: list[RunSpec]) -> None:
    spec = LapExamSpec(("oval",), laps=1)
    for edition in ("old", "old", "new"):
        list(examine(spec, ["learned:full"], {"learned:full": edition}))
    assert len(driven) == 2
    assert drive_with_limit is not lap_exam.drive_with_limit


def test_a_policy_is_known_by_its_content_behind_a_wrapper_too(tmp_path: Path) -> None:
    policy = tmp_path / "policy.onnx"
    drivers = [f"learned:{policy}", f"unstuck:learned:{policy}", "unstuck:follow_gap"]
    policy.write_bytes(b"old")
    old = editions_of(drivers)
    policy.write_bytes(b"new")
    new = editions_of(drivers)
    assert set(old) == set(new) == set(drivers[:2])
    assert len({old[drivers[0]], new[drivers[0]]}) == 2
    assert old[drivers[0]] == old[drivers[1]]
    assert new[drivers[0]] == new[drivers[1]]


def test_an_exam_tells_whose_limit_is_solved_and_in_which_lap_a_driver_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drive(spec: RunSpec, tell: Any) -> Run:
        tell(1)
        return Run(spec)

    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(lap_exam, "compile_once", lambda _: None)
    monkeypatch.setattr(lap_exam, "run_all", in_this_process([]))
    monkeypatch.setattr(lap_exam, "drive_run", drive)
    monkeypatch.setattr(lap_exam, "reference_limit", lambda *_: None)
    bundled = lap_exam.known_limit(load_course("oval"), bounds_of(TT02))
    monkeypatch.setattr(
        lap_exam, "known_limit", lambda course, _: bundled if course.name == "oval" else None
    )
    heard: list[str] = []
    spec = LapExamSpec(("oval", "generated:circuit:3"), laps=2)
    list(examine(spec, ["raceline"], watch=heard.append))
    # That of the oval comes with the package.
    assert heard == [
        "raceline, oval, lap 2",
        "limit of generated:circuit:3",
        "raceline, generated:circuit:3, lap 2",
    ]


def test_a_picture_shows_drivers_below_each_other(tmp_path: Path) -> None:
    tries = [one_try("a", 2, 1.02), one_try("b", 1, 1.06)]
    draw_laps([LapRow.of(tries)], tries, tmp_path / "laps.svg")
    assert "raceline" in (tmp_path / "laps.svg").read_text()


def test_of_an_even_number_of_laps_a_picture_shows_the_middle_of_the_two_in_the_middle() -> None:
    drawn: list[float] = []

    class Panel:
        def plot(self, ratio: float, *_: Any, **__: Any) -> None:
            drawn.append(ratio)

    two = replace(one_try("a", 2, 1.0), times_s=(10.0, 12.0))
    lap_picture._draw_times(Panel(), 0, [two])
    assert drawn == [pytest.approx(1.1)]


def test_a_driver_that_is_named_twice_is_examined_once(driven: list[RunSpec]) -> None:
    words = ["laps", "--drivers", "raceline,raceline", "--courses", "1", "--json"]
    (row,) = json.loads(CliRunner().invoke(app, words).stdout)["rows"]
    assert (row["driver"], row["courses"], row["laps"]) == ("raceline", 1, 5)
    assert len(driven) == 1


@pytest.mark.usefixtures("driven")
def test_a_picture_that_cannot_be_written_takes_no_figure_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise ScenarioError("laps.png cannot be written: no space left")

    monkeypatch.setattr(lap_picture, "draw_laps", full)
    words = ["laps", "--drivers", "raceline", "--courses", "1", "--json"]
    shown = CliRunner().invoke(app, [*words, "--plot", str(tmp_path / "laps.png")])
    assert "no space left" in str(shown.exception)
    assert json.loads(shown.stdout)["rows"][0]["driver"] == "raceline"


@pytest.mark.usefixtures("driven")
def test_the_rows_of_the_document_have_the_keys_that_were_promised() -> None:
    words = ["laps", "--drivers", "raceline", "--courses", "1", "--first-seed", "7", "--json"]
    shown = CliRunner().invoke(app, words)
    (row,) = json.loads(shown.stdout)["rows"]
    keys = "driver courses laps clean_lap_rate ratio contacts rescues"
    assert set(keys.split()) <= set(row)
    assert (row["driver"], row["courses"], row["laps"]) == ("raceline", 1, 5)
