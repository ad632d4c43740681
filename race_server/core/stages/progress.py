"""After the motion: where each kart is, the gates it crossed, its laps and its surface."""

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample, progress_of
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.rules.effects import surface_at
from race_server.core.rules.laps import count_gate, crossing_share, is_missed, microseconds
from race_server.core.rules.parking import goes_to_slot
from race_server.core.stages.events import penalise, report, report_lap
from race_server.core.state import Record, World

# Gates that a kart may pass in one tick between walls.
MOST_PASSED = 2


@kernel
def has_line(world: World, w: int) -> bool:
    """Return whether one world has a course to follow; a car park has none."""
    return bool(world.route.courses[world.rules[w].course].line_count > 0)


@kernel
def parks_after_race(world: World, w: int, k: int) -> bool:
    """Return whether a kart has finished its race and drives to its slot."""
    parkers = world.parking.parkers[w]
    if len(parkers) == 0 or not has_line(world, w):
        return False
    return goes_to_slot(world.bodies[w, k], parkers[k])


@kernel
def follow_course(world: World, w: int) -> None:
    """Update progress, surface and laps of every kart."""
    route = world.route
    course = route.courses[world.rules[w].course]
    for k in range(world.bodies.shape[1]):
        body, racer = world.bodies[w, k], world.racers[w, k]
        if body.status != codes.RACING and body.status != codes.FINISHED:
            continue
        racer.line_index = nearest_sample(route, course, body.x, body.y, racer.line_index)
        line = route.line[course.line_start + racer.line_index]
        progress, offset = progress_of(route, course, body.x, body.y, racer.line_index)
        gained = progress - racer.progress
        if gained > 0.5 * course.length:
            gained -= course.length
        elif gained < -0.5 * course.length:
            gained += course.length
        racer.progress = progress
        racer.distance += gained
        racer.lateral_offset = offset
        racer.heading_error = wrap_angle(body.heading - line.heading)
        if course.verge > 0.0:
            body.surface = surface_at(offset, line.left, line.right, course.kerb)
        racer.backward = max(racer.backward - gained, 0.0) if gained <= 0.0 else 0.0
        _cross_gates(world, w, k, course, gained)


@kernel
def _cross_gates(world: World, w: int, k: int, course: Record, gained: float) -> None:
    """Find the zone that the kart is in now and count the gate it crossed on the way.

    A kart that passes two gates in one tick has jumped, and those in between do not count. Between
    walls it may have driven around the tip of one, closer than the centre line does: two count.
    """
    racer = world.racers[w, k]
    gates = course.gate_count
    passed = 0
    for _ in range(gates):
        following = racer.zone + 1 if racer.zone + 1 < gates else 0
        if gained >= 0.0 and 0.0 <= _past(world, course, racer.progress, following) <= gained:
            racer.zone = following
            passed += 1
        elif gained < 0.0 and gained <= _past(world, course, racer.progress, racer.zone) < 0.0:
            racer.zone = racer.zone - 1 if racer.zone > 0 else gates - 1
        else:
            break
    most = MOST_PASSED if course.verge == 0.0 else 1
    counted = passed if passed <= most else 1
    for back in range(counted):
        gate = (racer.zone + gates - counted + 1 + back) % gates
        past = _past(world, course, racer.progress, gate)
        _cross(world, w, k, course, gate, past, gained)


@kernel
def _past(world: World, course: Record, progress: float, gate: int) -> float:
    """Return how far past a gate a progress lies, in [-length/2, length/2)."""
    past = progress - world.route.gates[course.gate_start + gate].progress
    if past >= 0.5 * course.length:
        return past - course.length
    return past + course.length if past < -0.5 * course.length else past


@kernel
def _cross(
    world: World, w: int, k: int, course: Record, gate: int, past: float, gained: float
) -> None:
    """Count a gate that a kart crossed forwards.

    past: how far behind the kart it lies now [m]; gained: progress of this tick [m].
    """
    body, racer = world.bodies[w, k], world.racers[w, k]
    race, rules = world.races[w], world.rules[w]
    gates = course.gate_count
    if body.status != codes.RACING:
        return
    if gate != racer.next_gate:
        if racer.cutting == 0 and is_missed(racer.next_gate, gate, gates):
            racer.cutting = 1  # one penalty until it has gone back to the gate it missed
            racer.lap_clean = 0
            report(world, w, codes.EVENT_SHORT_CUT, k, racer.next_gate, 0)
            penalise(world, w, k, rules.short_cut_us, codes.EVENT_SHORT_CUT)
        return
    # The tick that is being stepped began at `race.tick`.
    share = crossing_share(past - gained, past)
    now_us = microseconds(race.tick - race.start_tick, share)
    counted = count_gate(racer.next_gate, racer.laps, gate, gates)
    racer.next_gate = counted.next_gate
    racer.cutting = 0
    if gate == 0 and racer.started == 0:
        # From the grid to the line: no lap. A standing start counts from the lights.
        racer.started = 1
        racer.lap_clean = 1
        if rules.standing_start == 0:
            racer.lap_start_us = now_us
            racer.sector_start_us = now_us
        return
    sector = world.route.gates[course.gate_start + gate].sector
    if sector > 0:
        report(world, w, codes.EVENT_SECTOR, k, sector, now_us - racer.sector_start_us)
        racer.sector_start_us = now_us
    if gate == 0:
        racer.laps = counted.lap
        _complete_lap(world, w, k, now_us)


@kernel
def _complete_lap(world: World, w: int, k: int, now_us: int) -> None:
    """Count a lap that ended at `now_us` [µs] after the start, and finish after the last."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    race, rules = world.races[w], world.rules[w]
    lap_us = now_us - racer.lap_start_us
    racer.last_lap_us = lap_us
    if racer.best_lap_us == 0 or lap_us < racer.best_lap_us:
        racer.best_lap_us = lap_us
    racer.lap_start_us = now_us
    report_lap(world, w, k, lap_us, racer.lap_clean != 0)
    racer.lap_clean = 1
    if rules.laps > 0 and racer.laps >= rules.laps:
        body.status = codes.FINISHED
        racer.finish_us = now_us
        race.finishers += 1
        if race.winner_tick == 0:
            race.winner_tick = race.tick
        report(world, w, codes.EVENT_FINISH, k, -1, now_us)
