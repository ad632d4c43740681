"""When each kart passed each of twenty gates of a lap: gaps and intervals while the race is on."""

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.rules.laps import crossing_share, microseconds
from race_server.core.state import World

# Of a lap: a gap on the board is as old as a twentieth of a lap at most.
GATES = 20
# Of the spacing of gates: a sum of progress is off by less.
_ROUNDING = 1e-9


class MiniGates:
    """The gates of one race. Gate 0 is the timing line; they count on from lap to lap."""

    def __init__(self, world: World) -> None:
        """Begin with all karts before the first gate."""
        length = float(world.route.courses[world.rules[0].course].length)
        self._spacing_m = length / GATES
        self._ranked_m: NDArray[np.float64] = world.racers["ranked"][0].copy()
        self._racing = world.bodies["status"][0] == codes.RACING
        self._passed = np.full(len(self._ranked_m), -1)
        self._times_us: list[list[int]] = [[] for _ in self._ranked_m]

    def follow(self, world: World, tick: int) -> list[tuple[int, int]]:
        """Record the gates that karts have passed since `tick`, the first of the last move.

        Returns kart and number of each gate, in order for each kart. A gate that is passed again
        after driving backwards keeps its first time.
        """
        ranked_m = world.racers["ranked"][0]
        reached = np.ceil(ranked_m / self._spacing_m - _ROUNDING).astype(int) - 1
        passed = []
        for kart in np.flatnonzero((reached > self._passed) & self._racing):
            before_m, after_m = self._ranked_m[kart], ranked_m[kart]
            for gate in range(self._passed[kart] + 1, reached[kart] + 1):
                line_m = gate * self._spacing_m
                share = crossing_share(before_m - line_m, after_m - line_m)
                self._times_us[kart].append(self._time_us(world, tick, share))
                passed.append((int(kart), gate))
            self._passed[kart] = reached[kart]
        self._ranked_m[:] = ranked_m
        self._racing = world.bodies["status"][0] == codes.RACING
        return passed

    def time_us(self, kart: int, gate: int) -> int:
        """Return when a kart passed a gate [µs after the start]."""
        return self._times_us[kart][gate]

    def gap_us(self, ahead: int, behind: int) -> int:
        """Return how much later than `ahead` the kart `behind` passed its last gate.

        0 where that is not known: one of them has passed none, or `ahead` has only just overtaken.
        """
        gate = int(self._passed[behind])
        if gate < 0 or gate > self._passed[ahead]:
            return 0
        return max(self._times_us[behind][gate] - self._times_us[ahead][gate], 0)

    def laps_down(self, leader: int, kart: int) -> int:
        """Return by how many whole laps a kart is behind the leader."""
        return max(int(self._passed[leader] - self._passed[kart]), 0) // GATES

    def _time_us(self, world: World, tick: int, share: float) -> int:
        race = world.races[0]
        ticks = share * (int(race.tick) - tick)
        whole = int(ticks)
        return int(microseconds(tick - int(race.start_tick) + whole, ticks - whole))
