"""How a race stands: one row for each seat."""

import numpy as np

from race_server.core import codes
from race_server.core.messages import Ending, Standing, Status
from race_server.core.state import World
from race_server.session.parking import figures_of
from race_server.session.seats import Seat, Seats


def table_of(seats: Seats, world: World, laps_us: dict[int, list[int]]) -> list[Standing]:
    """Return one row for each seat of the first world, by number.

    laps_us: the lap times of each seat so far.
    """
    ranks = world.racers["rank"][0]
    leader = int(np.argmin(np.where(ranks > 0, ranks, 999)))
    return [_standing(seat, world, leader, tuple(laps_us.get(seat.number, ()))) for seat in seats]


def _standing(seat: Seat, world: World, leader: int, lap_times_us: tuple[int, ...]) -> Standing:
    racer = world.racers[0, seat.number]
    race_us = _race_us(world, seat.number)
    parking = figures_of(world, seat.number)
    is_parked = parking is not None and parking.ending is Ending.PARKED
    is_behind = race_us and world.bodies[0, leader].status == codes.FINISHED
    return Standing(
        seat=seat.number,
        driver=seat.driver,
        rank=int(racer["rank"]),
        laps=int(racer.laps),
        status=Status(int(world.bodies[0, seat.number].status)),
        last_lap_us=int(racer.last_lap_us),
        best_lap_us=int(racer.best_lap_us),
        race_time_us=race_us,
        gap_us=race_us - _race_us(world, leader) if is_behind else 0,
        penalties=int(racer.penalties),
        penalty_us=int(racer.penalty_us),
        items_used=int(world.players[0, seat.number].items_used),
        lap_times_us=lap_times_us,
        parking=parking,
        planned=seat.planned if is_parked and not seat.is_led else None,
    )


def _race_us(world: World, k: int) -> int:
    """Return the race time of a kart with its penalties [µs], 0 before its finish."""
    racer, is_finished = world.racers[0, k], world.bodies[0, k].status == codes.FINISHED
    return int(racer.finish_us + racer.penalty_us) if is_finished else 0
