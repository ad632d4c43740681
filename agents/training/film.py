"""Record how a policy drives: laps, alone in a session, or the way to a slot."""

import tempfile
from dataclasses import replace
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

FILM, PARKING_FILM = "laps.mcap", "parking.mcap"
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
    session = Session("learned", scenario)
    return _record(folder / FILM, session, (f"learned:{policy}",))


def record_parking(
    folder: Path,
    policy: Path,
    scenario: Scenario,
    seed: int,
    decision_ticks: int,
    learners: int,
    others: tuple[str, ...],
) -> Path | None:
    """Record the driver of a policy on its way to a slot; return the file, None without any.

    learners: how many vehicles it drives, the first ones; others: drivers of the vehicles that do
    not learn, repeated in turn.
    """
    session = Session("learned", replace(scenario, seed=seed), decision_ticks=decision_ticks)
    beside = tuple(others[number % len(others)] for number in range(scenario.karts - learners))
    drivers = (f"learned:{policy}",) * learners + beside
    return _record(folder / PARKING_FILM, session, drivers)


def _record(film: Path, session: Session, drivers: tuple[str, ...]) -> Path | None:
    said: list[str] = []
    with tempfile.TemporaryDirectory(dir=film.parent) as aside:
        with (
            Logbook(Path(aside), "learned", said.append) as book,
            ServerLink(free_address(), "learned", 1) as link,
        ):
            RaceServer(session, link, LOCKSTEP, drivers, logbook=book).run(0)
        made = sorted(Path(aside).glob("*.mcap"))
        if session.phase is not Phase.FINISHED or not made:
            return None
        return made[-1].replace(film)
