"""Time trials: what a run is, what its laps say, what goes wrong, and what is kept of it."""

import io
import json
import os
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from race_server.cli.trial import trial
from race_server.competition.time_trial.figures import (
    LimitTime,
    TrialSummary,
    intervals,
    losses_of,
    rows_of,
)
from race_server.competition.time_trial.gaps import GAPS, NONE, Gap, custom_gap, gaps_named
from race_server.competition.time_trial.ghost import delta, ghost_of, save_lap, sector_deltas
from race_server.competition.time_trial.lap import (
    PROGRESS,
    SPEED,
    TIME,
    Mark,
    TrialLap,
    laps_of,
    time_at,
)
from race_server.competition.time_trial.limits import limits_of, trace_of_line
from race_server.competition.time_trial.plan import TrialPlan, prepare
from race_server.competition.time_trial.pool import run_all
from race_server.competition.time_trial.run import Attempt, Run, Tell, drive_run, numbers_of
from race_server.competition.time_trial.run_spec import (
    STANDING,
    RunSpec,
    on_the_mark,
    run_specs_of,
    scenario_of,
)
from race_server.competition.time_trial.save import RunLog, changes_of
from race_server.competition.time_trial.table import beside_report_b, lap_rows, write_csv
from race_server.core.clock import MICROSECONDS
from race_server.core.driver import Briefing, Driver, driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.rules.items import items
from race_server.envs.reality_gap import RealityGap
from race_server.errors import ResultsError, ScenarioError
from race_server.scenario.track.load import load_course
from race_server.session import Session
from race_server.storage.results.queries import all_laps, best_laps, laps_on, races, trace_of
from race_server.storage.results.store import Store, Trace

OVAL = RunSpec("follow_gap", "oval", laps=1)
PLACE = ("oval", "tt02")


@pytest.fixture(scope="module")
def driven() -> Run:
    """Return one run of two laps on the oval."""
    return drive_run(replace(OVAL, laps=2))


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
    session.join("follow_gap", driver.preset, wanted=0).is_ready = True
    driver.reset(briefing_of(scenario, driver, spec))
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


def briefing_of(scenario: Any, driver: Driver, spec: RunSpec) -> Briefing:
    return Briefing(
        0,
        scenario.vehicle_of(0),
        spec.laps_driven,
        driver.preset,
        0.05,
        tuple(item.name for item in items()),
        scenario.lidar.field,
        scenario.lidar.reach,
    )


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


# Laps out of notes


def test_laps_are_cut_at_the_line_and_interpolated() -> None:
    # 10 m a lap at 2 m/s, a note every 0.5 s from 1 m before the line.
    notes = [(0.5 * n, (9.0 + n) % 10.0, 9.0 + n, 0.0, 2.0, 0.0, 0.0) for n in range(14)]
    marks = [mark(0.5), mark(5.5)]
    (lap,) = laps_of(notes, marks, 10.0, flying=True)
    assert lap.time_s == 5.0
    assert time_at(lap.trace, np.array([0.0, 5.0, 10.0])) == pytest.approx([0.0, 2.5, 5.0])


def mark(end_s: float, time_s: float = 5.0) -> Mark:
    return Mark(round(end_s * MICROSECONDS), round(time_s * MICROSECONDS), (), True, 0, 0)


def test_a_slower_lap_falls_behind_where_it_is_slower() -> None:
    even = np.array([(0.0, 5.0, 10.0), (0.0, 5.0, 10.0)])
    late = np.array([(0.0, 5.0, 12.0), (0.0, 5.0, 10.0)])
    assert delta(late, even, np.array([5.0, 7.5, 10.0])) == pytest.approx([0.0, 1.0, 2.0])


def test_the_limit_as_a_lap_takes_its_time() -> None:
    line = limits_of([PLACE]).lines[PLACE]
    trace = trace_of_line(line, load_course("oval").length)
    assert trace[TIME, -1] == pytest.approx(line.time_s)
    assert (np.diff(trace[PROGRESS]) > 0.0).all()


