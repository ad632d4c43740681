"""Remarks on a team after a race: why it retired, and its penalties."""

from collections.abc import Sequence

from race_server.core.clock import seconds_of
from race_server.core.messages import (
    Cleanness,
    Event,
    EventKind,
    Fault,
    Retirement,
    Standing,
    Status,
)
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
        self._seen: dict[int, Fault] = {}  # by the stewards who removed a kart
        self._punished: dict[int, list[str]] = {}
        self._stewards_us: dict[int, int] = {}
        self._faults: dict[int, list[str]] = {}  # since the last lap
        self._deleted: dict[int, list[tuple[int, str]]] = {}

    @property
    def failed(self) -> set[int]:
        """The seats whose drivers were not ready, raised, or took too long."""
        return set(self._failed)

    def record_failure(self, seat: int, failure: str) -> None:
        """Record how a driver failed, on one short line."""
        line = " ".join(failure.split())
        too_long = len(line) > MOST_LETTERS
        self._failed[seat] = line[: MOST_LETTERS - 1] + "…" if too_long else line

    def record_events(self, events: Sequence[Event]) -> None:
        """Record retirements, penalties, and the laps that do not count."""
        for event in events:
            if event.kind is EventKind.RETIRED:
                self._removed[event.kart] = Retirement(event.other)
                if event.other == Retirement.REMOVED:
                    self._seen[event.kart] = Fault(event.value)
            elif event.kind is EventKind.PENALTY:
                cause = EventKind(event.other).name.lower().replace("_", " ")
                if event.value < 0:
                    cause += " taken back"
                words = f"{seconds_of(event.value):+g} s {cause}"
                self._punished.setdefault(event.kart, []).append(words)
                if event.other == EventKind.PENALTY:
                    given_us = self._stewards_us.get(event.kart, 0) + event.value
                    self._stewards_us[event.kart] = max(given_us, 0)
            elif event.kind is EventKind.LAP:
                faults = self._faults.pop(event.kart, [])
                if event.detail == Cleanness.UNCLEAN:
                    why = ", ".join(dict.fromkeys(faults)) or "left the course"
                    self._deleted.setdefault(event.kart, []).append((event.other, why))
            elif words := _fault(event):
                self._faults.setdefault(event.kart, []).append(words)

    def deleted(self, seat: int) -> list[tuple[int, str]]:
        """Return the laps of a seat that do not count: their numbers from 1, and why."""
        return self._deleted.get(seat, [])

    def stewards_us(self, seat: int) -> int:
        """Return the sum [µs] of the penalties that stewards gave a seat."""
        return self._stewards_us.get(seat, 0)

    def of(self, row: Standing, rules: Rules) -> str:
        """Return the remark on a standing."""
        return "; ".join([*self._end(row, rules), *self._punished.get(row.seat, ())])

    def _end(self, row: Standing, rules: Rules) -> list[str]:
        seat = row.seat
        if row.status is Status.FINISHED or seat not in {*self._failed, *self._removed}:
            return []
        words = self._failed.get(seat) or _removal(self._removed[seat], rules)
        if seat in self._seen:
            words = f"removed by the stewards: {fault_text(self._seen[seat])}"
        return [
            f"did not start: {words}" if seat in self.absent else f"{words}, lap {row.laps + 1}"
        ]


def _fault(event: Event) -> str:
    """Return why the lap of an event's kart does not count any more, "" if it still does."""
    words = {
        EventKind.CONTACT_WALL: "touched a border",
        EventKind.SHORT_CUT: f"left out gate {event.other}",
        EventKind.RESCUED: "was rescued",
        EventKind.OFF_TRACK: "left the course",
        EventKind.POSE: "was not seen for a while",
    }
    return words.get(event.kind, "")


def fault_text(fault: Fault) -> str:
    """Return what stewards removed a kart for."""
    words = {
        Fault.WRONG_WAY: "the wrong way",
        Fault.STANDING: "stood",
        Fault.RAMMING: "rammed others",
        Fault.DANGEROUS: "dangerous driving",
        Fault.DEFECT: "defect of the kart",
    }
    return words.get(fault, "their decision")


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
