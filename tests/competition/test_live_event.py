"""Events on the network: the same lap times as a trial, results that survive any end, decisions."""

import json
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.event_spec import (
    begin_event,
    check_free,
    event_ended_since,
    is_part_of,
    put_away,
    unfinished_event,
)
from race_server.competition.event_state import read_event
from race_server.competition.launch import free_address
from race_server.competition.live_event import LiveEvent
from race_server.competition.race_day.formats import Format, Races, TimeTrial, format_named
from race_server.competition.race_day.formats.reader import format_of, read_format, words_of
from race_server.competition.race_day.record import DeletedLap, RaceRecord, TeamResult
from race_server.competition.time_trial.run import drive_run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.driver import driver_named
from race_server.errors import ScenarioError, SeatError
from race_server.live.client.driver import run_driver
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.results.queries import races
from support.served_event import EVENING, Killed, Served, spec_of

pytestmark = pytest.mark.live


def files_of(folder: Path) -> list[Path]:
    return sorted(folder.glob("cup-*.event.json"))


def test_a_policy_laps_live_in_the_time_of_a_trial_to_the_microsecond(tmp_path: Path) -> None:
    drivers = ("raceline", "follow_gap")
    day = Served(spec_of(tmp_path), drivers).run()
    for row in day.ledger.trials()[0].rows:
        for number, attempt in enumerate(row.attempts, start=1):
            run = drive_run(RunSpec(row.team, "oval", laps=1, seed=number))
            assert attempt.lap_times_us[1:] == tuple(lap.time_us for lap in run.laps)
            assert row.times_us[number - 1] == run.laps[0].time_us
    assert [row.team for row in day.ledger.classification()] == ["raceline", "follow_gap"]
    kept = races(tmp_path / "results.sqlite")
    assert [race["format"] for race in kept] == ["time-trial"] * 4
    assert kept[0]["title"] == "Time trial: follow_gap, attempt 2"
    assert [entry["driver"] for entry in kept[0]["entries"]] == ["follow_gap"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[RaceRecord]:
    """The records of an evening that nothing interrupted: two attempts, two heats of one race."""
    folder = tmp_path_factory.mktemp("whole")
    return Served(spec_of(folder, EVENING), ("raceline", "follow_gap")).run().records


@pytest.mark.parametrize("race", [0, 2], ids=["in an attempt", "in a race"])
def test_a_server_that_is_killed_goes_on_where_it_was(
    whole: list[RaceRecord], race: int, tmp_path: Path
) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_at_tick=240, race=race)
    assert len(read_event(tmp_path / "cup.event.json").records) == race
    records = served.run().records
    # A driver that is made again has lost what it saw before: it may brake for a moment.
    first, again = whole[race].drives[0], records[race].drives[0]
    assert (again.team, again.place, again.laps) == (first.team, 1, 1)
    assert abs(again.time_us - first.time_us) < 500_000
    # Whatever was driven before and what does not depend on it after is the same.
    assert records[:race] == whole[:race]
    assert records[1] == whole[1]
    assert len(records) == 3
    (path,) = files_of(tmp_path)
    assert read_event(path).records == tuple(records)
    assert read_event(path).is_final
    kept = races(tmp_path / "results.sqlite")
    assert [row["ended"] for row in kept] == ["finished"] * 3
    assert kept[2 - race]["entries"][0]["race_time_us"] == again.time_us
    assert served.said == []


def test_a_race_that_ended_right_before_the_kill_is_not_driven_again(
    whole: list[RaceRecord], tmp_path: Path
) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_after_race=True, race=1)
    assert len(read_event(tmp_path / "cup.event.json").records) == 1
    assert served.run().records == whole
    assert len(list(tmp_path.glob("cup-*.mcap"))) == 3


