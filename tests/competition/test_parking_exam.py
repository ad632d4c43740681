"""The exam of parking: who may take it, what it asks, and what it tells."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_agents.commands.exam import app
from race_agents.commands.exam_gap import gap_of
from race_server.competition.parking_exam import FAULT, ExamSpec, Try, drive_exam
from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.envs.reality_gap import RealityGap
from race_server.errors import DriverError, LotError, ScenarioError
from support.lots import ONE_BAY

NAMES = ("hasty", "patient")


class Ahead:
    """Drives straight ahead, or raises an exception instead."""

    preset = "lot"

    def __init__(self, *, fails: bool = False) -> None:
        self.fails = fails

    def reset(self, briefing: Briefing) -> None:
        assert briefing.decision_s == pytest.approx(0.1)

    def park(self, order: ParkingOrder) -> None:
        assert order.slot.length == 3.0

    def act(self, observation: Observation) -> Control:
        if self.fails:
            raise ValueError("no idea")
        return Control(0.0, 0.5, 0.0)


def test_a_driver_that_goes_straight_ahead_parks_face_to_face_with_every_seed() -> None:
    tries = list(drive_exam(ExamSpec("face-to-face", range(3)), "ahead", lambda _: Ahead()))
    assert sorted(one.seed for one in tries) == [0, 1, 2]
    assert {one.figures["ending"] for one in tries} == {"parked"}


def test_more_tasks_than_worlds_are_driven_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_server.competition.parking_exam.SIDE_BY_SIDE", 2)
    seeds = [9, 2, 7, 4, 5]
    few = list(drive_exam(ExamSpec("1", seeds, limit_s=3.0), "ahead", lambda _: Ahead()))
    monkeypatch.setattr("race_server.competition.parking_exam.SIDE_BY_SIDE", 8)
    many = list(drive_exam(ExamSpec("1", seeds, limit_s=3.0), "ahead", lambda _: Ahead()))
    assert sorted(one.seed for one in few) == sorted(seeds)
    by_seed = {one.seed: (one.start.tolist(), one.figures) for one in many}
    assert all(by_seed[one.seed] == (one.start.tolist(), one.figures) for one in few)


def test_a_driver_that_raises_fails_its_tasks_and_the_exam_goes_on() -> None:
    spec = ExamSpec("face-to-face", range(2), limit_s=1.0)
    tries = list(drive_exam(spec, "lost", lambda _: Ahead(fails=True)))
    assert [one.figures["ending"] for one in tries] == [FAULT, FAULT]
    assert {one.fault for one in tries} == {"ValueError: no idea"}


def test_a_driver_that_raises_where_it_is_handed_a_slot_fails_that_task_alone() -> None:
    class Choosy(Ahead):
        def park(self, order: ParkingOrder) -> None:
            if order.slot.y > 0.0:
                raise ValueError("only slots in the south")

    tries = list(drive_exam(ExamSpec("1", range(9), limit_s=1.0), "choosy", lambda _: Choosy()))
    endings = {one.seed: one.figures["ending"] == FAULT for one in tries}
    assert endings == {one.seed: one.order.slot.y > 0.0 for one in tries}
    assert set(endings.values()) == {False, True}
    assert {one.fault for one in tries} == {"", "ValueError: only slots in the south"}


def test_a_factor_of_the_gap_is_given_once() -> None:
    with pytest.raises(ScenarioError, match=r"--gap mass=2: mass is given twice; give each factor"):
        gap_of(["mass=1.5", "hitch=1.1", "mass=2"])


def test_every_answer_but_the_first_is_timed() -> None:
    # In a second there are ten answers, of which the very first is not timed.
    tries = list(drive_exam(ExamSpec("1", range(2), limit_s=1.0), "ahead", lambda _: Ahead()))
    assert sorted(len(one.decisions_ms) for one in tries) == [9, 10]
    assert all((one.decisions_ms > 0.0).all() for one in tries)


def test_who_cannot_park_is_refused_in_one_sentence() -> None:
    with pytest.raises(DriverError, match="'avoider' cannot park: it takes no order"):
        next(drive_exam(ExamSpec("1", [1]), "avoider"))


def test_a_gap_makes_the_vehicle_another_one_than_its_driver_takes_it_for() -> None:
    # A third of the power: the kart that goes straight ahead is not there in the same time.
    weak = RealityGap(speed_coefficient=(0.3, 0.3))
    times = [
        next(drive_exam(ExamSpec("face-to-face", [1], gap=gap), "ahead", lambda _: Ahead()))
        for gap in (RealityGap(), weak)
    ]
    assert times[0].figures["time_s"] < 0.8 * times[1].figures["time_s"]


def test_a_gap_that_is_none_is_refused_with_the_factors_that_there_are() -> None:
    for text in ("hitch", "hitch=far", "glue=2", "action_delay=1"):
        told = CliRunner().invoke(app, ["trailer", "--gap", text])
        assert isinstance(told.exception, ScenarioError)
        assert f"--gap {text}: give FACTOR=VALUE" in str(told.exception)
    told = CliRunner().invoke(app, ["trailer", "--gap", "hitch=1.1", "--record", "failures"])
    assert "failures are recorded in sessions" in str(told.exception)


def test_questions_that_make_no_task_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"delay 0.05 s: drivers decide every 0.1 s"):
        next(drive_exam(ExamSpec("1", [1], delay_s=0.05), "ahead", lambda _: Ahead()))
    for delay_s in (math.nan, math.inf, -math.inf, -0.1, 99.0):
        with pytest.raises(ScenarioError, match=rf"delay {delay_s:g} s: drivers decide every"):
            next(drive_exam(ExamSpec("1", [1], delay_s=delay_s), "ahead", lambda _: Ahead()))
    for noise in (math.nan, math.inf, -0.1):
        with pytest.raises(ScenarioError, match=rf"lidar noise of {noise:g} m: choose 0 to 8 m"):
            next(drive_exam(ExamSpec("1", [1], noise=noise), "ahead", lambda _: Ahead()))
    for limit_s in (-5.0, 1e-9, math.nan, math.inf):
        with pytest.raises(ScenarioError, match=rf"time limit {limit_s:g} s: choose 1 to 3600 s"):
            next(drive_exam(ExamSpec("1", [1], limit_s=limit_s), "ahead", lambda _: Ahead()))
    for seed in (-1, 2**63):
        with pytest.raises(ScenarioError, match=r"none below zero or from 2\*\*63 on"):
            next(drive_exam(ExamSpec("1", [seed]), "ahead", lambda _: Ahead()))
    with pytest.raises(LotError, match="lot 'moon' is unknown"):
        next(drive_exam(ExamSpec("moon", [1]), "ahead", lambda _: Ahead()))


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (["--scenario", "face-to-face,moon"], "lot 'moon' is unknown"),
        (["--drivers", "valet,avoider"], "driver 'avoider' cannot park"),
    ],
)
def test_nothing_is_driven_where_a_later_lot_or_driver_makes_no_exam(
    wrong: list[str], sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drive(*_: object) -> None:
        raise AssertionError("an exam was driven")

    monkeypatch.setattr("race_server.competition.parking_exam.drive_exam", drive)
    words = ["parking", "--scenario", "face-to-face", "--seeds", "1", *wrong]
    refused = CliRunner().invoke(app, words)
    assert isinstance(refused.exception, ScenarioError | LotError | DriverError)
    assert sentence in str(refused.exception)


def test_more_tasks_than_anything_can_drive_are_refused() -> None:
    refused = CliRunner().invoke(app, ["parking", "--seeds", str(10**13)])
    assert refused.exit_code == 2
    assert "--seeds" in refused.output


def test_scenarios_1_and_2_are_those_of_the_report() -> None:
    one, two = ExamSpec("1"), ExamSpec("2")
    assert (one.lot, one.level_name) == ("zone-30", "report-a-1")
    assert (two.lot, two.level_name) == ("yard-70", "report-a-2")
    assert ExamSpec("2", level="precise").level_name == "precise"


def test_the_document_has_the_keys_that_were_promised_and_the_picture_is_drawn(
    tmp_path: Path,
) -> None:
    picture = tmp_path / "exam.png"
    words = ["parking", "--scenario", "face-to-face", "--seeds", "2", "--json"]
    twice = ["--drivers", "valet,valet"]  # is one driver
    done = CliRunner().invoke(app, [*words, *twice, "--plot", str(picture)])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert not document["stopped"]
    (row,) = document["rows"]
    promised = (
        "driver scenario success_rate aligned_rate collisions hit_people time_s_median "
        "path_m_median direction_changes_mean"
    )
    assert set(promised.split()) <= set(row)
    assert (row["driver"], row["success_rate"], row["failed_seeds"]) == ("valet", 1.0, {})
    assert row["path_ratio_median"] == pytest.approx(0.9, abs=0.2)
    assert picture.stat().st_size > 1000


def test_an_exam_that_is_stopped_tells_the_rows_that_were_finished(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drive = drive_exam

    def drive_the_first(spec: ExamSpec, name: str) -> Iterator[Try]:
        if name == "patient":
            raise KeyboardInterrupt
        yield from drive(spec, name, lambda _: Ahead())

    exam = "race_server.competition.parking_exam."
    monkeypatch.setattr(f"{exam}drive_exam", drive_the_first)
    monkeypatch.setattr(f"{exam}check_exam", lambda *_: None)
    monkeypatch.setattr("race_agents.commands.exam_parking.known_drivers", lambda _: NAMES)
    words = ["parking", "--scenario", "face-to-face", "--seeds", "1", "--json"]
    stopped = CliRunner().invoke(app, words)
    assert stopped.exit_code == 130
    document = json.loads(stopped.stdout)
    assert [row["driver"] for row in document["rows"]] == ["hasty"]
    assert document["stopped"]


def test_a_person_reads_a_table_and_the_seeds_of_failures() -> None:
    words = ["parking", "--scenario", "yard-70", "--seeds", "1", "--limit-s", "1"]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "160"})
    assert done.exit_code == 0, done.output
    assert "valet" in done.output
    assert "late 1, seeds 1" in done.output


def test_of_the_failures_it_is_told_which_no_driver_could_have_parked(tmp_path: Path) -> None:
    lot = tmp_path / "parted.toml"
    # Starts on both sides of a wall without a gate.
    text = ONE_BAY.replace("[5, 10]", "[4, 20]").replace("[5, 15]", "[9, 11]")
    lot.write_text(f"walls = [[12, 0, 12, 20]]{text}")
    words = ["parking", "--lot", str(lot), "--seeds", "6", "--first-seed", "1", "--limit-s", "40"]
    (row,) = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)["rows"]
    assert 0 < len(row["hopeless_seeds"]) < 6
    assert row["failed_seeds"] == {"late": row["hopeless_seeds"]}


def test_the_exam_of_trailers_counts_jack_knives_and_tells_of_long_decisions() -> None:
    words = ["trailer", "--lot", "dock-35", "--seeds", "1", "--limit-s", "1", "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    (row,) = json.loads(done.stdout)["rows"]
    assert (row["driver"], row["lot"], row["failures"]) == ("valet", "dock-35", {"late": 1})
    assert row["jack_knives"] == 0
    assert 0.0 < row["decision_ms_p95"] <= row["decision_ms_worst"]


def test_the_exam_of_trailers_is_none_for_a_kart() -> None:
    refused = CliRunner().invoke(app, ["trailer", "--lot", "face-to-face"])
    assert isinstance(refused.exception, ScenarioError)
    assert "'face-to-face' draws no trailer" in str(refused.exception)
