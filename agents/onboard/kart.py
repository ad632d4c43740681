"""A kart as the game's side of its program sees it: words go there, reports come back."""

import mmap
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Protocol

from race_agents.onboard.safety_side import Mailboxes, SafetySide
from race_agents.unit.mailbox import Freshness
from race_agents.unit.records import Report, Word
from race_server.errors import DriverError

# A safety side from which nothing comes for this long [s] has ended.
ENDED_S = 3.0
CLOSE_S = 5.0


class Kart(Protocol):
    """The safety side, wherever it runs."""

    def turn(self, now_s: float) -> None:
        """Let it turn, if it does not turn by itself."""

    def tell(self, word: Word, now_s: float) -> None:
        """Tell it what the server wants and the driver does."""

    def report(self) -> Report | None:
        """Return the newest report, None before the first one."""

    def close(self) -> None:
        """Leave the kart with its brakes on."""


class KartHere:
    """The safety side in this very process, one turn for each of the game's side."""

    def __init__(self, side: SafetySide) -> None:
        """Let this side turn."""
        self.side = side

    def turn(self, now_s: float) -> None:
        """Let it turn."""
        self.side.turn(now_s)

    def tell(self, word: Word, now_s: float) -> None:
        """Tell it what the server wants and the driver does."""
        self.side.boxes.words.write(word.pack(), now_s)

    def report(self) -> Report | None:
        """Return the newest report."""
        return self.side.boxes.report()

    def close(self) -> None:
        """Leave the kart with its brakes on."""
        self.side.stop()


class KartApart:
    """The safety side in a separate process, which outlives this one."""

    def __init__(self, module: str, setup: Any, memory_bytes: int = 0) -> None:
        """Start the process.

        module: with a function `main`, which takes the path of the shared memory as its argument,
        and from its standard input `setup`; memory_bytes: beyond the mailboxes.
        """
        handle, name = tempfile.mkstemp(prefix="race-kart-")
        size = Mailboxes.size() + memory_bytes
        os.ftruncate(handle, size)
        self.memory = mmap.mmap(handle, size)
        os.close(handle)
        self._path = Path(name)
        self._boxes = Mailboxes.over(self.memory)
        self._fresh = Freshness()
        environment = {**os.environ, "RACE_SERVER_INTERPRET": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, name], env=environment, stdin=subprocess.PIPE
        )
        assert self.process.stdin is not None
        pickle.dump(setup, self.process.stdin)
        self.process.stdin.close()

    def turn(self, now_s: float) -> None:
        """Check that it turns.

        Raises:
            DriverError: it has ended.
        """
        mail = self._boxes.reports.read()
        self._fresh.note(mail, now_s)
        has_ended = self.process.poll() is not None
        is_silent = mail is not None and now_s - self._fresh.since_s > ENDED_S
        is_through = mail is not None and Report.unpack(mail.data).is_through
        if (has_ended or is_silent) and not is_through:
            raise DriverError(f"the kart's safety side has ended: {self.process.poll()}")

    def tell(self, word: Word, now_s: float) -> None:
        """Tell it what the server wants and the driver does."""
        self._boxes.words.write(word.pack(), now_s)

    def report(self) -> Report | None:
        """Return the newest report."""
        return self._boxes.report()

    def close(self) -> None:
        """Let the process end: what it hears no more from stands."""
        self.process.terminate()
        try:
            self.process.wait(CLOSE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self._path.unlink(missing_ok=True)
