"""The drill of a real kart's program: every part of its table, on one course."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from race_agents.plant.matrices import rows as danger_rows
from race_agents.plant.peer_matrices import rows as peer_rows
from race_agents.plant.points import calculator
from race_agents.plant.raced import Raced, driven_races, recorded_race
from race_agents.plant.row import Row
from race_agents.plant.shadow import false_acts, shadow
from race_agents.plant.shadow import rows as shadow_rows
from race_agents.plant.sides import rows as sides_rows
from race_agents.plant.trip import Course
from race_agents.plant.whereabouts import Setting
from race_agents.plant.whereabouts import rows as place_rows
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.load import load_course

PARTS: dict[str, Callable[[Setting], list[Row]]] = {
    "place": place_rows,
    "danger": danger_rows,
    "peers": peer_rows,
    "sides": sides_rows,
}


RACES = "races"
FEW = 3


def measure(
    track: str,
    vehicle: Vehicle,
    seeds: int,
    part: str | None,
    tell: Callable[[int], None],
    *,
    races: Path | None = None,
    first_race: int = 1,
    most_km: float = math.inf,
    peers: bool = False,
) -> dict[str, Any]:
    """Return the document of the drill.

    part: only this one of `PARTS`, or `races`; tell: called with the number of trips done, or with
    the kilometres of races; races: a folder of recordings; without it, races are driven here if
    only they are asked for, on other courses, too, the first one under the seed `first_race`;
    most_km: of all karts together, to be looked at; peers: there they tell one another where they
    are.

    Raises:
        TrackError: no such course.
        RecordingError: a file of the folder is no recording of a race.
    """
    loaded, done = load_course(track), 0

    def count() -> None:
        nonlocal done
        done += 1
        tell(done)

    setting = Setting(Course(loaded.line, loaded.borders), vehicle, seeds, tell=count)
    # Each kart of a lost side takes half a minute: beside other parts a few are enough.
    few = replace(setting, seeds=min(seeds, FEW))
    settings = {"sides": few if part is None else setting}
    found = [
        row
        for name, of in PARTS.items()
        if part in (None, name)
        for row in of(settings.get(name, setting))
    ]
    told: dict[str, Any] = {"track": track, "vehicle": vehicle.name, "seeds": seeds}
    if part == RACES or (part is None and races is not None):
        raced = _races_in(races) if races is not None else driven_races(vehicle, first_race)
        count_km = tell if part == RACES else lambda _: None
        looked = shadow(
            raced,
            most_km=most_km,
            seed=first_race,
            tell=lambda km: count_km(int(km)),
            peers=peers,
        )
        found += shadow_rows(looked)
        told["false"] = false_acts(looked)
    told["calculator"] = calculator()
    return {**_judged(found), **told, "rows": [{**row.document(), "bar": row.bar} for row in found]}


def _judged(rows: Sequence[Row]) -> dict[str, Any]:
    """Return whether all rows are as asked, and which are not."""
    failed = [
        f"{row.measured}: {row.figure:.3g} {row.unit}, asked {row.bar}"
        for row in rows
        if not row.ok
    ]
    return {"ok": not failed, "why": "; ".join(failed)}


def _races_in(folder: Path) -> Iterator[Raced]:
    return map(recorded_race, sorted(folder.glob("*.mcap")))