def test_a_race_that_was_stopped_in_the_evening_is_driven_again_next_morning(
    whole: list[RaceRecord], tmp_path: Path
) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    with pytest.raises(AssertionError):  # the event is not over
        served.run(stop_at_tick=240, race=1)
    assert len(read_event(tmp_path / "cup.event.json").records) == 1
    assert served.run().records == whole
    ended = [race["ended"] for race in races(tmp_path / "results.sqlite")]
    assert sorted(ended) == ["finished", "finished", "finished", "stopped"]


def test_a_review_in_which_the_server_was_killed_begins_again_and_one_that_is_over_does_not(
    tmp_path: Path,
) -> None:
    spec = replace(spec_of(tmp_path, EVENING), review_s=0.05)
    served = Served(spec, ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_in_review=True)
    with pytest.raises(Killed):
        served.run(kill_at_tick=120, race=2)
    served.run()
    # After both attempts, once more, and after the heat.
    assert served.reviews == [2, 2, 3]


def test_a_driver_that_does_not_come_to_its_call_has_no_time(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path), ("raceline", "follow_gap"))
    day = served.run(gone=1)
    assert served.awaited == []
    rows = day.ledger.trials()[0].rows
    assert [row.team for row in rows] == ["raceline", "follow_gap"]
    assert [drive.remark for drive in rows[1].attempts] == [
        "did not start: not there 0.2 s after the call"
    ] * 2
    assert [row.place for row in day.ledger.classification()] == [1, 0]


