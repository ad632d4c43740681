"""What spectators see of an event: it stands in the recording of each attempt and race."""

from pathlib import Path

import pytest

from race_server.competition.event_board import programme_of
from race_server.competition.event_ghosts import EventGhosts
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.plan import DayPlan, teams_of
from race_server.competition.race_day.protest import Protest
from race_server.competition.race_day.record import DeletedLap, RaceRecord, TeamResult
from race_server.core.messages import EventKind, EventPhase, Fault, Retirement
from race_server.core.vehicle_presets import TT02
from race_server.live.server.resume import restore_session
from race_server.logs import Log
from race_server.net.wire.ghosts import GhostFrame, decode_ghosts
from race_server.net.wire.programme import (
    Call,
    ProgrammeFrame,
    ProtestRow,
    decode_programme,
    encode_programme,
)
from race_server.net.wire.programme import DeletedLap as DeletedLapRow
from race_server.scenario.track.load import load_course
from race_server.storage.recording.channels import GHOSTS, PROGRAMMES
from race_server.storage.recording.reader import read_lines, read_recording
from support.served_event import EVENING, TRIAL, Served, spec_of

pytestmark = pytest.mark.live


def programmes(path: Path) -> list[ProgrammeFrame]:
    return [
        decode_programme(line.data) for line in read_lines(path) if line and line.kind is PROGRAMMES
    ]


def ghosts(path: Path) -> tuple[GhostFrame, ...]:
    lines = [line.data for line in read_lines(path) if line and line.kind is GHOSTS]
    return decode_ghosts(lines[0])[1] if lines else ()


def test_recordings_of_a_time_trial_show_who_drives_against_which_ghost_and_who_wins(
    tmp_path: Path,
) -> None:
    day = Served(spec_of(tmp_path), ("raceline", "follow_gap")).run()
    first, _, third, last = sorted(tmp_path.glob("cup-????????-??????-???.mcap"))
    begun = programmes(first)[0]
    assert (begun.phase, begun.driven, begun.drives, begun.attempts) == (
        EventPhase.ON_TRACK,
        0,
        4,
        2,
    )
    assert begun.now == Call("Time trial: raceline, attempt 1", ("raceline",))
    assert [call.teams for call in begun.coming] == [
        ("follow_gap",),
        ("raceline",),
        ("follow_gap",),
    ]
    assert [row.attempts_left for row in begun.teams] == [2, 2]
    assert ghosts(first) == ()
    (best,) = ghosts(third)
    times = {row.team: row.times_us for row in day.ledger.trials()[0].rows}
    assert (best.team, best.is_best, best.from_lights) == ("raceline", True, False)
    assert best.time_us == times["raceline"][0]
    assert best.distance[-1] > 0.99 * load_course("oval").length
    assert [(ghost.team, ghost.is_best) for ghost in ghosts(last)] == [
        ("raceline", True),
        ("follow_gap", False),
    ]
    over = programmes(last)[-1]
    assert [(row.name, row.place, row.attempts_us) for row in over.teams] == [
        ("raceline", 1, times["raceline"]),
        ("follow_gap", 2, times["follow_gap"]),
    ]
    assert over.driven == 4


def test_an_attempt_that_stewards_start_again_has_its_ghost(tmp_path: Path) -> None:
    Served(spec_of(tmp_path), ("raceline", "follow_gap")).run(race=2, restart_at_tick=60)
    for path in sorted(tmp_path.glob("cup-????????-??????-???.mcap"))[2:]:
        epoch = read_recording(path).start.epoch
        lines = [line.data for line in read_lines(path) if line and line.kind is GHOSTS]
        assert {decode_ghosts(line)[0] for line in lines} == {epoch}
    assert epoch == 5


