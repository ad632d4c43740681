"""Laps of a trial in the results file, and ghosts."""

import sqlite3
import zlib
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from race_server.competition.time_trial.gaps import GAPS
from race_server.competition.time_trial.ghost import ghost_of, save_lap, sector_deltas
from race_server.competition.time_trial.lap import COLUMNS, SPEED
from race_server.competition.time_trial.run import Run
from race_server.competition.time_trial.save import RunLog, changes_of
from race_server.errors import ResultsError
from race_server.scenario.track.load import load_course
from race_server.storage.results.queries import all_laps, best_laps, laps_on, races, trace_of
from race_server.storage.results.store import Store, Trace
from support.trials import keep

# What is kept


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
        impatient = partial(Store, busy_s=0.05)
        patch.setattr("race_server.competition.time_trial.save.Store", impatient)
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


@pytest.mark.parametrize(
    "change",
    ["columns = replace(columns, 'time_s', 't')", "numbers = (select numbers from made)"],
)
def test_a_kept_lap_whose_trace_makes_no_sense_is_no_ghost(
    driven: Run, tmp_path: Path, change: str
) -> None:
    path = tmp_path / "results.sqlite"
    keep(path, driven)
    with closing(sqlite3.connect(path)) as connection:
        still = zlib.compress(np.zeros((len(COLUMNS), 9), "<f4").tobytes())
        connection.execute("create temp table made as select ? as numbers", (still,))
        connection.execute(f"update trace set {change}")
        connection.commit()
    with pytest.raises(ResultsError, match=r"is damaged \(the trace of lap 1/1 .* is none\)"):
        ghost_of("1/1", load_course("oval"), "tt02", path)


@pytest.mark.parametrize("sectors", ["[1e400, 2, 3]", "[0, 0, 9000000]", "[-1, 2, 3]", "[" * 10**5])
def test_a_lap_whose_sectors_make_no_sense_is_a_ghost_of_constant_speed(
    driven: Run, tmp_path: Path, sectors: str
) -> None:
    path = tmp_path / "results.sqlite"
    keep(path, replace(driven, laps=driven.laps[:1]))
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("delete from trace")
        connection.execute("update lap set sectors = ?", (sectors,))
        connection.commit()
    speeds = ghost_of("1/1", load_course("oval"), "tt02", path).trace[SPEED]
    assert speeds.min() == pytest.approx(speeds.max())


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


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_a_lap_with_a_number_that_is_not_finite_is_no_ghost(
    driven: Run, tmp_path: Path, number: str
) -> None:
    path = tmp_path / "lap.csv"
    save_lap(driven.laps[0].trace, path)
    head, first, *rest = path.read_text().splitlines()
    for place in range(len(first.split(","))):
        words = rest[4].split(",")
        words[place] = number
        path.write_text("\n".join([head, first, *rest[:4], ",".join(words), *rest[5:]]))
        with pytest.raises(ResultsError, match="all numbers are finite"):
            ghost_of(str(path), load_course("oval"), "tt02", None)


def test_a_table_that_is_no_lap_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultsError, match="a lap has the columns time_s, progress"):
        ghost_of(str(tmp_path / "other.csv"), load_course("oval"), "tt02", None)
