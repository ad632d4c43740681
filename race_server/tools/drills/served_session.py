"""The session under a drill: a server with fresh keys in this process, on a free port."""

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from race_server.competition.launch import free_port
from race_server.live.server import REAL, RaceServer
from race_server.live.server.warm_up import warm_up
from race_server.logs import Log
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import ClientKeys, read_client_keys, read_server_keys
from race_server.net.transport import ClientLink, ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from race_server.session.session import Session

COURSE = "covapsy-test-2023"
SESSION = "drill"


@dataclass
class ServedSession:
    """An open session with its keys."""

    address: str
    folder: Path
    server: RaceServer
    seats: int

    def keys(self, role: str) -> ClientKeys:
        """Return the keys of a role."""
        return read_client_keys(self.folder / role, SESSION)

    def link(self, role: str, timeout_s: float = 5.0) -> ClientLink:
        """Return a connection with the keys of a role."""
        return ClientLink(self.address, SESSION, keys=self.keys(role), timeout_s=timeout_s)


@contextmanager
def served_session(
    seats: int, spectators: int, protocol: str = "tls", log: Log | None = None
) -> Iterator[ServedSession]:
    """Serve an open session in its lobby; drivers that get ready race for unlimited laps."""
    with tempfile.TemporaryDirectory(prefix="race-drill-") as name:
        folder, port = Path(name, "keys"), free_port()
        issue_keys(Order(SESSION, seats, spectators, port=port), folder)
        held = read_server_keys(folder, SESSION, seats)
        rules = Rules(laps=0, countdown_s=1.0, limit_s=300.0)
        scenario = Scenario(load_course(COURSE), karts=seats, rules=rules)
        warm_up(scenario)
        session = Session(SESSION, scenario)
        address = f"{protocol}/127.0.0.1:{port}"
        with ServerLink(address, SESSION, seats, keys=held, real_time=True) as link:
            server = RaceServer(session, link, REAL, token=held.token, log=log)
            thread = threading.Thread(target=server.run, args=(seats,))
            thread.start()
            try:
                yield ServedSession(address, folder, server, seats)
            finally:
                server.stop()
                thread.join(10.0)
