"""The last minute of a kart, kept only where something happens: it brakes by itself, or crashes."""

from collections import deque
from dataclasses import dataclass, field
from typing import Any

from race_agents.unit.control_unit import STANDS, ControlUnit
from race_agents.unit.motion import SPEED
from race_agents.unit.readings import Readings
from race_server.core.alert import Cause

# What is kept of the time before something happens, and after it [s].
BEFORE_S, AFTER_S = 60.0, 10.0
# Causes for which a kart brakes by itself until it stands.
STOPS = Cause.OBSTACLE | Cause.DRIVER | Cause.LINK | Cause.GAME

Noted = tuple[int, dict[str, Any]]  # when [ns], and the turn


@dataclass
class IncidentRing:
    """Holds turns back until something happens, and then passes all of them on."""

    _held: deque[Noted] = field(default_factory=deque)
    _until_s: float = -1.0

    def pass_on(self, noted: Noted, time_s: float, *, happens: bool) -> list[Noted]:
        """Return the turns to be kept now, this one the last; none where it is held back."""
        if self._held and noted[0] < self._held[-1][0]:  # the clock was set back
            self._held.clear()
            self._until_s = time_s - 1.0
        self._until_s = min(self._until_s, time_s + AFTER_S)
        if happens:
            self._until_s = time_s + AFTER_S
        self._held.append(noted)
        if time_s <= self._until_s:
            kept, self._held = list(self._held), deque()
            return kept
        oldest_ns = noted[0] - round(1e9 * BEFORE_S)
        while self._held[0][0] < oldest_ns:
            self._held.popleft()
        return []


def is_incident(readings: Readings, unit: ControlUnit) -> bool:
    """Return whether a kart that drives brakes by itself, or felt a blow that no tyre can cause."""
    filtered, command = unit.fusion, unit.command
    if filtered is None:
        return False
    brakes = bool(command.cause & STOPS) and command.brake > 0.0
    drives = abs(float(filtered.state[SPEED])) > STANDS
    return (brakes and drives) or filtered.blow(readings.acceleration) > 0.0
