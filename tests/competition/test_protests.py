"""Protests: lodged while a result may change, decided once, and kept beside what was driven."""

import errno
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.event_state import Entrant, EventState, read_event
from race_server.competition.protest_desk import ProtestDesk
from race_server.competition.race_day.languages import language_of, translated
from race_server.competition.race_day.points import place_points
from race_server.competition.race_day.protest import (
    DISMISSED,
    DISQUALIFIED,
    UPHELD,
    Protest,
    result_of,
)
from race_server.competition.race_day.record import RaceRecord, TeamResult
from race_server.competition.race_day.tables import tables_of
from race_server.errors import SeatError
from race_server.storage.results.queries import races
from race_server.storage.whole_file import write_whole
from support.served_event import EVENING, Served, spec_of

pytestmark = pytest.mark.live


def driven(team: str, place: int, time_us: int) -> TeamResult:
    return TeamResult(team, place, 1, time_us, time_us, (time_us,), 0, 0, 0, 0, "")


RACE = RaceRecord("0a", (driven("Anna", 1, 10_000_000), driven("Bert", 2, 12_000_000)))


def desk_after(*records: RaceRecord, said: list[str] | None = None) -> ProtestDesk:
    """Return the desk of an evening of two teams after some drives: attempts, then a heat."""
    entrants = tuple(
        Entrant(seat, team, team, "lidar", "00") for seat, team in enumerate(("Anna", "Bert"))
    )
    tracks = dict.fromkeys("AB", "oval")
    state = EventState("cup", "2026-11-23", EVENING, tracks, "tt02", 1, "lockstep", False, entrants)
    day = state.day()
    for record in records:
        day.add(record)
    desk = ProtestDesk(day, state, None, lambda: (said or []).append("changed"))
    desk.block = day.driven[-1].block
    return desk


def attempts() -> tuple[RaceRecord, RaceRecord]:
    return tuple(RaceRecord("0a", (driven(team, 1, 9_000_000),)) for team in ("Anna", "Bert"))  # type: ignore[return-value]


def test_an_upheld_protest_adds_its_seconds_and_ranks_again() -> None:
    protest = Protest(1, 2, "Heat", "Bert", "Anna", "cut", "now", UPHELD, 5.0)
    first, second = result_of(RACE, [protest]).drives
    assert [(one.team, one.place, one.time_us) for one in (first, second)] == [
        ("Bert", 1, 12_000_000),
        ("Anna", 2, 15_000_000),
    ]
    assert second.remark == "+5 s protest 1"
    assert result_of(RACE, []) is RACE


def test_after_a_protest_the_better_best_lap_and_then_the_grid_decide_between_equal_times() -> None:
    laps_us = {"Anna": 9_900_000, "Bert": 9_000_000, "Carl": 9_000_000}
    times_us = {"Anna": 50_000_000, "Bert": 55_000_000, "Carl": 55_000_000}
    drives = tuple(
        replace(driven(team, place, times_us[team]), best_lap_us=laps_us[team])
        for place, team in enumerate(laps_us, start=1)
    )
    protest = Protest(1, 0, "Heat", "Bert", "Anna", "cut", "now", UPHELD, 5.0)
    found = result_of(RaceRecord("0a", drives, ("Carl", "Anna", "Bert")), [protest]).drives
    assert [(one.team, one.place) for one in found] == [("Carl", 1), ("Bert", 2), ("Anna", 3)]


def test_a_protest_is_decided_once_and_dismissed_it_changes_nothing() -> None:
    desk = desk_after(*attempts(), RACE)
    assert desk.lodge(1, 0, " cut the chicane ") == "protest 1: Bert against Anna, Heat, track B"
    assert desk.is_busy
    with pytest.raises(SeatError, match="Bert has protested against Anna already"):
        desk.lodge(1, 0, "cut it again")
    assert desk.decide(1, DISMISSED, 0.0, "marshal") == "protest 1 dismissed"
    assert not desk.is_busy
    with pytest.raises(SeatError, match="protest 1 is decided: dismissed"):
        desk.decide(1, UPHELD, 5.0, "marshal")
    (protest,) = desk._day.protests
    assert (protest.why, protest.verdict, protest.decided_by) == (
        *("cut the chicane", DISMISSED, "marshal"),
    )
    assert desk._day.results == desk._day.records


