"""A race day is the same one in a process and on the network, whatever seats its drivers have."""

from pathlib import Path
from typing import Any

import pytest

from race_server.cli.serve_event import TRACKS
from race_server.competition.event_spec import EventSpec
from race_server.competition.race_day.day import run_day
from race_server.competition.race_day.formats import Format, Races, TimeTrial, format_named
from race_server.competition.race_day.plan import DayPlan, teams_of
from race_server.competition.race_day.report import day_document
from race_server.core.vehicle_presets import TT02
from race_server.scenario.track.load import load_course
from support.served_event import Served

pytestmark = pytest.mark.live

# In the order of the seats; the fastest has the last one.
DRIVERS = ("tentacles", "follow_gap", "raceline")
CROWD = ("avoider", *DRIVERS, "unstuck:follow_gap", "pure_pursuit", "idm")


def form_of(laps: int) -> Format:
    trial = TimeTrial("Qualification", "A", laps=1, attempts=1)
    return Format("small", "Small", (trial, Races("Heat", "A", laps=laps, most=8)))


def without_digests(document: dict[str, Any]) -> dict[str, Any]:
    """Leave out what names the world: on the network that has a kart for each seat."""
    for stage in document["stages"]:
        for race in stage.get("races", ()):
            del race["digest"]
    return document


def both_ways(
    folder: Path, tracks: dict[str, str], form: Format, drivers: tuple[str, ...]
) -> list[dict[str, Any]]:
    """Return the document of a race day in this process, and that of the same on the network."""
    courses = {letter: load_course(track) for letter, track in tracks.items()}
    plan = DayPlan(form, teams_of(drivers), courses, TT02, 1)
    spec = EventSpec(form, tracks, "tt02", 1, folder, 0.2, 0.0, needs_line=True)
    day = Served(spec, drivers).run()
    inside = day_document(plan, run_day(plan, None, lambda _: None))
    return [without_digests(one) for one in (inside, day_document(day.plan, day.ledger))]


def test_drivers_race_on_the_network_as_on_a_race_day_to_the_microsecond(tmp_path: Path) -> None:
    inside, live = both_ways(tmp_path, {"A": "oval"}, form_of(laps=1), DRIVERS)
    assert live == inside
    (race,) = inside["stages"][1]["races"]
    assert race["grid"] == ["raceline", "follow_gap", "tentacles"]


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_karts_that_crowd_one_another_race_the_same_on_any_seat(tmp_path: Path) -> None:
    tracks = {"A": "covapsy-train-2023"}
    inside, live = both_ways(tmp_path, tracks, form_of(laps=3), CROWD)
    assert live == inside
    (race,) = inside["stages"][1]["races"]
    assert sum(row["kart_contacts"] for row in race["rows"]) > 10


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize(("name", "drives"), [("2023", 34), ("2025", 24)])
def test_a_format_that_is_included_is_driven_the_same_on_the_network(
    name: str, drives: int, tmp_path: Path
) -> None:
    tracks = dict(zip("ABC", TRACKS.split(","), strict=True))
    inside, live = both_ways(tmp_path, tracks, format_named(name), (*CROWD, "tentacles_report_b"))
    assert live == inside
    rows = [row for stage in inside["stages"] for row in stage.get("rows", ())]
    races = [race for stage in inside["stages"] for race in stage.get("races", ())]
    assert sum(len(row["attempts_s"]) for row in rows) + len(races) == drives
