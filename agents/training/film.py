"""A recording of a learned policy: a few laps alone, in a session of its own."""

from dataclasses import replace
from pathlib import Path

from agents.training.courses import course_named
from race_server.messages import Phase
from race_server.params import vehicle_named
from race_server.recording.logbook import Logbook
from race_server.scenario.base import Rules, Scenario
from race_server.server import LOCKSTEP, RaceServer
from race_server.session import Session
from race_server.start import free_address
from race_server.transport import ServerLink

LAPS = 3
LIMIT_S = 120.0


def record_laps(folder: Path, policy: Path, track: str, vehicle: str, seed: int) -> Path | None:
    """Record the driver of a policy on a track; return the file, None if nothing was recorded.

    Laps are driven as in a time trial: alone and without items.
    """
    rules = Rules(laps=LAPS, countdown_s=0.0, items=False, limit_s=LIMIT_S)
    scenario = Scenario(
        course_named(track), karts=1, vehicles=(vehicle_named(vehicle),), rules=rules, seed=seed
    )
    said: list[str] = []
    before = set(folder.glob("*.mcap"))
    session, driver = Session("learned", replace(scenario)), f"learned:{policy}"
    with (
        Logbook(folder, "learned", said.append) as book,
        ServerLink(free_address(), "learned", 1) as link,
    ):
        RaceServer(session, link, LOCKSTEP, (driver,), logbook=book).run(0)
    new = sorted(set(folder.glob("*.mcap")) - before)
    if session.phase is not Phase.FINISHED or not new:
        return None
    return new[-1].replace(folder / "laps.mcap")
