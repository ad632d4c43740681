"""Real karts: place each at the pose that it reports, as far as that is believed."""

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample_anywhere
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.trailers import straighten
from race_server.core.stages.events import report, retire
from race_server.core.state import Floats, World


@kernel
def place(world: World, w: int, placement: Floats) -> None:
    """Place one kart. placement: (10,), see state.PLACEMENT."""
    k, trust = int(placement[0]), int(placement[1])
    body = world.bodies[w, k]
    if body.status == codes.ABSENT:
        return
    body.x, body.y, body.heading = placement[3], placement[4], wrap_angle(placement[5])
    body.speed, body.lateral_speed, body.yaw_rate = placement[6], placement[7], placement[8]
    body.steering = placement[9]
    straighten(body, world.vehicles[w, k])  # no pose tells where its trailers are
    if trust != body.trust:
        _change_trust(world, w, k, trust, int(placement[2]))


@kernel
def _change_trust(world: World, w: int, k: int, trust: int, doubt: int) -> None:
    """Report how far a pose is believed now, with the flags and retirement that follow."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    was_yellow, is_yellow = _calls_for_yellow(body.trust), _calls_for_yellow(trust)
    body.trust = trust
    report(world, w, codes.EVENT_POSE, k, trust, doubt)
    if is_yellow != was_yellow:
        report(world, w, codes.EVENT_FLAG, k, codes.YELLOW if is_yellow else codes.GREEN, 0)
    if trust == codes.OUT:
        retire(world, w, k, codes.LOST)
    if trust == codes.TRUSTED:
        # Where it went unseen: gates there do not count, and it is not fined for them.
        course = world.route.courses[world.rules[w].course]
        if course.line_count > 0:  # a car park has no line
            racer.line_index = nearest_sample_anywhere(world.route, course, body.x, body.y)
        if was_yellow:
            racer.cutting = 1
            racer.lap_clean = 0


@kernel
def _calls_for_yellow(trust: int) -> bool:
    """Return whether a real kart of this trust is in the way of others."""
    return trust == codes.DOUBTFUL or trust == codes.SUSPENDED
