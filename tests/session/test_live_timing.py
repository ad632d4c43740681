"""Gaps, intervals, sectors and mini-sectors while a race is on, against the record of its ticks."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from race_server.core.messages import Control, Merit, Phase, Standing, Timing
from race_server.session.mini_gates import GATES
from race_server.session.section_times import SectionTimes
from race_server.session.session import Session
from support.sessions import session_on_ring

KARTS, LATE, DECISION_TICKS = 8, 7, 3


class RingRace:
    """A race of eight around a ring, and how far each had come in each tick.

    The first kart accelerates best, and the last one starts 12 s late. They drive side by side.
    """

    def __init__(self, ticks: int, step: int = 1) -> None:
        """Race for some ticks, of which each move of the session takes `step`."""
        self.session = session_on_ring("test", KARTS, laps=3, countdown_s=0.1)
        for seat in range(KARTS):
            self.session.join(f"driver {seat}", "track")
        self.session.start()
        distances = []
        for tick in range(0, ticks, step):
            if tick % DECISION_TICKS == 0:
                self._drive(1 + tick // DECISION_TICKS)
            self.session.advance(step)
            distances.append(self.session.world.racers["ranked"][0].copy())
        self.distances: NDArray[np.float64] = np.array(distances)

    def _drive(self, decision: int) -> None:
        session = self.session
        for seat, racer in enumerate(session.world.racers[0]):
            aside = racer.lateral_offset - 0.3 * (seat % 2) + 0.15
            steering = float(np.clip((0.044 - 0.5 * aside - racer.heading_error) / 0.314, -1, 1))
            throttle = 0.6 if seat == 0 else 0.25 + 0.03 * seat
            if seat == LATE and session.tick < 720:
                throttle = 0.0
            session.receive_control(seat, 1, decision, session.tick, Control(steering, throttle))

    def crossing_us(self, seat: int, distance_m: float) -> float:
        """Return when a kart first got so far, from the record of ticks alone."""
        past = int(np.argmax(self.distances[:, seat] > distance_m))
        before, after = self.distances[past - 1 : past + 1, seat]
        start = int(self.session.world.races[0].start_tick)
        return (past - start + (distance_m - before) / (after - before)) * 1e6 / 60

    @property
    def length_m(self) -> float:
        return float(self.session.world.route.courses[0].length)


@cache
def race_of(ticks: int, step: int = 1) -> RingRace:
    return RingRace(ticks, step)


def timing_of(row: Standing) -> Timing:
    assert row.timing is not None
    return row.timing


def by_place(session: Session) -> list[Standing]:
    return sorted(session.table(), key=lambda row: row.rank)


@pytest.mark.parametrize("ticks", [1300, 1500])
def test_gap_and_interval_are_differences_of_times_at_the_last_of_twenty_gates(ticks: int) -> None:
    race = race_of(ticks)
    spacing_m = race.length_m / GATES
    rows = by_place(race.session)
    for ahead, row in pairwise(rows):
        gate_m = spacing_m * np.floor(race.distances[-1, row.seat] / spacing_m)
        own_us = race.crossing_us(row.seat, gate_m)
        gap_us = own_us - race.crossing_us(rows[0].seat, gate_m)
        assert row.gap_us == pytest.approx(gap_us, abs=1000)
        # A kart that was just overtaken was the first at that gate: the interval is not known.
        interval_us = max(own_us - race.crossing_us(ahead.seat, gate_m), 0)
        assert timing_of(row).interval_us == pytest.approx(interval_us, abs=1000)


def test_a_kart_is_a_lap_down_once_the_leader_is_a_lap_of_gates_ahead() -> None:
    race = race_of(1500)
    passed = np.floor(race.distances[-1] / (race.length_m / GATES))
    down = [timing_of(row).laps_down for row in race.session.table()]
    assert down == [(passed[0] - count) // GATES for count in passed]
    assert max(down) == 1


def test_at_the_finish_gaps_are_those_of_the_race_times() -> None:
    race = race_of(4200)
    assert race.session.phase is Phase.FINISHED
    rows = by_place(race.session)
    for ahead, row in pairwise(rows):
        assert row.gap_us == row.race_time_us - rows[0].race_time_us > 0
        assert timing_of(row).interval_us == row.race_time_us - ahead.race_time_us


def test_places_gained_count_from_the_grid() -> None:
    for row in race_of(1500).session.table():
        assert timing_of(row).gained == row.seat + 1 - row.rank


def test_the_sectors_of_a_lap_add_up_to_it() -> None:
    for row in race_of(4200).session.table():
        assert sum(timing_of(row).sectors_us) == row.last_lap_us
        assert 0 < timing_of(row).theoretical_us <= row.best_lap_us


def test_a_mini_sector_is_shown_as_soon_as_it_is_driven() -> None:
    race = race_of(1500)
    for row in race.session.table():
        passed = int(race.distances[-1, row.seat] // (race.length_m / GATES))
        # Those of a lap stay until the first of the next one is through.
        done = passed % GATES or (GATES if passed else 0)
        driven = [merit is not Merit.NONE for merit in timing_of(row).mini_merits]
        assert driven == [True] * done + [False] * (GATES - done)


def test_moves_of_three_ticks_give_the_gaps_of_moves_of_one_to_a_millisecond() -> None:
    one, three = race_of(900), race_of(900, step=DECISION_TICKS)
    assert one.session.digest() == three.session.digest()
    for single, triple in zip(one.session.table(), three.session.table(), strict=True):
        assert triple.gap_us == pytest.approx(single.gap_us, abs=1000)


def test_a_time_is_purple_green_or_yellow() -> None:
    times = SectionTimes(2)
    assert times.add(kart=0, section=0, time_us=10) is Merit.BEST
    assert times.add(kart=1, section=0, time_us=11) is Merit.OWN_BEST
    assert times.add(kart=1, section=1, time_us=20) is Merit.BEST
    assert times.add(kart=1, section=0, time_us=12) is Merit.SLOWER
    assert times.add(kart=1, section=1, time_us=19) is Merit.BEST
    assert times.merits(1) == (Merit.SLOWER, Merit.BEST)
    assert times.times_us(1) == (12, 19)


def test_the_theoretical_best_is_the_sum_of_the_best_sections_once_all_are_driven() -> None:
    times = SectionTimes(2)
    times.add(0, 0, 10)
    assert times.theoretical_us(0) == 0
    times.add(0, 1, 22)
    times.add(0, 0, 12)
    times.add(0, 1, 20)
    assert times.theoretical_us(0) == 30


def test_the_sections_of_a_lap_are_forgotten_as_the_next_one_begins() -> None:
    times = SectionTimes(3)
    times.add(0, 0, 10)
    times.add(0, 1, 11)
    times.add(0, 0, 12)
    assert times.times_us(0) == (12, 0, 0)
    assert times.merits(0) == (Merit.SLOWER, Merit.NONE, Merit.NONE)
