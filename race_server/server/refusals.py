"""What was refused: counted every time, told in the log once."""

import sys
from collections import Counter

import structlog

# Reasons and seats are few; more than this are somebody's invention, and one line says so.
MOST_LINES = 256


class Refusals(Counter[str]):
    """How often something was refused, by reason."""

    def __init__(self) -> None:
        """Count from nothing."""
        super().__init__()
        self._told: set[tuple[str, int]] = set()
        self._seen: Counter[tuple[str, int]] = Counter()
        self._log = structlog.wrap_logger(
            structlog.PrintLogger(sys.stderr),
            processors=[
                structlog.processors.add_log_level,
                structlog.processors.TimeStamper(fmt="iso"),
                structlog.processors.LogfmtRenderer(key_order=["timestamp", "level", "event"]),
            ],
        )

    def note(self, reason: str, seat: int = -1, *, times: int = 1) -> None:
        """Count a refusal; the first of its reason and seat is told."""
        self[reason] += times
        row = (reason, seat)
        if row in self._told or len(self._told) > MOST_LINES:
            return
        self._told.add(row)
        if len(self._told) > MOST_LINES:
            self._log.warning("refused", reason="more reasons than are told one by one")
        elif seat >= 0:
            self._log.warning("refused", reason=reason, seat=seat)
        else:
            self._log.warning("refused", reason=reason)

    def note_dropped(self, dropped: Counter[tuple[str, int]]) -> None:
        """Count what a link has dropped since the last call."""
        for (reason, seat), total in list(dropped.items()):
            if new := total - self._seen[reason, seat]:
                self._seen[reason, seat] = total
                self.note(reason, seat, times=new)
