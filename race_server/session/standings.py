"""How a race stands: one row for each seat."""

import numpy as np

from race_server.core import codes
from race_server.core.messages import Ending, Standing, Status
from race_server.core.state import World
from race_server.session.event_log import EventLog
from race_server.session.live_timing import finish_gap_us
from race_server.session.parking import figures_of
from race_server.session.seats import Seat, Seats


def table_of(seats: Seats, world: World, log: EventLog) -> list[Standing]:
    """Return one row for each seat of the first world, by number.

    log: of the race so far.
    """
    ranks = world.racers["rank"][0]
    leader = int(np.argmin(np.where(ranks > 0, ranks, 999)))
    return [_standing(seat, world, leader, log) for seat in seats]


def _standing(seat: Seat, world: World, leader: int, log: EventLog) -> Standing:
    number, timing = seat.number, log.timing
    racer = world.racers[0, number]
    parking = figures_of(world, number)
    is_parked = parking is not None and parking.ending is Ending.PARKED
    status = Status(int(world.bodies[0, number].status))
    # A vehicle that stands in its slot at the lights has parked before the race began.
    end_us = max(int(racer.finish_us), 0) + int(racer.penalty_us)
    race_us = end_us if status == codes.FINISHED else 0
    return Standing(
        seat=number,
        driver=seat.driver,
        rank=int(racer["rank"]),
        laps=int(racer.laps),
        status=status,
        last_lap_us=int(racer.last_lap_us),
        best_lap_us=int(racer.best_lap_us),
        race_time_us=race_us,
        gap_us=(timing.gap_us if timing else finish_gap_us)(world, number, leader),
        penalties=int(racer.penalties),
        penalty_us=int(racer.penalty_us),
        items_used=int(world.players[0, number].items_used),
        lap_times_us=tuple(log.laps.times_us.get(number, ())),
        parking=parking,
        planned=seat.planned if is_parked and not seat.is_led else None,
        timing=timing.of(world, number) if timing and status != codes.ABSENT else None,
    )
