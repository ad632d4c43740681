"""The ladder from here to another simulator, and what costs most on it."""

from dataclasses import replace

from race_server.competition.lap_exam import CourseTry
from race_server.competition.transfer import LADDER, TransferRow, rows_of

HELD = CourseTry("ann", "ring", 10, 5.0, (5.5,) * 10, clean=10, contacts=0, rescues=0)
NAMES = [rung.name for rung in LADDER]


def ladder(**changes: CourseTry) -> TransferRow:
    return TransferRow.of({name: changes.get(name, HELD) for name in NAMES})


def test_who_loses_nothing_has_no_factor() -> None:
    row = ladder()
    assert row.factor == ""
    assert row.here["clean_lap_rate"] == row.there["clean_lap_rate"] == 1.0
    assert row.here["ratio"] == 1.1


def test_the_change_that_loses_most_clean_laps_is_the_factor() -> None:
    row = ladder(
        tyres=replace(HELD, clean=9), steps=replace(HELD, clean=9), actuators=replace(HELD, clean=2)
    )
    assert row.factor == "actuators"
    assert row.there["clean_lap_rate"] == 0.2


def test_where_all_laps_are_clean_time_decides() -> None:
    slower = replace(HELD, times_s=(6.0,) * 10)
    assert ladder(tyres=slower, steps=slower, actuators=slower).factor == "tyres"


def test_decisions_are_no_part_of_the_other_simulator() -> None:
    assert ladder(decisions=replace(HELD, clean=0)).factor == ""


def test_a_ladder_that_was_stopped_is_no_row() -> None:
    assert rows_of([(name, HELD) for name in NAMES[:-1]]) == []
    assert [row.track for row in rows_of([(name, HELD) for name in NAMES])] == ["ring"]
