"""The log of a server for its operator: events of the server, and nothing for each message.

A thread writes the lines, so that no tick waits for a terminal or a pipe. In a terminal they are
formatted for people, elsewhere each is one JSON object.
"""

import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self, TextIO

import structlog

from race_server.printable import printable

CLOSE_S = 2.0
# Lines that may wait for a pipe that is not read; later ones are dropped.
MOST_WAITING = 1024
# Refusals of one reason and sender are summed up in one line in this time [s].
QUIET_S = 60.0
# What a server says first, once it can be reached.
LISTENING = "listening"
# Facts of a warning that is of the server as a whole.
_OF_ALL = {"timestamp", "level", "event", "why"}
FIRST, AGAIN = "refused for the first time", "refused again"
# More senders than this in that time share one line for each reason.
MOST_SENDERS = 1024

Fact = str | int | float | bool
Line = tuple[str, str, dict[str, Fact]]  # level, event, facts


class Log:
    """Logs events with their facts, in order.

    Without its thread, outside of a ``with`` block, each line is written at once.
    """

    def __init__(self, *, as_json: bool = False, stream: TextIO | None = None) -> None:
        """Write to stderr, or to a stream. as_json: even to a terminal."""
        self._stream = stream or sys.stderr
        is_terminal = self._stream.isatty() and not as_json
        renderer: Any = structlog.processors.JSONRenderer(sort_keys=False)
        if is_terminal:
            renderer = structlog.dev.ConsoleRenderer(pad_event_to=0)
        self._logger: Any = structlog.wrap_logger(
            structlog.PrintLogger(self._stream),
            processors=[structlog.processors.add_log_level, _in_order, renderer],
        )
        self._time = "%H:%M:%S" if is_terminal else "%Y-%m-%dT%H:%M:%S.%fZ"
        self._queue: queue.SimpleQueue[Line | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._work, name="log", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join(CLOSE_S)
            self._thread = None

    def say(self, event: str, **facts: Fact) -> None:
        """Log an event of normal operation."""
        self._hand_over("info", event, facts)

    def warn(self, event: str, **facts: Fact) -> None:
        """Log an event that may need attention."""
        self._hand_over("warning", event, facts)

    def _hand_over(self, level: str, event: str, facts: dict[str, Fact]) -> None:
        now = datetime.now(UTC) if self._time.endswith("Z") else datetime.now().astimezone()
        line = (level, event, {"timestamp": now.strftime(self._time), **facts})
        if self._thread is None:
            self._write(line)
        elif self._queue.qsize() < MOST_WAITING:
            self._queue.put(line)

    def _work(self) -> None:
        while (line := self._queue.get()) is not None:
            self._write(line)

    def _write(self, line: Line) -> None:
        level, event, facts = line
        # Where the log goes the disk may be full, or its reader gone. Nothing can be told then.
        with contextlib.suppress(OSError, ValueError):
            getattr(self._logger, level)(event, **facts)
            self._stream.flush()


@dataclass
class _Refused:
    """What one sender was refused for one reason."""

    quiet_until: float  # [s] by the clock
    unsaid: int = 0  # since the last line


class RefusalLog:
    """Logs the first refusal of each reason and sender at once, and sums up those that follow.

    A sender that is refused without end is one line a minute, and hides no other sender.
    """

    def __init__(self, log: Log, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin with no sender known. clock: [s]."""
        self._log, self._clock = log, clock
        self._rows: dict[tuple[str, Fact], _Refused] = {}  # in the order of `quiet_until`

    def record(self, reason: str, sender: Fact, *, times: int = 1, **facts: Fact) -> None:
        """Log a refusal, unless a line about this reason and sender was written just now.

        facts: about the sender.
        """
        now, key = self._clock(), (reason, sender)
        if key not in self._rows and not self._has_room(now):
            key, facts = (reason, ""), {"sender": f"one of more than {MOST_SENDERS}"}
        row = self._rows.get(key)
        if row is not None and now < row.quiet_until:
            row.unsaid += times
            return
        if row is None:
            self._log.warn(FIRST, reason=str(reason), **facts)
        else:
            del self._rows[key]
            self._log.warn(AGAIN, reason=str(reason), times=row.unsaid + times, **facts)
        self._rows[key] = _Refused(now + QUIET_S)

    def _has_room(self, now: float) -> bool:
        """Forget the sender whose line is the oldest, if that may be; return if one has room."""
        if len(self._rows) < MOST_SENDERS:
            return True
        oldest = next(iter(self._rows))
        if now < self._rows[oldest].quiet_until:
            return False
        del self._rows[oldest]
        return True


def _in_order(_logger: Any, _method: str, line: Any) -> Any:
    """Put time, level and event first, and make all text printable: one event is one line."""
    ordered = {name: line.pop(name) for name in ("timestamp", "level", "event")} | line
    return {
        name: printable(fact) if isinstance(fact, str) else fact for name, fact in ordered.items()
    }


def words_of(text: str) -> str:
    """Return a line of a log as a person reads it; what is no JSON is returned as it is."""
    if not (line := _facts_in(text)):
        return text
    facts = [f"{k} {v}" for k, v in line.items() if k not in {"event", "level", "timestamp"}]
    return ": ".join(part for part in (line["event"], ", ".join(facts)) if part)


def _facts_in(text: str) -> dict[str, Any]:
    """Return the event of a line of a log with its facts, nothing for a line of something else."""
    try:
        line = json.loads(text)
    except ValueError:
        return {}
    return line if isinstance(line, dict) and "event" in line else {}


def last_words(log: Path, lines: int = 1) -> str:
    """Return the last lines of a log file, as a person reads them."""
    said = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
    return " / ".join(words_of(line) for line in said[-lines:]) or "it said nothing"


def warnings_in(log: Path) -> list[str]:
    """Return the warnings in a server's log that are of no driver, from when it listens on.

    Each of them once, with the reason that it gives.
    """
    found, listens = [], False
    for line in map(_facts_in, log.read_text(errors="replace").splitlines()):
        listens = listens or line.get("event") == LISTENING
        if listens and line.get("level") == "warning" and not line.keys() - _OF_ALL:
            found.append(": ".join(str(line[name]) for name in ("event", "why") if name in line))
    return list(dict.fromkeys(found))