def test_an_attempt_whose_recording_comes_late_is_a_ghost_from_then_on(tmp_path: Path) -> None:
    day = Served(spec_of(tmp_path), ("raceline",)).run()
    recordings = sorted(tmp_path.glob("cup-????????-??????-???.mcap"))
    ghosts = EventGhosts(tmp_path, "cup-*.mcap", day.event, Log())
    trial = day.ledger.trials()[0]
    for path in recordings:
        path.rename(path.with_suffix(".part"))
    assert ghosts.for_attempt(trial, "raceline", {"raceline": 0}) == ()
    for path in recordings:
        path.with_suffix(".part").rename(path)
    (best,) = ghosts.for_attempt(trial, "raceline", {"raceline": 0})
    assert best.time_us == min(trial.rows[0].times_us)


def result_of(team: str, place: int, lap_us: int, deleted: tuple[DeletedLap, ...]) -> TeamResult:
    laps = (lap_us, lap_us)
    return TeamResult(team, place, 2, 2 * lap_us, lap_us, laps, 0, 1, 0, 0, "", deleted)


def test_a_deleted_lap_is_shown_with_its_reason_and_a_failed_attempt_as_zero() -> None:
    plan = DayPlan(TRIAL, teams_of(["Anna", "Bert"]), {"A": load_course("oval")}, TT02, 1)
    fault = DeletedLap(2, "touched a border")
    record = RaceRecord("0a", (result_of("Anna", 1, 7_000_000, (fault,)),))
    day = Day(plan, "cup", [record])
    frame = programme_of(day, day.next, EventPhase.CALLED, {"Anna": 0, "Bert": 1})
    anna = next(row for row in frame.teams if row.name == "Anna")
    assert (anna.place, anna.attempts_us, anna.attempts_left, anna.time_us) == (0, (0,), 1, 0)
    assert anna.deleted == (DeletedLapRow(1, 2, "touched a border"),)


def test_an_event_with_one_more_record_leaves_the_event_itself_as_it_was() -> None:
    courses = dict.fromkeys("AB", load_course("oval"))
    day = Day(DayPlan(EVENING, teams_of(["Anna", "Bert"]), courses, TT02, 1), "cup")
    record = RaceRecord("0a", (result_of("Anna", 1, 7_000_000, ()),))
    later = day.with_record(record)
    assert later.next is not None
    assert later.next.title == "Qualification: Bert, attempt 1"
    assert (day.records, len(later.records)) == ([], 1)
    assert day.next is not None
    assert day.next.title == "Qualification: Anna, attempt 1"


def test_protests_and_what_may_still_change_survive_the_wire() -> None:
    plan = DayPlan(TRIAL, teams_of(["Anna", "Bert"]), {"A": load_course("oval")}, TT02, 1)
    day = Day(plan, "cup", [RaceRecord("0a", (result_of("Anna", 1, 7_000_000, ()),))])
    title = day.driven[0].title
    day.rule((Protest(1, 0, title, "Bert", "Anna", "cut", "now"),))
    seats = {"Anna": 0, "Bert": 1}
    frame = programme_of(day, day.next, EventPhase.CALLED, seats)
    assert decode_programme(encode_programme(frame)) == frame
    assert frame.protests == (ProtestRow(1, title, "Bert", "Anna", "cut", ""),)
    assert {row.name: row.can_change for row in frame.teams} == {"Anna": True, "Bert": False}
    over = programme_of(day, day.next, EventPhase.OVER, seats)
    assert not any(row.can_change for row in over.teams)


def test_why_stewards_removed_a_kart_stands_in_results_and_in_the_recording(
    tmp_path: Path,
) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    day = served.run(race=2, remove_at_tick=300, penalised=0)
    why = "removed by the stewards: rammed others, lap 1"
    assert {one.team: (one.place, one.remark) for one in day.results[2].drives} == {
        "follow_gap": (1, ""),
        "raceline": (0, why),
    }
    heat = sorted(tmp_path.glob("cup-????????-??????-???.mcap"))[-1]
    assert {row.name: row.remark for row in programmes(heat)[-1].teams}["raceline"] == why
    session, events = restore_session(read_recording(heat), None)
    assert session.digest() == day.records[2].digest
    assert (EventKind.RETIRED, 0, Retirement.REMOVED, Fault.RAMMING) in [
        (event.kind, event.kart, event.other, event.value) for event in events
    ]
