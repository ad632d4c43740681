"""Remarks on a team after a race: why it retired, and its penalties."""

from collections.abc import Sequence

from race_server.core.clock import seconds_of
from race_server.core.messages import Event, EventKind, Retirement, Standing, Status
from race_server.scenario.race import Rules

# Characters of an error in a remark, at most.
MOST_LETTERS = 60


class Incidents:
    """Remarks on the seats of one race."""

    def __init__(self) -> None:
        """Start without remarks."""
        self.absent: set[int] = set()  # seats that were not ready for the start
        self._failed: dict[int, str] = {}
        self._removed: dict[int, Retirement] = {}
        self._punished: dict[int, list[str]] = {}

    def record_failure(self, seat: int, failure: str) -> None:
        """Record how a driver failed, on one short line."""
        line = " ".join(failure.split())
        too_long = len(line) > MOST_LETTERS
        self._failed[seat] = line[: MOST_LETTERS - 1] + "…" if too_long else line

    def record_events(self, events: Sequence[Event]) -> None:
        """Record retirements and penalties."""
        for event in events:
            if event.kind is EventKind.RETIRED:
                self._removed[event.kart] = Retirement(event.other)
            elif event.kind is EventKind.PENALTY:
                cause = EventKind(event.other).name.lower().replace("_", " ")
                words = f"+{seconds_of(event.value):g} s {cause}"
                self._punished.setdefault(event.kart, []).append(words)

    def of(self, row: Standing, rules: Rules) -> str:
        """Return the remark on a standing."""
        return "; ".join([*self._end(row, rules), *self._punished.get(row.seat, ())])

    def _end(self, row: Standing, rules: Rules) -> list[str]:
        seat = row.seat
        if row.status is Status.FINISHED or seat not in {*self._failed, *self._removed}:
            return []
        words = self._failed.get(seat) or _removal(self._removed[seat], rules)
        return [
            f"did not start: {words}" if seat in self.absent else f"{words}, lap {row.laps + 1}"
        ]


def _removal(reason: Retirement, rules: Rules) -> str:
    words = {
        Retirement.CRASH: "crashed",
        Retirement.WRONG_WAY: f"{rules.wrong_way_removal:.2g} m the wrong way",
        Retirement.STOPPED: f"stood for {rules.stopped_limit_s:g} s",
        Retirement.TIME_OUT: "out of time",
        Retirement.RAMMING: f"rammed others {rules.ram_warnings} times",
        Retirement.LOST: "position lost",
        Retirement.LEFT_LOT: "left the car park",
        Retirement.HIT_PERSON: "hit a person",
        Retirement.JACK_KNIFE: "jack-knifed",
        Retirement.OWN_BODY: "touched itself with a trailer",
    }
    return words.get(reason, "withdrew")
