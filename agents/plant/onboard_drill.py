"""The drill of a real kart's program: every part of its table, on one course."""

from collections.abc import Callable
from typing import Any

from race_agents.plant.matrices import rows as danger_rows
from race_agents.plant.row import Row
from race_agents.plant.trip import Course
from race_agents.plant.whereabouts import Setting
from race_agents.plant.whereabouts import rows as place_rows
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.load import load_course

PARTS: dict[str, Callable[[Setting], list[Row]]] = {"place": place_rows, "danger": danger_rows}


def measure(
    track: str, vehicle: Vehicle, seeds: int, part: str | None, tell: Callable[[int], None]
) -> dict[str, Any]:
    """Return the document of the drill.

    part: only this one of `PARTS`; tell: called with the number of trips done.

    Raises:
        TrackError: no such course.
    """
    loaded, done = load_course(track), 0

    def count() -> None:
        nonlocal done
        done += 1
        tell(done)

    setting = Setting(Course(loaded.line, loaded.borders), vehicle, seeds, tell=count)
    found = [row for name, of in PARTS.items() if part in (None, name) for row in of(setting)]
    failed = [
        f"{row.measured}: {row.figure:.3g} {row.unit}, asked {row.bar}"
        for row in found
        if not row.ok
    ]
    return {
        "ok": not failed,
        "why": "; ".join(failed),
        "track": track,
        "vehicle": vehicle.name,
        "seeds": seeds,
        "rows": [{**row.document(), "bar": row.bar} for row in found],
    }
