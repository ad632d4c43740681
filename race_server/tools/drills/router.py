"""A zenoh router between a server and its spectators, as between two sites.

    python -m race_server.tools.drills.router SERVER LISTEN

It connects to the server without keys, listens for clients, prints ``ready``, and runs until its
stdin ends.
"""

import subprocess
import sys
from typing import Any

from race_server.competition.launch import ProcessGroup, free_address
from race_server.errors import RaceError
from race_server.net.auth.settings import client_settings
from race_server.net.transport import open_session

CONNECT_S = 10.0


def start_router(group: ProcessGroup, log: Any, server: str) -> tuple[subprocess.Popen[bytes], str]:
    """Start a router to a server; return its process, and the address at which it listens.

    Raises:
        RaceError: it does not start.
    """
    listen = free_address()
    command = [sys.executable, "-m", __name__, server, listen]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
    group.aside.append(process)
    assert process.stdout is not None
    if not process.stdout.readline():
        raise RaceError(f"the router to {server} did not start")
    return process, listen


def route(server: str, listen: str) -> None:
    """Pass on what a server and clients at another address tell each other."""
    settings = client_settings(server, None, CONNECT_S)
    settings |= {"mode": "router", "listen/endpoints": [listen], "listen/exit_on_failure": True}
    with open_session(settings):
        print("ready", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    route(*sys.argv[1:3])
