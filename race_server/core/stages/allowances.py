"""What flags, effects and surface leave of a kart's speed, motor and grip."""

from race_server.core import codes
from race_server.core.kernels.course import way_to
from race_server.core.kernels.jit import kernel
from race_server.core.rules.effects import sum_effects, surface_grip
from race_server.core.stages.progress import parks_after_race
from race_server.core.state import Record, World

# A yellow flag around a kart begins this number of lengths before it and ends this number behind.
YELLOW_BEFORE, YELLOW_BEHIND = 12.0, 3.0
# A kart that has finished drives to its slot at this speed at most [m/s].
PIT_SPEED = 5.0


@kernel
def set_allowances(world: World, w: int) -> None:
    """Set the speed cap [m/s] and the scales of motor and grip of every kart."""
    race, rules = world.races[w], world.rules[w]
    held = race.flag == codes.RED or race.tick < race.hold_until
    show_yellow(world, w)
    for k in range(world.bodies.shape[1]):
        body, racer = world.bodies[w, k], world.racers[w, k]
        if body.status == codes.ABSENT:
            continue
        speed, thrust, grip = sum_effects(world.players[w, k])
        body.speed_cap = speed * world.vehicles[w, k].top_speed
        body.thrust_scale = thrust
        body.grip_scale = grip * surface_grip(body.surface)
        if held or body.status != codes.RACING or body.trust >= codes.SUSPENDED:
            parks = not held and parks_after_race(world, w, k) and body.trust < codes.SUSPENDED
            body.speed_cap = min(body.speed_cap, PIT_SPEED) if parks else 0.0
        elif race.flag == codes.YELLOW or racer.yellow:
            body.speed_cap = min(body.speed_cap, rules.yellow_speed)


@kernel
def show_yellow(world: World, w: int) -> None:
    """Show a yellow flag to all karts near one whose place is in doubt, itself included."""
    karts = world.bodies.shape[1]
    troubled = False
    for k in range(karts):
        body, racer = world.bodies[w, k], world.racers[w, k]
        racer.yellow = 0
        troubled = troubled or _is_in_trouble(body)
    if not troubled:
        return
    course = world.route.courses[world.rules[w].course]
    for other in range(karts):
        trouble_body, trouble_racer = world.bodies[w, other], world.racers[w, other]
        if not _is_in_trouble(trouble_body):
            continue
        length = world.vehicles[w, other].length
        for k in range(karts):
            body, racer = world.bodies[w, k], world.racers[w, k]
            way = way_to(course, racer.progress, trouble_racer.progress)
            if -YELLOW_BEHIND * length <= way <= YELLOW_BEFORE * length:
                racer.yellow = 1


@kernel
def _is_in_trouble(body: Record) -> bool:
    """Return whether a kart that races is not where it is believed to be."""
    return bool(body.trust >= codes.DOUBTFUL and body.status == codes.RACING)
