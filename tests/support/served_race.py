"""A race and its gateway, each in a thread, for tests with browsers."""

import asyncio
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.error import HTTPError

from race_server.cli.service import Service
from race_server.competition.launch import free_address
from race_server.live.gateway.key_ring import KeyRing
from race_server.live.gateway.roles import Tokens
from race_server.live.gateway.service import Gateway
from race_server.live.gateway.settings import Settings
from race_server.live.gateway.state import GatewayState
from race_server.live.server import LOCKSTEP, REAL, RaceServer
from race_server.logs import Log
from race_server.net.auth.token import local_token
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.course import Course
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from support.courses import SMALL_RING
from support.servers import running

TOKENS = Tokens(drive=("drive one", "drive two"), steward="steward one")
ORIGIN = "https://race.example"


@dataclass
class ServedRace:
    """A race, its gateway, and their addresses."""

    address: str
    server: RaceServer | None = None
    base: str = ""  # of the gateway
    gateway: Gateway | None = None
    thread: threading.Thread = field(default_factory=threading.Thread)

    @property
    def state(self) -> GatewayState:
        """What all browser sessions of the gateway share."""
        assert self.gateway is not None
        assert self.gateway.state is not None
        return self.gateway.state


@contextmanager
def racing(
    address: str,
    *,
    karts: int = 2,
    drivers: int = 0,
    laps: int = 0,
    course: Course = SMALL_RING,
    scenario: Scenario | None = None,
) -> Iterator[RaceServer]:
    """Serve a race in real time; scripted drivers take the seats that stay free."""
    rules = Rules(laps=laps, countdown_s=0.3, limit_s=300.0)
    scenario = scenario or Scenario(course, karts=karts, seed=7, rules=rules)
    session = Session("race", scenario)
    with (
        local_token(address, "race") as token,
        ServerLink(address, "race", scenario.karts, real_time=True) as link,
    ):
        server = RaceServer(session, link, REAL, ("pure_pursuit",), token=token)
        with running(server, drivers):
            yield server


@contextmanager
def gated(address: str, recordings: Path | None = None, **changes: object) -> Iterator[ServedRace]:
    """Serve a gateway to a race at an address. changes: of the settings."""
    settings = Settings(
        address, "race", KeyRing(), port=0, tokens=TOKENS, recordings=recordings, origins=(ORIGIN,)
    )
    gateway = Gateway(replace(settings, **changes), Log())  # type: ignore[arg-type]
    served = ServedRace(address, base=gateway.addresses.base, gateway=gateway)
    served.thread = thread = threading.Thread(target=lambda: asyncio.run(gateway.serve()))
    thread.start()
    try:
        yield served
    finally:
        gateway.stop()
        thread.join(10.0)
        assert not thread.is_alive()


def wait_for_race(served: ServedRace) -> None:
    """Wait until a gateway knows its race."""
    deadline = time.monotonic() + 20.0
    while not _knows_race(served):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def _knows_race(served: ServedRace) -> bool:
    has_begun = served.gateway is not None and served.gateway.state is not None
    return has_begun and served.state.live.is_there


def record_race(folder: Path, course: Course = SMALL_RING) -> Path:
    """Return the recording of a short race of three scripted drivers."""
    said: list[str] = []
    rules = Rules(laps=1, countdown_s=0.5)
    session = Session("cup", Scenario(course, karts=3, seed=5, rules=rules))
    with Logbook(folder, "cup", said.append) as book, ServerLink(free_address(), "cup", 3) as link:
        server = RaceServer(session, link, LOCKSTEP, ("pure_pursuit", "avoider"), logbook=book)
        assert server.run(0) is not None
    assert said == []
    (path,) = folder.glob("*.mcap")
    return path


def one_race(result: Path) -> Service:
    """Return one race of one driver, in lockstep, that is written to its result only."""
    rules = Rules(laps=1, countdown_s=0.5)
    return Service(
        scenario=Scenario(SMALL_RING, karts=1, seed=5, rules=rules),
        session="cup",
        pace=LOCKSTEP,
        fillers=("pure_pursuit",),
        awaited=0,
        listen=free_address(),
        steward_listen="",
        results="none",
        record="none",
        result=result,
        once=True,
        review=0.0,
        metrics=None,
        as_json=True,
        keys=None,
        is_guarded=False,
    )


def ask(served: ServedRace, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Return status, headers and text of what a gateway answers to a request."""
    request = urllib.request.Request(served.base + path, headers=headers)
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request) as answer:
            return answer.status, dict(answer.headers), answer.read().decode()
    except HTTPError as error:
        return error.code, dict(error.headers), error.read().decode()
