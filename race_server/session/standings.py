"""How a race stands: one row for each seat."""

import numpy as np

from race_server.core import codes
from race_server.core.messages import Standing, Status
from race_server.core.state import Record
from race_server.session.seats import Seat, Seats


def table_of(seats: Seats, karts: Record, laps_us: dict[int, list[int]]) -> list[Standing]:
    """Return one row for each seat, by number.

    karts: (K,) records of one world; laps_us: the lap times of each seat so far.
    """
    leader = karts[int(np.argmin(np.where(karts["rank"] > 0, karts["rank"], 999)))]
    return [
        _standing(seat, karts[seat.number], leader, tuple(laps_us.get(seat.number, ())))
        for seat in seats
    ]


def _standing(seat: Seat, kart: Record, leader: Record, lap_times_us: tuple[int, ...]) -> Standing:
    race_us = _race_us(kart)
    is_behind = race_us and leader.status == codes.FINISHED
    return Standing(
        seat=seat.number,
        driver=seat.driver,
        rank=int(kart["rank"]),
        laps=int(kart.laps),
        status=Status(int(kart.status)),
        last_lap_us=int(kart.last_lap_us),
        best_lap_us=int(kart.best_lap_us),
        race_time_us=race_us,
        gap_us=race_us - _race_us(leader) if is_behind else 0,
        penalties=int(kart.penalties),
        penalty_us=int(kart.penalty_us),
        items_used=int(kart.items_used),
        lap_times_us=lap_times_us,
    )


def _race_us(kart: Record) -> int:
    """Return the race time of a kart with its penalties [µs], 0 before its finish."""
    return int(kart.finish_us + kart.penalty_us) if kart.status == codes.FINISHED else 0
