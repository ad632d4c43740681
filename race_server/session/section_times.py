"""Times of the sections of a lap, and how each compares with the best: sectors and mini-sectors."""

from dataclasses import dataclass, field

from race_server.core.messages import Merit


@dataclass
class SectionTimes:
    """The sections of each kart's lap, and the best times so far. Sections count from 0."""

    sections: int
    _best: dict[int, int] = field(default_factory=dict)  # [µs] by section
    _own: dict[int, dict[int, int]] = field(default_factory=dict)  # by kart
    _lap: dict[int, dict[int, tuple[int, Merit]]] = field(default_factory=dict)  # by kart

    def add(self, kart: int, section: int, time_us: int) -> Merit:
        """Record that a kart has driven a section in `time_us`, and return how that compares.

        With a section that is not behind the newest one a new lap begins.
        """
        lap = self._lap.setdefault(kart, {})
        if lap and section <= max(lap):
            lap.clear()
        own = self._own.setdefault(kart, {})
        merit = Merit.SLOWER
        if time_us < own.get(section, time_us + 1):
            own[section] = time_us
            merit = Merit.OWN_BEST
        if time_us < self._best.get(section, time_us + 1):
            self._best[section] = time_us
            merit = Merit.BEST
        lap[section] = (time_us, merit)
        return merit

    def times_us(self, kart: int) -> tuple[int, ...]:
        """Return the times of a kart's lap [µs], by section; 0 for one that is not driven."""
        return tuple(time_us for time_us, _ in self._shown(kart))

    def merits(self, kart: int) -> tuple[Merit, ...]:
        """Return how the times of a kart's lap compare, by section."""
        return tuple(merit for _, merit in self._shown(kart))

    def theoretical_us(self, kart: int) -> int:
        """Return the sum of a kart's best sections [µs], 0 until it has driven each."""
        own = self._own.get(kart, {})
        return sum(own.values()) if len(own) == self.sections > 0 else 0

    def _shown(self, kart: int) -> list[tuple[int, Merit]]:
        lap = self._lap.get(kart, {})
        return [lap.get(section, (0, Merit.NONE)) for section in range(self.sections)]
