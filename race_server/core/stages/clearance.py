"""Whether a place is free for a kart that is to be put there."""

from race_server.core import codes
from race_server.core.kernels.boxes import reach_of
from race_server.core.kernels.jit import kernel
from race_server.core.state import World

# A kart needs this many of its lengths to the middle of any other; where one of the two has
# trailers, room for both however they stand.
CLEAR_LENGTHS = 1.5


@kernel
def is_clear(
    world: World, w: int, k: int, others: int, x: float, y: float, last_status: int
) -> bool:
    """Return whether kart k could stand at (x, y) [m], clear of the first `others` karts.

    Karts count from RACING to `last_status`: those that finished or retired may count, or not.
    """
    vehicle = world.vehicles[w, k]
    for other in range(others):
        rival = world.bodies[w, other]
        if other == k or rival.status == codes.ABSENT or rival.status > last_status:
            continue
        near, other_vehicle = CLEAR_LENGTHS * vehicle.length, world.vehicles[w, other]
        if vehicle.trailer_count > 0 or other_vehicle.trailer_count > 0:
            near = max(near, reach_of(vehicle) + reach_of(other_vehicle))
        dx, dy = rival.x - x, rival.y - y
        if dx * dx + dy * dy < near * near:
            return False
    return True
