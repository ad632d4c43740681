"""The exam of races: who meets whom where, its figures, and what is kept of it."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from race_agents.commands.exam import app
from race_server.competition import kept_outcomes, race_exam
from race_server.competition.pool import Work
from race_server.competition.race_exam import (
    KartOutcome,
    RaceOutcome,
    RaceTask,
    drive_race,
    hold_races,
    lost_race,
    race_rows,
    tasks_of,
)
from race_server.competition.race_picture import draw_ratings
from race_server.errors import ScenarioError

TWO = ("raceline", "idm")
SHORT = RaceTask("oval", TWO, seed=7, laps=1)


def in_this_process(
    work: Work[RaceTask, RaceOutcome], tasks: Sequence[RaceTask], _jobs: int, _report: Any
) -> Iterator[tuple[int, RaceOutcome]]:
    """Do the work of the pool of processes."""
    for number, task in enumerate(tasks):
        yield number, work.drive(task, lambda _: None)


def kart(driver: str, rank: int, *, has_finished: bool = True) -> KartOutcome:
    remark = "" if has_finished else "stood still"
    return KartOutcome(driver, rank, has_finished, 5, 0, 1, 2, 3, 4, remark)


def test_in_as_many_races_as_karts_each_driver_starts_once_from_each_place() -> None:
    drivers = ("raceline", "idm", "follow_gap")
    tasks = tasks_of(drivers, ("oval", "oval-report"), 6, 100, RaceTask("", (), 0, laps=2))
    assert [task.course for task in tasks] == ["oval", "oval-report"] * 3
    assert [task.seed for task in tasks] == [100, 101, 102, 103, 104, 105]
    for place in range(3):
        assert {task.drivers[place] for task in tasks[:3]} == set(drivers)
    assert {task.laps for task in tasks} == {2}


def test_a_driver_that_won_two_of_three_races_and_retired_once() -> None:
    outcomes = [
        RaceOutcome(SHORT, (kart("idm", 1), kart("raceline", 2))),
        RaceOutcome(SHORT, (kart("idm", 1), kart("raceline", 2))),
        RaceOutcome(SHORT, (kart("raceline", 1), kart("idm", 2, has_finished=False))),
        RaceOutcome(SHORT, failure="its process died"),
    ]
    rows = {row.driver: row for row in race_rows(outcomes)}
    row = rows["idm"]
    assert (row.starts, row.wins, row.rescues, row.wrong_way) == (3, 2, 9, 12)
    assert (row.wall_contacts, row.kart_contacts) == (3, 6)
    assert row.mean_place == pytest.approx(4.0 / 3.0)
    assert row.finish_rate == pytest.approx(2.0 / 3.0)
    assert row.finish_interval[0] < row.finish_rate < row.finish_interval[1]
    assert row.retired == {"oval seed 7": "stood still"}
    assert row.rating_interval[0] < row.rating < row.rating_interval[1]
    assert not rows["raceline"].retired


def test_two_karts_of_one_driver_that_retire_in_one_race_are_both_told() -> None:
    lost = (kart("idm", 2, has_finished=False), kart("idm", 3, has_finished=False))
    (row, _) = sorted(
        race_rows([RaceOutcome(SHORT, (kart("raceline", 1), *lost))]), key=lambda row: row.driver
    )
    assert row.retired == {"oval seed 7": "stood still / stood still"}


def test_a_row_counts_the_courses_on_which_its_driver_is_ahead_of_the_next() -> None:
    def race(course: str, first: str, second: str) -> RaceOutcome:
        return RaceOutcome(replace(SHORT, course=course), (kart(first, 1), kart(second, 2)))

    outcomes = [race(course, *TWO) for course in ("a", "a", "b", "b", "c")]
    outcomes += [race("b", *TWO[::-1]), race("c", *TWO[::-1])]
    first, second = race_rows(outcomes)
    assert (first.driver, first.ahead_on, first.courses) == ("raceline", 2, 3)
    assert (second.driver, second.ahead_on, second.courses) == ("idm", 0, 3)


def test_a_race_is_driven_to_its_end_and_the_same_again() -> None:
    told: list[int] = []
    one, other = drive_race(SHORT, told.append), drive_race(SHORT, told.append)
    assert one == other
    assert [kart.rank for kart in one.karts] == [1, 2]
    assert {kart.driver for kart in one.karts} == set(TWO)
    assert all(kart.has_finished and kart.laps == 1 for kart in one.karts)
    assert told[0] == -1  # its line is looked for first


def test_a_kart_that_is_late_by_more_than_the_limit_has_not_finished() -> None:
    late = RaceTask("oval", ("raceline", "no-such-driver", "idm"), 7, laps=1, finish_limit_s=0.01)
    rows = {kart.driver: kart for kart in drive_race(late, lambda _: None).karts}
    assert sum(kart.has_finished for kart in rows.values()) == 1
    assert "no-such-driver" in rows["no-such-driver"].remark
    assert [name for name, kart in rows.items() if kart.failed] == ["no-such-driver"]


def test_a_race_that_was_driven_is_not_driven_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven: list[RaceTask] = []

    def drive(task: RaceTask, _: Any) -> RaceOutcome:
        driven.append(task)
        return RaceOutcome(task, (kart("idm", 1), kart("raceline", 2)))

    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(race_exam, "run_all", in_this_process)
    monkeypatch.setattr(race_exam, "drive_race", drive)
    monkeypatch.setattr(race_exam, "rehearse", lambda *_: None)
    first = list(hold_races([SHORT], editions={"idm": "old"}))
    assert list(hold_races([SHORT], editions={"idm": "old"})) == first
    assert len(driven) == 1
    list(hold_races([SHORT], editions={"idm": "new"}))
    assert len(driven) == 2


def test_a_race_with_a_kart_that_was_out_by_the_clock_is_driven_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven: list[RaceTask] = []
    late = replace(kart("raceline", 2, has_finished=False), failed=True)

    def drive(task: RaceTask, _: Any) -> RaceOutcome:
        driven.append(task)
        return RaceOutcome(task, (kart("idm", 1), late))

    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(race_exam, "run_all", in_this_process)
    monkeypatch.setattr(race_exam, "drive_race", drive)
    monkeypatch.setattr(race_exam, "rehearse", lambda *_: None)
    assert list(hold_races([SHORT])) == list(hold_races([SHORT]))
    assert len(driven) == 2


def test_a_race_whose_process_died_says_so_and_counts_for_no_driver() -> None:
    outcome = lost_race(SHORT, "", "its process died (exit status 3)")
    assert outcome.failure == "its process died (exit status 3)"
    assert race_rows([outcome]) == []


@pytest.mark.parametrize(
    ("drivers", "message"),
    [
        (("idm",), "drivers idm: a race needs two different ones or more"),
        (("idm", "idm"), "drivers idm, idm: a race needs two different ones or more"),
        (TWO * 50, "100 drivers are named"),
    ],
)
def test_a_field_that_cannot_race_is_refused(drivers: tuple[str, ...], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        tasks_of(drivers, ("oval",), 1, 0, SHORT)


def test_the_picture_shows_each_driver(tmp_path: Path) -> None:
    rows = race_rows([RaceOutcome(SHORT, (kart("idm", 1), kart("raceline", 2)))])
    draw_ratings(rows, tmp_path / "races.svg")
    drawn = (tmp_path / "races.svg").read_text()
    assert "<!-- idm -->" in drawn
    assert "<!-- raceline -->" in drawn


def test_the_command_prints_a_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_outcomes, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(race_exam, "run_all", in_this_process)
    words = ["races", "--drivers", "raceline,idm", "--races", "2", "--courses", "1"]
    done = CliRunner().invoke(app, [*words, "--first-seed", "5", "--laps", "1", "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert {row["driver"] for row in document["rows"]} == set(TWO)
    assert {row["starts"] for row in document["rows"]} == {2}
    assert [race["task"]["seed"] for race in document["races"]] == [5, 6]
    assert not document["stopped"]
