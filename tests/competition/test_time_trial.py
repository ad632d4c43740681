"""Time trials: a run, reality gaps, runs in parallel, and the command."""

import io
import json
import os
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from race_server.cli.trial import trial
from race_server.competition.pool import SOLVING, Work, run_all
from race_server.competition.time_trial.figures import (
    LimitTime,
    TrialSummary,
    rows_of,
)
from race_server.competition.time_trial.gaps import GAPS, NONE, custom_gap, gaps_named
from race_server.competition.time_trial.lap import (
    PROGRESS,
    SPEED,
    TIME,
)
from race_server.competition.time_trial.limits import limits_of
from race_server.competition.time_trial.plan import TrialPlan, prepare
from race_server.competition.time_trial.run import (
    Attempt,
    Run,
    Tell,
    drive_run,
    lost_run,
    numbers_of,
)
from race_server.competition.time_trial.run_spec import (
    STANDING,
    RunSpec,
    on_the_mark,
    run_specs_of,
    scenario_of,
)
from race_server.competition.time_trial.save import RunLog
from race_server.competition.time_trial.table import beside_report_b, lap_rows
from race_server.core.driver import Briefing, driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.envs.reality_gap import RealityGap
from race_server.errors import ResultsError, ScenarioError
from race_server.live.local_drivers import briefing_for
from race_server.scenario.track.load import load_course
from race_server.session.session import Session
from race_server.storage.csv_table import write_csv
from race_server.terminal import Console
from support.trials import OVAL, PLACE, keep


class Faulty:
    """Follows the gap until the tenth decision, then does as it was told."""

    preset = "lidar"

    def __init__(self, fault: Callable[[], Control]) -> None:
        self.fault = fault
        self.inner = driver_named("follow_gap")

    def reset(self, briefing: Briefing) -> None:
        self.inner.reset(briefing)
        self.left = 10

    def act(self, observation: Observation) -> Control:
        self.left -= 1
        return self.fault() if self.left < 0 else self.inner.act(observation)


def drive_faulty(fault: Callable[[], Control], spec: RunSpec = OVAL) -> Run:
    return drive_run(spec, make=lambda _: Faulty(fault))


def raise_an_error() -> Control:
    raise ValueError("no gap")


def think_for_a_minute() -> Control:
    time.sleep(60.0)
    return Control()


# A run


def test_a_trial_runs_the_very_race_that_a_live_session_runs() -> None:
    spec = replace(OVAL, seed=7)
    course = load_course("oval")
    attempt = Attempt(spec, course, driver_named("follow_gap"))
    seed = int(attempt.batch.world.races["seed"][0])
    scenario = replace(scenario_of(spec, course), seed=seed)
    session, driver = Session("race", scenario), driver_named("follow_gap")
    seat = session.join("follow_gap", driver.preset, wanted=0)
    seat.is_ready = True
    driver.reset(briefing_for(session, seat))
    session.start()
    attempt.drive(lambda _: None)
    for decision in range(len(attempt.notes) - 1):
        session.observe()
        seen = Observation(session.tick, session.layout(driver.preset), session.view(0).copy())
        # A live server gets controls in single precision, as a trial does.
        steering, throttle, brake, _ = (float(x) for x in numbers_of(driver.act(seen)))
        control = Control(steering, throttle, brake)
        session.receive_control(0, session.epoch, decision + 1, session.tick, control)
        session.advance(3)
    assert len(attempt.marks) == 2
    # A session also numbers its own events; all else is the same to the bit.
    session.world.races["sequence"] = attempt.batch.world.races["sequence"]
    assert session.digest() == attempt.batch.digest()


def test_the_same_cell_gives_the_same_run_and_another_seed_another(driven: Run) -> None:
    spec = driven.spec
    assert drive_run(spec).digest == driven.digest
    assert drive_run(replace(spec, seed=2)).digest != driven.digest


def test_before_a_flying_start_comes_a_lap_that_does_not_count(driven: Run) -> None:
    assert [lap.number for lap in driven.laps] == [1, 2]
    assert all(lap.is_flying for lap in driven.laps)
    assert driven.laps[0].trace[SPEED, 0] > 1.0


def test_a_standing_start_counts_as_lap_1_but_not_as_a_flying_lap() -> None:
    run = drive_run(replace(OVAL, laps=2, start=STANDING))
    first, second = run.laps
    assert not first.is_flying
    assert second.is_flying
    assert first.time_us > second.time_us
    row = rows_of([run], {PLACE: LimitTime(None)})[0]
    assert row.median_lap_s == second.time_s
    assert row.standing_lap_s == first.time_s
    assert row.total_s == pytest.approx(first.time_s + second.time_s)


