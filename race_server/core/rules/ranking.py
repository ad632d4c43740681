"""Which of two karts is ahead."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record


@kernel
def is_ahead(body: Record, racer: Record, other_body: Record, other: Record) -> bool:
    """Return whether one kart, by its records, is placed before another.

    body, other_body: BODY; racer, other: RACER.

    Finished karts first, by race time with penalties; then racing and retired karts alike by the
    distance that counts. Equal karts keep the order of the better best lap, then of the start grid.
    """
    if (body.status == codes.FINISHED) != (other_body.status == codes.FINISHED):
        return bool(body.status == codes.FINISHED)
    if body.status == codes.FINISHED:
        mine, theirs = racer.finish_us + racer.penalty_us, other.finish_us + other.penalty_us
        if mine != theirs:
            return bool(mine < theirs)
    elif racer.ranked != other.ranked:
        return bool(racer.ranked > other.ranked)
    if racer.best_lap_us != other.best_lap_us:
        if racer.best_lap_us == 0 or other.best_lap_us == 0:
            return bool(other.best_lap_us == 0)
        return bool(racer.best_lap_us < other.best_lap_us)
    return bool(racer.grid_place < other.grid_place)
