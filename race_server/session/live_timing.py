"""What live timing shows of a race: gaps, sectors, mini-sectors, stints, places gained."""

from collections.abc import Sequence

import numpy as np

from race_server.core import codes
from race_server.core.messages import Event, EventKind, Timing
from race_server.core.state import Record, World
from race_server.session.mini_gates import GATES, MiniGates
from race_server.session.section_times import SectionTimes
from race_server.session.stints import Stints


class LiveTiming:
    """The timing of one race on a course. It reads the world, and changes nothing in it."""

    def __init__(self, world: World) -> None:
        """Begin with karts on the grid."""
        course = _course_of(world)
        gates = world.route.gates[course.gate_start : course.gate_start + course.gate_count]
        self._gates = MiniGates(world)
        self._minis = SectionTimes(GATES)
        self._sectors = SectionTimes(int(gates["sector"].max(initial=0)))
        self._stints = Stints()
        self._start_places = world.racers["grid_place"][0].copy()

    def follow(self, world: World, tick: int, events: Sequence[Event]) -> None:
        """Record what has happened since `tick`, the first of the last move."""
        self._stints.add(events)
        for event in events:
            if event.kind is EventKind.SECTOR:
                self._sectors.add(event.kart, event.other - 1, event.value)
        for kart, gate in self._gates.follow(world, tick):
            if gate > 0:
                times_us = self._gates.time_us(kart, gate), self._gates.time_us(kart, gate - 1)
                self._minis.add(kart, (gate - 1) % GATES, times_us[0] - times_us[1])

    def gap_us(self, world: World, kart: int, other: int) -> int:
        """Return by how much a kart is behind another one [µs], 0 where that is not known.

        Of one that races at its last gate, of finished karts by their race times.
        """
        if world.bodies["status"][0, kart] == codes.RACING:
            return self._gates.gap_us(other, kart)
        return finish_gap_us(world, kart, other)

    def of(self, world: World, kart: int) -> Timing:
        """Return what is shown of a kart."""
        ranks = world.racers["rank"][0]
        ahead, leader = (int(np.argmax(ranks == rank)) for rank in (ranks[kart] - 1, 1))
        places = self._start_places[ranks > 0]
        began = 1 + int(np.count_nonzero(places < self._start_places[kart]))
        return Timing(
            interval_us=self.gap_us(world, kart, ahead) if ranks[kart] > 1 else 0,
            laps_down=self._gates.laps_down(leader, kart),
            gained=began - int(ranks[kart]) if ranks[kart] > 0 else 0,
            theoretical_us=self._sectors.theoretical_us(kart),
            sectors_us=self._sectors.times_us(kart),
            sector_merits=self._sectors.merits(kart),
            mini_merits=self._minis.merits(kart),
            stints=self._stints.of(kart),
        )


def finish_gap_us(world: World, kart: int, other: int) -> int:
    """Return by how much a finished kart's race took longer than another's, with penalties [µs].

    0 while one of them has not finished.
    """
    if (world.bodies["status"][0, [kart, other]] != codes.FINISHED).any():
        return 0
    ends_us = world.racers["finish_us"][0] + world.racers["penalty_us"][0]
    return int(ends_us[kart] - ends_us[other])


def timing_of(world: World) -> LiveTiming | None:
    """Return the timing of a race that begins; None in a car park."""
    return LiveTiming(world) if _course_of(world).line_count > 0 else None


def _course_of(world: World) -> Record:
    return world.route.courses[world.rules[0].course]
