"""Which item a box gives: karts further back draw the stronger ones."""

from race_server.core.kernels.jit import kernel
from race_server.core.state import Records


@kernel
def draw_item(items: Records, rank: int, karts: int, catch_up: int, chance: float) -> int:
    """Return the number of the item that a kart of place `rank` (from 1) of `karts` draws.

    chance: uniform in [0, 1). Without `catch_up` every place draws as the middle of the field.
    """
    behind = 0.5
    if catch_up != 0 and karts > 1:
        behind = (rank - 1) / (karts - 1)
    total = 0.0
    for number in range(1, len(items)):
        weight = items[number].leader_weight
        total += weight + behind * (items[number].last_weight - weight)
    wanted = chance * total
    for number in range(1, len(items)):
        weight = items[number].leader_weight
        wanted -= weight + behind * (items[number].last_weight - weight)
        if wanted < 0.0:
            return number
    return len(items) - 1