# Figures


def a_lap(time_s: float, number: int = 1, *, clean: bool = True) -> TrialLap:
    time_us = round(time_s * MICROSECONDS)
    return TrialLap(number, time_us, (), True, clean, 0, 0, 0.0, 1.0, 1.0, np.zeros((6, 2)))


def a_run(*times: float, gap: Gap = NONE, seed: int = 1, **more: Any) -> Run:
    spec = RunSpec("ann", "oval", gap=gap, seed=seed, laps=4)
    laps = tuple(a_lap(time_s, number) for number, time_s in enumerate(times, 1))
    return Run(spec, laps=laps, **more)


def test_the_ratio_is_the_median_lap_to_the_limit() -> None:
    row = rows_of([a_run(12.0, 11.0, 10.0), a_run(13.0, seed=2)], {PLACE: LimitTime(10.0)})[0]
    assert row.median_lap_s == 11.5
    assert row.best_lap_s == 10.0
    assert (row.ratio, row.best_ratio) == (1.15, 1.0)


def test_laps_that_were_not_driven_are_not_clean() -> None:
    row = rows_of([a_run(10.0, 10.0, 10.0)], {PLACE: LimitTime(10.0)})[0]
    assert (row.laps, row.laps_wanted, row.clean_lap_rate) == (3, 4, 0.75)


def test_without_a_limit_the_ratio_is_empty_and_says_why() -> None:
    row = rows_of([a_run(10.0)], {PLACE: LimitTime(None, "no line fits")})[0]
    assert row.ratio is None
    assert row.limit_reason == "no line fits"


def test_a_driver_without_a_lap_has_a_row_with_its_remark() -> None:
    row = rows_of([a_run(remark="raised ValueError", failed=True)], {PLACE: LimitTime(10.0)})[0]
    assert (row.median_lap_s, row.ratio, row.laps) == (None, None, 0)
    assert (row.failed, row.remark) == (1, "raised ValueError")


def test_the_bootstrap_interval_covers_the_median_and_repeats() -> None:
    laps = [[10.0, 10.2, 10.4], [10.1, 10.3, 10.5]]
    (low, high), _ = intervals(laps)
    assert low is not None
    assert high is not None
    assert 10.0 <= low < 10.25 < high <= 10.5
    assert intervals(laps) == intervals(laps)


def test_one_lap_has_no_interval() -> None:
    assert intervals([[10.0]]) == ((None, None), (None, None))


def test_a_loss_is_told_against_the_nominal_car() -> None:
    runs = [a_run(10.0, 10.0), a_run(12.0, gap=GAPS["noise"], crashes=3)]
    (loss,) = losses_of(rows_of(runs, {PLACE: LimitTime(None)}))
    assert loss.median_ratio == 1.2
    assert loss.clean_lap_rate_change == -0.25
    assert loss.crashes_change == 3


# Gaps and cells


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
    if spec.driver == "is_stuck":
        tell(0)
        time.sleep(60.0)
    return Run(spec, remark="drove")


def test_a_process_that_dies_or_is_stuck_takes_no_other_run_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_server.competition.time_trial.pool.SLACK_S", 0.2)
    names = ("dies", "ann", "is_stuck", "bob")
    specs = [RunSpec(name, "oval", decision_limit_s=0.2) for name in names]
    remarks = {number: run.remark for number, run in run_all(specs, 2, drive=drive_as_named)}
    assert remarks[0] == "its process died (exit status 3)"
    assert remarks[2] == "stuck in machine code, its process was ended"
    assert (remarks[1], remarks[3]) == ("drove", "drove")


# What is kept


def keep(path: Path, *runs: Run) -> None:
    with RunLog(path) as ledger:
        for run in runs:
            ledger.add(run)
        assert ledger.finish() is None


