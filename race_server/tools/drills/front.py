"""The front that the project ships for HAProxy, started before a server under a drill."""

import shutil
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from race_server.errors import RaceError

CONFIGURATION = Path(__file__).parents[3] / "deploy" / "haproxy.cfg"
START_S = 10.0


def missing_front() -> str:
    """Return in a sentence why the front cannot be started here, "" if it can."""
    if shutil.which("haproxy") is None:
        return "haproxy is not installed: `apt-get install haproxy`"
    if not CONFIGURATION.exists():
        return f"{CONFIGURATION} is not there: run the drill from a checkout of the repository"
    return ""


@contextmanager
def front_of(server: int, steward_server: int, public: int, steward: int) -> Iterator[None]:
    """Pass connections on from two ports of this machine to two others while the block lasts.

    Raises:
        RaceError: HAProxy does not start.
    """
    places: Mapping[str, str] = {
        "RACE_PUBLIC": f"127.0.0.1:{public}",
        "RACE_STEWARD": f"127.0.0.1:{steward}",
        "RACE_SERVER": f"127.0.0.1:{server}",
        "RACE_STEWARD_SERVER": f"127.0.0.1:{steward_server}",
    }
    command = ["haproxy", "-db", "-q", "-f", str(CONFIGURATION)]
    with subprocess.Popen(command, env={**places, "PATH": "/usr/sbin:/usr/bin"}) as front:
        try:
            _wait_for(front, public)
            yield
        finally:
            front.terminate()


def _wait_for(front: subprocess.Popen[bytes], port: int) -> None:
    deadline = time.monotonic() + START_S
    while front.poll() is None and time.monotonic() < deadline:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(0.02)
    raise RaceError(f"haproxy does not start with {CONFIGURATION}: see above")
