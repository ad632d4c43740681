"""What was refused: counted every time, told in the log once."""

from collections import Counter

from race_server.logs import Log

# Reasons and seats are few; more than this are somebody's invention, and one line says so.
MOST_LINES = 256


class Refusals(Counter[str]):
    """How often something was refused, by reason."""

    def __init__(self, log: Log | None = None) -> None:
        """Count from nothing. log: is told of the first of each reason and seat."""
        super().__init__()
        self._log = log
        self._told: set[tuple[str, int]] = set()
        self._seen: Counter[tuple[str, int]] = Counter()

    def note(self, reason: str, seat: int = -1, *, times: int = 1) -> None:
        """Count a refusal; the first of its reason and seat is told."""
        self[reason] += times
        row = (reason, seat)
        if self._log is None or row in self._told or len(self._told) > MOST_LINES:
            return
        self._told.add(row)
        if len(self._told) > MOST_LINES:
            self._log.warn("refused for more reasons than are told one by one")
        elif seat >= 0:
            self._log.warn("refused for the first time", reason=reason, seat=seat)
        else:
            self._log.warn("refused for the first time", reason=reason)

    def note_dropped(self, dropped: Counter[tuple[str, int]]) -> None:
        """Count what a link has dropped since the last call."""
        for (reason, seat), total in list(dropped.items()):
            if new := total - self._seen[reason, seat]:
                self._seen[reason, seat] = total
                self.note(reason, seat, times=new)
