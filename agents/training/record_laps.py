"""Record a few laps of a policy, alone in a session."""

import tempfile
from pathlib import Path

from race_server.competition.launch import free_address
from race_server.core.messages import Phase
from race_server.core.vehicle_presets import vehicle_named
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.sets import course_named
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook

FILM = "laps.mcap"
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
    session, driver = Session("learned", scenario), f"learned:{policy}"
    said: list[str] = []
    with tempfile.TemporaryDirectory(dir=folder) as aside:
        with (
            Logbook(Path(aside), "learned", said.append) as book,
            ServerLink(free_address(), "learned", 1) as link,
        ):
            RaceServer(session, link, LOCKSTEP, (driver,), logbook=book).run(0)
        made = sorted(Path(aside).glob("*.mcap"))
        if session.phase is not Phase.FINISHED or not made:
            return None
        return made[-1].replace(folder / FILM)
