"""The ladder from here to another simulator, each change alone, and what costs most."""

from dataclasses import replace

from race_server.competition.lap_exam import CourseTry
from race_server.competition.transfer import OUR_STEPS, OUR_TYRES, RUNGS, TransferRow, rows_of

HELD = CourseTry("ann", "ring", 10, 5.0, (5.5,) * 10, clean=10, contacts=0, rescues=0)
NAMES = [rung.name for rung in RUNGS]


def row_with(**changes: CourseTry) -> TransferRow:
    named = {name.replace("_", " "): one for name, one in changes.items()}
    return TransferRow.of({name: named.get(name, HELD) for name in NAMES})


def held(clean: int) -> CourseTry:
    return replace(HELD, clean=clean)


def test_a_driver_that_loses_nothing_has_no_factor() -> None:
    row = row_with()
    assert (row.factor, row.mends) == ("", "")
    assert row.here["clean_lap_rate"] == row.there["clean_lap_rate"] == 1.0
    assert row.here["ratio"] == 1.1


def test_the_change_that_loses_most_clean_laps_alone_is_the_factor() -> None:
    row = row_with(tyres=held(9), delay=held(4), sensors=held(7), actuators=held(2))
    assert row.factor == "delay"
    assert row.there["clean_lap_rate"] == 0.2
    assert {one["change"]: one["clean_lap_rate"] for one in row.alone}["sensors"] == 0.7


def test_a_driver_that_refused_to_drive_has_shown_no_cost() -> None:
    refused = replace(HELD, times_s=(), clean=0, failed=True)
    row = row_with(decisions_alone=refused, sensors=held(9))
    assert row.factor == "sensors"


def test_where_all_laps_are_clean_time_decides() -> None:
    slower = replace(HELD, times_s=(6.0,) * 10)
    assert row_with(tyres=slower, steps=slower, actuators=slower).factor == "tyres"


def test_a_change_that_wins_most_back_there_mends() -> None:
    row = row_with(actuators=held(2), steps=held(3), **{OUR_STEPS: held(2), OUR_TYRES: held(9)})
    assert row.mends == "tyres"
    assert [one["clean_lap_rate"] for one in row.undone] == [0.9, 0.2, 0.3]


def test_runs_that_were_stopped_make_no_row() -> None:
    assert rows_of([(name, HELD) for name in NAMES[:-1]]) == []
    assert [row.track for row in rows_of([(name, HELD) for name in NAMES])] == ["ring"]
