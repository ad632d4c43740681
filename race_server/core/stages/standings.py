"""Ranks, and the end of the race."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.rules import edition
from race_server.core.rules.laps import race_distance
from race_server.core.rules.ranking import is_ahead
from race_server.core.stages.events import report, retire
from race_server.core.stages.progress import parks_after_race
from race_server.core.state import World


@kernel
def rank(world: World, w: int) -> None:
    """Give every kart its place, from 1; absent karts have none."""
    karts = world.bodies.shape[1]
    for k in range(karts):
        body, racer = world.bodies[w, k], world.racers[w, k]
        if body.status == codes.ABSENT:
            continue
        racer.ranked = ranked_distance(world, w, k)
    for k in range(karts):
        body, racer = world.bodies[w, k], world.racers[w, k]
        if body.status == codes.ABSENT:
            continue
        place = 1
        for other in range(karts):
            rival_body, rival_racer = world.bodies[w, other], world.racers[w, other]
            if (
                other != k
                and rival_body.status != codes.ABSENT
                and is_ahead(rival_body, rival_racer, body, racer)
            ):
                place += 1
        racer.rank = place


@kernel
def ranked_distance(world: World, w: int, k: int) -> float:
    """Return the distance [m] since the timing line by which a kart is ranked."""
    racer = world.racers[w, k]
    course = world.route.courses[world.rules[w].course]
    limit = course.length
    if racer.next_gate > 0:
        limit = world.route.gates[course.gate_start + racer.next_gate].progress
    elif racer.started == 0:
        limit = 0.0
    return race_distance(racer.distance, racer.laps, limit, course.length)


@kernel
def close_race(world: World, w: int) -> None:
    """End the race once no kart is racing or on its way to a slot, or the time is up."""
    race, rules = world.races[w], world.rules[w]
    if race.over != 0:
        return
    elapsed = race.tick - race.start_tick
    if rules.edition >= edition.SECOND:
        elapsed += 1  # with the tick that is being stepped
    late = rules.limit_ticks > 0 and elapsed >= rules.limit_ticks
    if race.winner_tick > 0 and rules.finish_limit_ticks > 0:
        late = late or race.tick - race.winner_tick >= rules.finish_limit_ticks
    racing = 0
    for k in range(world.bodies.shape[1]):
        if late:
            retire(world, w, k, codes.TIME_OUT)
        drives_on = not late and parks_after_race(world, w, k)
        if drives_on or world.bodies[w, k].status == codes.RACING:
            racing += 1
    if racing == 0:
        race.over = 1
        rank(world, w)
        report(world, w, codes.EVENT_RACE_OVER, -1, -1, 0)