def test_a_lap_is_the_sum_of_its_sectors(driven: Run) -> None:
    for lap in driven.laps:
        assert sum(lap.sectors_us) == lap.time_us
        assert lap.trace[TIME, -1] == pytest.approx(lap.time_s)
        assert lap.trace[PROGRESS, [0, -1]] == pytest.approx((0.0, load_course("oval").length))


def test_each_seed_puts_the_car_a_little_elsewhere_on_its_mark() -> None:
    course, vehicle = load_course("oval"), scenario_of(OVAL, load_course("oval")).vehicles[0]
    shifts = [on_the_mark(course, vehicle, seed)[0] - course.grid[0] for seed in range(20)]
    aside = [float(np.hypot(*shift[:2])) for shift in shifts]
    assert 0.0 < max(aside) <= 0.25 * vehicle.width
    assert len({round(shift, 9) for shift in aside}) == 20


def test_a_course_without_a_place_to_start_from_is_told_as_such(tmp_path: Path) -> None:
    path = tmp_path / "thread.toml"
    words = 'form = "line"\nhalf_width = 0.1\npoints = [[0, 0], [9, 0], [9, 9], [0, 9]]'
    path.write_text(words)
    run = drive_run(RunSpec("raceline", str(path)))
    assert run.failed
    assert run.remark.startswith("the start grid of thread has no place: the course is too narrow")


def test_a_driver_that_raises_is_marked_and_keeps_what_it_drove() -> None:
    run = drive_faulty(raise_an_error)
    assert run.failed
    assert run.remark == "raised ValueError: no gap"


def test_a_driver_that_stalls_is_interrupted() -> None:
    run = drive_faulty(think_for_a_minute, replace(OVAL, decision_limit_s=0.05))
    assert run.failed
    assert run.remark == "stalled for 0.05 s"


def test_a_driver_that_stands_is_out_but_has_not_failed() -> None:
    run = drive_faulty(lambda: Control(brake=1.0))
    assert not run.failed
    assert run.remark.startswith("stood still for 10 s before the first lap at ")


def test_a_control_that_is_no_number_counts_as_zero() -> None:
    wild = Control(float("nan"), 1e300, -5.0)
    assert numbers_of(wild).tolist() == [0.0, 1.0, 0.0, 0.0]


# Gaps and runs


def test_single_figures_make_a_gap_of_their_own() -> None:
    gap = custom_gap(0.02, 0.05, 50.0)
    assert gap is not None
    assert (gap.lidar().noise, gap.lidar().dropout) == (0.02, 0.05)
    assert gap.reality == RealityGap(action_delay=(1.0, 1.0))
    assert custom_gap(None, None, None) is None


@pytest.mark.parametrize("figures", [(-1.0, None, None), (None, 2.0, None), (None, None, 30.0)])
def test_a_gap_out_of_range_is_refused(figures: tuple[float | None, ...]) -> None:
    with pytest.raises(ScenarioError, match=r"choose|give"):
        custom_gap(*figures)


def test_an_unknown_gap_or_start_is_named_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError, match="'rain' is unknown; choose from none, noise"):
        gaps_named(["rain"])
    with pytest.raises(ScenarioError, match="choose flying or standing"):
        run_specs_of(["ann"], ["oval"], ["tt02"], [NONE], [1], RunSpec("", "", start="rolling"))


def test_a_delay_makes_another_run_and_the_battery_draws_a_speed(driven: Run) -> None:
    late = drive_run(replace(OVAL, gap=GAPS["delay"]))
    assert late.digest != driven.digest
    assert late.draws["action_delay"] == 1.0
    weak = drive_run(replace(OVAL, gap=GAPS["battery"]))
    assert 0.9 <= weak.draws["speed_coefficient"] <= 1.1


# Side by side


def drive_as_named(spec: RunSpec, tell: Tell) -> Run:
    """Do what the driver's name says, in a process of the pool."""
    tell(0)
    if spec.driver == "dies":
        os._exit(3)
    if spec.driver == "solves":
        tell(SOLVING)
        time.sleep(0.7)
    if spec.driver == "is_stuck":
        tell(0)
        time.sleep(60.0)
    return Run(spec, remark="drove")