def test_laps_of_a_trial_are_in_the_results_file_with_their_traces(
    driven: Run, tmp_path: Path
) -> None:
    path = tmp_path / "results.sqlite"
    keep(path, driven)
    (race,) = races(path)
    assert (race["pace"], race["track"], race["laps_driven"]) == ("trial", "oval", 2)
    assert [lap["time_us"] for lap in all_laps(path)] == [lap.time_us for lap in driven.laps]
    assert best_laps(path)[0]["driver"] == "follow_gap"
    columns = trace_of(path, race["id"], 0, 1)
    assert columns["speed"] == pytest.approx(driven.laps[0].trace[SPEED], abs=1e-5)


def test_a_car_with_a_gap_is_another_car_in_the_results_file(driven: Run, tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    spec = replace(driven.spec, gap=GAPS["battery"])
    keep(path, driven, replace(driven, spec=spec))
    assert {row["vehicle"] for row in best_laps(path)} == {"tt02", "tt02 (battery)"}


def test_a_file_that_is_locked_in_the_middle_loses_no_lap(driven: Run, tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("race_server.storage.results.schema.BUSY_S", 0.05)
        with RunLog(path) as ledger, closing(sqlite3.connect(path)) as other:
            other.execute("begin immediate")
            ledger.add(driven)
            beside = ledger.finish()
            assert "is locked by another program" in ledger.problem
    assert beside is not None
    assert len(all_laps(beside)) == 2
    assert all_laps(path) == []


def test_the_best_kept_lap_is_a_ghost_and_is_no_second_ahead_of_itself(
    driven: Run, tmp_path: Path
) -> None:
    path, course = tmp_path / "results.sqlite", load_course("oval")
    keep(path, driven)
    fastest = min(driven.laps, key=lambda lap: lap.time_us)
    ghost = ghost_of("best", course, "tt02", path)
    assert ghost.time_s == fastest.time_s
    assert sector_deltas(fastest.trace, ghost.trace, course) == pytest.approx((0, 0, 0), abs=1e-4)
    assert ghost_of("1/2", course, "tt02", path).time_s == driven.laps[1].time_s
    assert len(laps_on(path, track="oval", digest=course.digest)) == 2


def test_a_lap_of_a_live_race_is_a_ghost_by_its_sectors(driven: Run, tmp_path: Path) -> None:
    path, course, lap = tmp_path / "results.sqlite", load_course("oval"), driven.laps[0]
    with Store(path) as store:
        store.write([change for change in changes_of(driven) if not isinstance(change, Trace)])
    ghost = ghost_of("1/1", course, "tt02", path)
    assert ghost.name.endswith("by its sectors")
    assert sector_deltas(lap.trace, ghost.trace, course) == pytest.approx((0, 0, 0), abs=0.005)


def test_an_unknown_ghost_is_answered_with_those_that_there_are(
    driven: Run, tmp_path: Path
) -> None:
    path = tmp_path / "results.sqlite"
    keep(path, driven)
    with pytest.raises(ResultsError, match=r"no ghost '9/9' on oval .* 1/[12] \(follow_gap, tt02"):
        ghost_of("9/9", load_course("oval"), "tt02", path)


def test_a_lap_that_was_saved_is_a_ghost(driven: Run, tmp_path: Path) -> None:
    lap, course = driven.laps[0], load_course("oval")
    save_lap(lap.trace, tmp_path / "lap.csv")
    ghost = ghost_of(str(tmp_path / "lap.csv"), course, "tt02", None)
    assert ghost.time_s == pytest.approx(lap.time_s, abs=1e-5)
    with pytest.raises(ResultsError, match="no lap of hangar-400"):
        ghost_of(str(tmp_path / "lap.csv"), load_course("hangar-400"), "tt02", None)


def test_a_table_that_is_no_lap_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultsError, match="a lap has the columns time_s, progress"):
        ghost_of(str(tmp_path / "other.csv"), load_course("oval"), "tt02", None)


# The command


def test_the_command_prints_rows_and_writes_what_it_is_asked_for(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    table, picture = tmp_path / "rows.csv", tmp_path / "laps.png"
    trial(
        drivers="follow_gap",
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
