"""A race and a gateway before it, each in a thread, for tests that play browsers."""

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from race_server.competition.launch import free_address
from race_server.live.gateway.hub import Hub
from race_server.live.gateway.key_ring import KeyRing
from race_server.live.gateway.roles import Tokens
from race_server.live.gateway.service import Gateway
from race_server.live.gateway.settings import Settings
from race_server.live.server import LOCKSTEP, REAL, RaceServer
from race_server.logs import Log
from race_server.net.auth.token import local_token
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session import Session
from race_server.storage.recording.logbook import Logbook
from support.courses import ring

COURSE = ring(radius=6.0, half_width=0.7)
TOKENS = Tokens(drive=("drive one", "drive two"), steward="steward one")
ORIGIN = "https://race.example"


@dataclass
class Hall:
    """Where a race is served and who serves it."""

    address: str
    server: RaceServer | None = None
    base: str = ""  # of the gateway
    gateway: Gateway | None = None
    thread: threading.Thread = field(default_factory=threading.Thread)

    @property
    def hub(self) -> Hub:
        """What all browsers of the gateway share."""
        assert self.gateway is not None
        assert self.gateway.hub is not None
        return self.gateway.hub


@contextmanager
def racing(
    address: str,
    *,
    karts: int = 2,
    drivers: int = 0,
    laps: int = 0,
    scenario: Scenario | None = None,
) -> Iterator[RaceServer]:
    """Serve a race in real time; scripted drivers take the seats that stay empty."""
    rules = Rules(laps=laps, countdown_s=0.3, limit_s=300.0)
    scenario = scenario or Scenario(COURSE, karts=karts, seed=7, rules=rules)
    session = Session("race", scenario)
    with (
        local_token(address, "race") as token,
        ServerLink(address, "race", scenario.karts, real_time=True) as link,
    ):
        server = RaceServer(session, link, REAL, ("pure_pursuit",), token=token)
        thread = threading.Thread(target=server.run, args=(drivers,))
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join(10.0)


@contextmanager
def gated(address: str, recordings: Path | None = None, **changes: object) -> Iterator[Hall]:
    """Let browsers in to what is served at an address. changes: of the settings."""
    settings = Settings(
        address, "race", KeyRing(), port=0, tokens=TOKENS, recordings=recordings, origins=(ORIGIN,)
    )
    gateway = Gateway(replace(settings, **changes), Log())  # type: ignore[arg-type]
    hall = Hall(address, base=gateway.addresses.base, gateway=gateway)
    hall.thread = thread = threading.Thread(target=lambda: asyncio.run(gateway.serve()))
    thread.start()
    try:
        yield hall
    finally:
        gateway.stop()
        thread.join(10.0)
        assert not thread.is_alive()


def wait_for_race(hall: Hall) -> None:
    """Wait until a gateway knows its race."""
    deadline = time.monotonic() + 20.0
    while hall.gateway is None or hall.gateway.hub is None or not hall.hub.live.is_there:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def record_race(folder: Path) -> Path:
    """Return the recording of a short race of three scripted drivers."""
    said: list[str] = []
    rules = Rules(laps=1, countdown_s=0.5)
    session = Session("cup", Scenario(COURSE, karts=3, seed=5, rules=rules))
    with Logbook(folder, "cup", said.append) as book, ServerLink(free_address(), "cup", 3) as link:
        server = RaceServer(session, link, LOCKSTEP, ("pure_pursuit", "avoider"), logbook=book)
        assert server.run(0) is not None
    assert said == []
    (path,) = folder.glob("*.mcap")
    return path
