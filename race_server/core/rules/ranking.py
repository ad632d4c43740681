"""Who is ahead of whom."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record


@kernel
def is_ahead(kart: Record, other: Record) -> bool:
    """Return whether `kart` is placed before `other`.

    Finished karts first, by race time with penalties; then racing and retired karts by the
    distance that counts, a retired kart behind a racing one at the same distance. Equal karts
    keep the order of the better best lap, then of the start grid.
    """
    if (kart.status == codes.FINISHED) != (other.status == codes.FINISHED):
        return bool(kart.status == codes.FINISHED)
    if kart.status == codes.FINISHED:
        mine, theirs = kart.finish_us + kart.penalty_us, other.finish_us + other.penalty_us
        if mine != theirs:
            return bool(mine < theirs)
    elif kart.ranked != other.ranked:
        return bool(kart.ranked > other.ranked)
    if kart.best_lap_us != other.best_lap_us:
        if kart.best_lap_us == 0 or other.best_lap_us == 0:
            return bool(other.best_lap_us == 0)
        return bool(kart.best_lap_us < other.best_lap_us)
    return bool(kart.grid_place < other.grid_place)