def test_a_team_that_is_disqualified_comes_last_and_no_lap_of_it_counts() -> None:
    desk = desk_after(*attempts(), RACE)
    assert desk.disqualify(0, "too light", "marshal") == "Anna disqualified, Heat, track B"
    first, second = desk._day.results[2].drives
    assert (first.team, first.place, second.team, second.place) == ("Bert", 1, "Anna", 0)
    assert (second.time_us, second.remark) == (0, "disqualified: too light")
    assert second.clean_laps_us() == []
    points = desk._day.ledger.heats()[0].points
    assert points == {"Bert": place_points(1, (), 0), "Anna": 0}
    assert desk._day.records[2] is RACE
    assert not desk.is_busy


def test_what_stewards_wrote_is_one_remark_and_stays_as_it_is_in_french() -> None:
    desk = desk_after(*attempts(), RACE)
    desk.disqualify(0, "too light; out", "marshal")
    table = next(one for one in tables_of(desk._day.plan, desk._day.ledger) if "Heat" in one.title)
    rows = translated(table, language_of("fr")).rows
    assert "disqualifié : too light, out" in [cell for row in rows for cell in row]


def test_a_protest_may_end_in_disqualification() -> None:
    desk = desk_after(*attempts(), RACE)
    desk.lodge(1, 0, "cut")
    assert desk.decide(1, DISQUALIFIED, 0.0, "marshal") == "protest 1 disqualified"
    assert [one.place for one in desk._day.results[2].drives] == [1, 0]


@pytest.mark.parametrize(
    ("verdict", "outcome"), [(UPHELD, "upheld, +5 s"), (DISQUALIFIED, DISQUALIFIED)]
)
def test_to_dismiss_a_decided_protest_takes_its_decision_back_until_the_stage_is_closed(
    verdict: str, outcome: str
) -> None:
    desk = desk_after(*attempts(), RACE)
    desk.lodge(1, 0, "cut")
    desk.decide(1, verdict, 5.0 if verdict == UPHELD else 0.0, "marshal")
    with pytest.raises(SeatError, match="to dismiss it takes that back"):
        desk.decide(1, UPHELD, 9.0, "marshal")
    block, desk.block = desk.block, ""
    with pytest.raises(SeatError, match=r"is decided: [^;]*$"):
        desk.decide(1, DISMISSED, 0.0, "marshal")
    desk.block = block
    said = desk.decide(1, DISMISSED, 0.0, "marshal")
    assert said == f"protest 1 dismissed, {outcome} taken back"
    assert desk._day.results == desk._day.records
    with pytest.raises(SeatError, match="there is no protest 2; known: 1"):
        desk.decide(2, DISMISSED, 0.0, "marshal")


def test_a_result_is_not_protested_against_once_its_stage_is_closed() -> None:
    desk = desk_after(*attempts())
    desk.block = ""
    with pytest.raises(SeatError, match="Anna has no result that may still change"):
        desk.lodge(1, 0, "cut")
    with pytest.raises(SeatError, match="no team of the event has seat 7"):
        desk.lodge(1, 7, "cut")
    with pytest.raises(SeatError, match="against itself"):
        desk.lodge(1, 1, "cut")


def test_a_protest_stands_in_event_file_results_file_and_sheet(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    day = served.run(protest_after=2, penalised=0, seconds=60.0)
    assert [row.team for row in day.ledger.classification()] == ["follow_gap", "raceline"]
    (path,) = tmp_path.glob("cup-*.event.json")
    state = read_event(path)
    assert [one.place for one in state.records[2].drives if one.team == "raceline"] == [1]
    assert state.day().ledger.classification() == day.ledger.classification()
    table = next(table for table in tables_of(day.plan, day.ledger) if table.title == "Protests")
    assert table.rows[0][2:] == ("follow_gap", "raceline", "cut the chicane", "upheld, +60 s")
    rows = {row["driver"]: row for row in races(tmp_path / "results.sqlite")[0]["entries"]}
    assert (rows["follow_gap"]["rank"], rows["raceline"]["rank"]) == (1, 2)
    assert rows["raceline"]["penalty_us"] == 60_000_000


def test_a_protest_that_a_full_disk_does_not_take_is_written_with_the_next_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[Path] = []

    def write(path: Path, text: str) -> None:
        if "cut the chicane" in text and len(refused) < 2:
            refused.append(path)
            raise OSError(errno.ENOSPC, "No space left on device")
        write_whole(path, text)

    monkeypatch.setattr("race_server.competition.event_state.write_whole", write)
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    day = served.run(protest_after=1, penalised=0, seconds=5.0)
    (path,) = tmp_path.glob("cup-*.event.json")
    assert len(refused) == 2  # it was lodged, and decided
    assert len(day.records) == 3
    assert [one.verdict for one in read_event(path).protests] == [UPHELD]
