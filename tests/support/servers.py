"""A race server at work in a thread."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from race_server.live.server import RaceResult, RaceServer


@dataclass
class LiveServer:
    """A server, its thread, and the results of its races."""

    server: RaceServer
    thread: threading.Thread = field(default_factory=threading.Thread)
    results: list[RaceResult] = field(default_factory=list)

    @property
    def address(self) -> str:
        """Where drivers and spectators find it."""
        return self.server.link.address

    def stop(self) -> None:
        """End its race and its thread."""
        self.server.stop()
        self.thread.join(20.0)


@contextmanager
def running(
    server: RaceServer, drivers: int = 0, *, repeatedly: bool = False
) -> Iterator[LiveServer]:
    """Run a race that waits for this many drivers; stop it at the end of the block.

    repeatedly: one race after the other.
    """

    def work(live: LiveServer) -> None:
        while (result := server.run(drivers)) is not None:
            live.results.append(result)
            if not repeatedly:
                return
            server.reopen()

    with _at_work(server, work) as live:
        yield live


@contextmanager
def waiting(server: RaceServer, drivers: int) -> Iterator[LiveServer]:
    """Wait in the lobby for drivers; stop it at the end of the block."""
    with _at_work(server, lambda _: server.lobby.wait_for(drivers)) as live:
        yield live


@contextmanager
def _at_work(server: RaceServer, work: Callable[[LiveServer], object]) -> Iterator[LiveServer]:
    live = LiveServer(server)
    live.thread = threading.Thread(target=work, args=(live,))
    live.thread.start()
    try:
        yield live
    finally:
        live.stop()


def wait_until(is_so: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Wait until a condition holds; it must before the time is over."""
    deadline = time.monotonic() + timeout_s
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.02)