def test_a_process_that_dies_or_is_stuck_takes_no_other_run_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_server.competition.pool.SLACK_S", 0.2)
    names = ("dies", "solves", "is_stuck", "bob")
    specs = [RunSpec(name, "oval", decision_limit_s=0.2) for name in names]
    outcomes = run_all(Work(drive_as_named, lost_run), specs, 2)
    remarks = {number: run.remark for number, run in outcomes}
    assert remarks[0] == "its process died (exit status 3)"
    assert remarks[2] == "stuck in machine code, its process was ended"
    assert (remarks[1], remarks[3]) == ("drove", "drove")


# The command


def test_the_command_prints_rows_and_writes_what_it_is_asked_for(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    table, picture = tmp_path / "rows.csv", tmp_path / "laps.png"
    trial(
        drivers="follow_gap,follow_gap",  # which is one run
        tracks="oval",
        laps=1,
        gaps="none",
        dropouts=0.05,
        csv=table,
        plot=picture,
        jobs=1,
        results=str(tmp_path / "results.sqlite"),
        as_json=True,
    )
    document = json.loads(capfd.readouterr().out)
    wanted = {"driver", "track", "vehicle", "laps", "clean_lap_rate", "median_lap_s"}
    wanted |= {"best_lap_s", "limit_s", "ratio", "crashes"}
    assert [row["gap"] for row in document["rows"]] == ["none", "custom"]
    assert wanted <= set(document["rows"][0])
    assert document["rows"][0]["ratio"] > 0.98
    assert len(document["losses"]) == 1
    assert table.read_text().count("\n") == 3
    assert all((tmp_path / f"laps-{gap}.png").stat().st_size > 0 for gap in ("none", "custom"))


def test_nothing_is_driven_for_an_unknown_driver_or_a_newer_file(tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    with pytest.raises(ScenarioError, match="driver schumacher is unknown"):
        trial(drivers="avoider,schumacher", results=str(path))
    assert not path.exists()
    keep(path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("pragma user_version = 99")
    with pytest.raises(ResultsError, match="is from a newer race-server"):
        trial(drivers="avoider", results=str(path))


def test_tables_are_written_where_the_results_file_takes_nothing_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: RunLog) -> None:
        raise ResultsError("the disk is full")

    monkeypatch.setattr(RunLog, "finish", fail)
    kept, table = tmp_path / "results.sqlite", tmp_path / "table.csv"
    with pytest.raises(ResultsError, match="the disk is full"):
        trial(drivers="follow_gap", tracks="oval", laps=1, jobs=1, results=str(kept), csv=table)
    assert "follow_gap,oval" in table.read_text()


def test_our_laps_stand_below_those_of_the_report(driven: Run) -> None:
    spec = replace(driven.spec, track="covapsy-test-2023")
    row = rows_of([replace(driven, spec=spec)], {("covapsy-test-2023", "tt02"): LimitTime(None)})
    text = io.StringIO()
    Console(width=120, file=text).print(beside_report_b(row, {"follow_gap": "steers to the gap"}))
    assert "1:03.74" in text.getvalue()
    assert "steers to the gap" in text.getvalue()


def test_every_lap_is_a_row_of_a_table(driven: Run, tmp_path: Path) -> None:
    write_csv(lap_rows([driven]), tmp_path / "laps.csv")
    lines = (tmp_path / "laps.csv").read_text().splitlines()
    assert lines[0].startswith("driver,track,vehicle,gap,seed,lap,lap_s")
    assert len(lines) == 3


def test_a_track_that_no_line_fits_has_no_limit_but_a_reason() -> None:
    place = ("covapsy-train-2023", "kart-30")
    limits = limits_of([place])
    assert limits.times[place].time_s is None
    assert "no line fits" in limits.times[place].reason
    assert place not in limits.lines


def test_a_trial_against_an_unknown_ghost_does_not_begin(tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    keep(path)
    with pytest.raises(ResultsError, match="none: run a trial first"):
        prepare(TrialPlan((OVAL,), (NONE,), ghost="best", results=path))


def test_the_page_on_time_trials_names_every_figure_and_gap() -> None:
    page = (Path(__file__).parents[2] / "docs" / "time-trial.md").read_text()
    told = {"driver", "track", "vehicle", "gap", "seeds", "laps_wanted", "failed"}
    intervals_told = {"spread_low_s", "spread_high_s", "limit_reason"}
    figures = {field.name for field in fields(TrialSummary)} - told - intervals_told
    assert [name for name in (*sorted(figures), *GAPS) if f"`{name}`" not in page] == []