def test_an_event_without_any_driver_waits_for_one_and_calls_again(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    (row,) = served.run(gone=0, may_come_back=True).ledger.trials()[0].rows
    assert served.awaited == [0]
    assert [drive.place for drive in row.attempts] == [1, 1]


def test_an_event_does_not_wait_for_drivers_of_its_own_server(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    (row,) = served.run(gone=0).ledger.trials()[0].rows
    assert served.awaited == []
    assert [drive.place for drive in row.attempts] == [0, 0]


def test_a_server_that_is_replaced_after_the_end_finds_its_event_and_begins_no_other(
    tmp_path: Path,
) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    assert event_ended_since(0.0, served.spec, "cup") is None
    with pytest.raises(Killed):
        served.run(kill_at_tick=60)
    assert event_ended_since(0.0, served.spec, "cup") is None
    records = served.run().records
    over = event_ended_since(0.0, served.spec, "cup")
    assert over is not None
    assert over.records == tuple(records)
    assert event_ended_since(1e12, served.spec, "cup") is None


@pytest.mark.parametrize(
    "killed", [{"kill_at_tick": 120}, {"kill_after_race": True, "race": 1}], ids=["in", "after"]
)
def test_a_driver_that_stewards_sent_away_does_not_come_back_with_a_new_server(
    killed: dict[str, int], tmp_path: Path
) -> None:
    served = Served(spec_of(tmp_path), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kicked=1, **killed)
    rows = served.run().ledger.trials()[0].rows
    assert [drive.remark for drive in rows[1].attempts] == [
        "did not start: not there 0.2 s after the call"
    ] * 2


def test_a_decision_of_stewards_changes_the_classification(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    day = served.run(penalty_after=1, penalised=0, seconds=10.0)
    (row,) = day.ledger.trials()[0].rows
    assert row.times_us[1] == row.attempts[1].lap_times_us[1] + 10_000_000
    assert row.attempts[1].remark == "+10 s penalty"
    (path,) = files_of(tmp_path)
    assert read_event(path).records[1].drives[0].stewards_us == 10_000_000


def test_a_program_that_is_started_again_has_its_seat_by_its_name() -> None:
    session = Session("cup", Served.scenario_for(2))
    session.join("Anna", "lidar", secret=5)
    session.is_event = session.keeps_seats = True
    session.drop(0)
    assert session.seats[0].is_taken
    with pytest.raises(SeatError, match="no 'Bert' of it is away"):
        session.join("Bert", "lidar", secret=6)
    assert session.join("Anna", "track", secret=7).number == 0
    assert session.seats[0].is_present
    with pytest.raises(SeatError, match="no 'Anna' of it is away"):
        session.join("Anna", "track", secret=8)
    session.drop(0)
    session.is_event = False
    assert session.join("Anna", "track", secret=7).number == 0  # to be told that it is over
    session.drop(0)
    with pytest.raises(SeatError, match="the event is over"):
        session.join("Anna", "track", secret=8)


def test_a_deleted_lap_does_not_count_and_neither_does_that_before_a_flying_start() -> None:
    drive = TeamResult(
        *("Anna", 1, 4, 40_000_000, 7_000_000),
        lap_times_us=(6_000_000, 9_000_000, 7_000_000, 8_000_000),
        **dict.fromkeys(("penalty_us", "wall_contacts", "kart_contacts", "warnings"), 0),
        remark="",
        deleted=(DeletedLap(3, "left the course"),),
    )
    assert drive.clean_laps_us(first=2) == [9_000_000, 8_000_000]


def test_a_format_is_the_same_after_a_round_trip_through_its_tables() -> None:
    for name in ("2023", "2025", "time-trial"):
        form = format_named(name)
        assert format_of(name, json.loads(json.dumps(words_of(form))), "there") == form


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("title = ", "no TOML"),
        ('[[stage]]\nkind = "parade"', "choose one of time trial, races"),
        ('[[stage]]\nkind = "races"\nlaps = 1.5', "give a whole number from 1 to 1000"),
        ('[[stage]]\nkind = "races"\nlap = 3', "no such key"),
        (
            '[[stage]]\nkind = "time trial"\nbest_points = 5\nleast_points = 25',
            "least_points = 25: give at most best_points, which is 5",
        ),
        ('title = "x"', "give [[stage]] tables, each with a name"),
        (
            '[[stage]]\nkind = "races"\n[[stage]]\nkind = "races"',
            "stage = 'Race, Race': give each stage a name that no other has",
        ),
        (
            '[[stage]]\nkind = "races"\nmost = 4\nleast = 9',
            "least = 9: give at most most, which is 4",
        ),
    ],
)
def test_a_file_that_is_no_format_is_refused(text: str, error: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as raised:
        read_format(path)
    assert error in str(raised.value)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        # Two groups of "Race" are "Race 1" and "Race 2"; a round is kept as "Heat 1".
        (Races("Race", "A", laps=1), Races("Race 2", "A", laps=1)),
        (Races("Race 2, round 1", "A", laps=1), Races("Race", "A", laps=1)),
        (TimeTrial("Heat 1", "A"), Races("Heat", "A", laps=1)),
        # The driver "Anna: Bert" in one, "Bert" in the other.
        (TimeTrial("Trial", "A"), TimeTrial("Trial: Anna", "A")),
    ],
)
def test_a_format_in_which_two_races_could_have_the_same_title_is_refused(
    first: Races | TimeTrial, second: Races | TimeTrial
) -> None:
    with pytest.raises(ScenarioError, match=r"mine.toml: stage '.*give one of them another name"):
        Format("mine", "Mine", (first, second)).check_names("mine.toml")


def test_names_of_stages_that_only_begin_alike_are_taken(tmp_path: Path) -> None:
    stages = (TimeTrial("Run", "A"), TimeTrial("Run 2", "A"), Races("Race", "A", laps=1))
    Format("mine", "Mine", (*stages, Races("Race of all", "A", laps=1))).check_names("mine.toml")
    path = tmp_path / "mine.toml"
    path.write_text('[[stage]]\nkind="races"\nname="Race"\n[[stage]]\nkind="races"\nname="Race 1"')
    with pytest.raises(ScenarioError, match="would be called as in stage 'Race'"):
        read_format(path)


def test_an_event_that_began_with_the_same_title_twice_is_shown_and_does_not_go_on(
    tmp_path: Path,
) -> None:
    served = Served(spec_of(tmp_path, EVENING), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_at_tick=60)
    path = tmp_path / "cup.event.json"
    path.write_text(path.read_text().replace('"Qualification"', '"Heat 1"'))
    assert read_event(path).day().next is not None
    with pytest.raises(ScenarioError, match=r"cannot go on: stage 'Heat 1'.*with --fresh"):
        unfinished_event(served.spec, "cup", 3, Log())


