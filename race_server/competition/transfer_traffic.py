"""Drivers among highway-env's vehicles: here, there, and in its own environment."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from race_server.competition.lap_exam import CourseTry, LapExamSpec, LapRow, examine
from race_server.competition.transfer import HERE
from race_server.errors import ScenarioError
from race_server.scenario.track.highway_roads import PREFIX
from race_server.second import highway_itself
from race_server.second.highway_options import NAME

THERE = "there"


@dataclass(frozen=True)
class TrafficRow:
    """One driver on one track among others, here and there. Its fields are a contract."""

    driver: str
    track: str
    traffic: int
    here: Mapping[str, Any]
    there: Mapping[str, Any]


def drive_in_traffic(
    spec: LapExamSpec, drivers: Sequence[str], editions: Mapping[str, str], to: str
) -> Iterator[tuple[str, CourseTry]]:
    """Yield where, and how a driver did on a course, as they finish.

    to: ``highway-env``, whose motion all karts get, in our races; or ``highway-env-itself``, whose
    environment gives all but the driver, see `race_server/second/highway_itself.py:ItselfOptions`.

    Raises:
        RaceError: a course or the vehicle does not exist, or highway-env is not installed.
    """
    there = replace(spec, simulator=to)
    if to.startswith(highway_itself.NAME):
        if strange := [name for name in spec.courses if not name.startswith(PREFIX)]:
            raise ScenarioError(f"tracks {strange}: {to} has {PREFIX}racetrack-v0 and the like")
    for name, this in ((HERE, spec), (THERE, there)):
        for one in examine(this, drivers, editions):
            yield name, one


def traffic_rows(found: Sequence[tuple[str, CourseTry]], traffic: int) -> list[TrafficRow]:
    """Return the row of each driver on each track that drove in both."""
    tries: dict[tuple[str, str], dict[str, CourseTry]] = {}
    for name, one in found:
        tries.setdefault((one.driver, one.course), {})[name] = one
    return [
        TrafficRow(driver, track, traffic, _figures(both[HERE]), _figures(both[THERE]))
        for (driver, track), both in tries.items()
        if len(both) == 2
    ]


def is_target(name: str) -> bool:
    """Return whether drivers can be tried in a simulator of this name."""
    return name.partition(":")[0] in {NAME, highway_itself.NAME}


def _figures(one: CourseTry) -> dict[str, Any]:
    row = LapRow.of([one])
    return {
        "clean_laps": one.clean,
        "laps": len(one.times_s),
        "laps_wanted": one.laps_wanted,
        "ratio": row.ratio,
        "wall_contacts": one.contacts,
        "kart_contacts": one.touches,
        "overtakes": one.overtakes,
        "remark": one.remark,
    }
