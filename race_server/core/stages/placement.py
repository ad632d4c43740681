"""Real karts: put where they say they are, as far as that is believed."""

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample_anywhere
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.stages.events import report, retire
from race_server.core.state import Floats, World


@kernel
def place(world: World, w: int, placement: Floats) -> None:
    """Put one kart to its place. placement: (10,), see state.PLACEMENT."""
    k, trust = int(placement[0]), int(placement[1])
    kart = world.karts[w, k]
    if kart.status == codes.ABSENT:
        return
    kart.x, kart.y, kart.heading = placement[3], placement[4], wrap_angle(placement[5])
    kart.speed, kart.lateral_speed, kart.yaw_rate = placement[6], placement[7], placement[8]
    kart.steering = placement[9]
    if trust != kart.trust:
        _change_trust(world, w, k, trust, int(placement[2]))


@kernel
def _change_trust(world: World, w: int, k: int, trust: int, doubt: int) -> None:
    kart = world.karts[w, k]
    was_yellow, is_yellow = _calls_for_yellow(kart.trust), _calls_for_yellow(trust)
    kart.trust = trust
    report(world, w, codes.EVENT_POSE, k, trust, doubt)
    if is_yellow != was_yellow:
        report(world, w, codes.EVENT_FLAG, k, codes.YELLOW if is_yellow else codes.GREEN, 0)
    if trust == codes.OUT:
        retire(world, w, k, codes.LOST)
    if trust == codes.TRUSTED:
        # Wherever it went unseen: gates there do not count, and it is not fined for them.
        course = world.atlas.courses[world.rules[w].course]
        kart.line_index = nearest_sample_anywhere(world.atlas, course, kart.x, kart.y)
        if was_yellow:
            kart.cutting = 1
            kart.lap_clean = 0


@kernel
def _calls_for_yellow(trust: int) -> bool:
    return trust == codes.DOUBTFUL or trust == codes.PARKED