def test_an_event_of_another_format_is_not_gone_on_with(tmp_path: Path) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    with pytest.raises(Killed):
        served.run(kill_at_tick=60)
    with pytest.raises(ScenarioError, match="go on with --format time-trial"):
        unfinished_event(spec_of(tmp_path, EVENING), "cup", 2, Log())


def test_single_races_take_no_drivers_away_from_an_event_that_is_not_over(tmp_path: Path) -> None:
    check_free(tmp_path, "cup")
    served = Served(spec_of(tmp_path), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_at_tick=60, race=1)
    with pytest.raises(
        ScenarioError, match="1 attempts and races driven: go on with --format time-trial"
    ):
        check_free(tmp_path, "cup")
    check_free(tmp_path, "practice")
    served.run()
    check_free(tmp_path, "cup")


def test_an_event_is_not_gone_on_with_on_fewer_seats_than_it_has_drivers_on(
    tmp_path: Path,
) -> None:
    served = Served(spec_of(tmp_path), ("raceline", "follow_gap"))
    with pytest.raises(Killed):
        served.run(kill_at_tick=60)
    with pytest.raises(ScenarioError, match="go on with --karts 2 or more"):
        unfinished_event(served.spec, "cup", 1, Log())


def test_a_race_that_is_not_over_is_part_of_the_event_until_that_is_put_away(
    tmp_path: Path,
) -> None:
    served = Served(spec_of(tmp_path), ("raceline",))
    with pytest.raises(Killed):
        served.run(kill_at_tick=60)
    with Logbook(tmp_path, "cup", served.said.append) as book:
        recording = book.unfinished()
    assert recording is not None
    assert is_part_of(served.spec, "cup", recording)
    put_away(served.spec.folder, "cup", Log())
    assert not is_part_of(served.spec, "cup", recording)
    (path,) = files_of(tmp_path)
    assert not read_event(path).is_final


def test_an_event_that_cannot_be_read_is_put_aside_and_another_one_begins(tmp_path: Path) -> None:
    spec, path = spec_of(tmp_path), tmp_path / "cup.event.json"
    for _ in range(2):
        path.write_text("{}")
        with pytest.raises(ScenarioError, match="begin another event with --fresh"):
            unfinished_event(spec, "cup", 2, Log())
        put_away(spec.folder, "cup", Log())
        assert unfinished_event(spec, "cup", 2, Log()) is None
    put_away(spec.folder, "cup", Log())  # where there is none
    kept = ["cup.unreadable-2.event.json", "cup.unreadable.event.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == kept


def test_a_driver_on_the_network_stays_to_the_end_and_begins_each_attempt_afresh(
    tmp_path: Path,
) -> None:
    spec = replace(spec_of(tmp_path), call_s=20.0, numbers={"follow_gap": 7})
    address, name = free_address(), "follow_gap"
    ended: list[str] = []

    def drive() -> None:
        run_driver(driver_named(name), name, address=address, session="cup", wanted=1)
        ended.append(name)

    thread = threading.Thread(target=drive)
    with ServerLink(address, "cup", 2) as link:
        server = RaceServer(Session("cup", Served.scenario_for(2)), link, LOCKSTEP, ())
        thread.start()
        state = begin_event(server, spec, 1)
        assert state is not None
        event = LiveEvent(server, spec, state, Log(), lambda *_: None)
        assert event.run()
        server.see_off()
        thread.join(20.0)
    assert ended == [name]
    (row,) = event.day.ledger.trials()[0].rows
    assert row.team == "7 follow_gap"
    runs = [drive_run(RunSpec(name, "oval", laps=1, seed=seed)) for seed in (1, 2)]
    assert row.times_us == tuple(run.laps[0].time_us for run in runs)
