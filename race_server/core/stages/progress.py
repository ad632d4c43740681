"""After the motion: where each kart is, the gates it crossed, its laps and its surface."""

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample, progress_of
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.rules.effects import surface_at
from race_server.core.rules.laps import count_gate, crossing_share, is_missed, microseconds
from race_server.core.stages.events import penalise, report
from race_server.core.state import Record, World


@kernel
def follow_course(world: World, w: int) -> None:
    """Update progress, surface and laps of every kart."""
    atlas = world.atlas
    course = atlas.courses[world.rules[w].course]
    for k in range(world.karts.shape[1]):
        kart = world.karts[w, k]
        if kart.status != codes.RACING and kart.status != codes.FINISHED:
            continue
        kart.line_index = nearest_sample(atlas, course, kart.x, kart.y, kart.line_index)
        line = atlas.line[course.line_start + kart.line_index]
        progress, offset = progress_of(atlas, course, kart.x, kart.y, kart.line_index)
        gained = progress - kart.progress
        if gained > 0.5 * course.length:
            gained -= course.length
        elif gained < -0.5 * course.length:
            gained += course.length
        kart.progress = progress
        kart.distance += gained
        kart.lateral_offset = offset
        kart.heading_error = wrap_angle(kart.heading - line.heading)
        if course.verge > 0.0:
            kart.surface = surface_at(offset, line.left, line.right, course.kerb)
        kart.backward = max(kart.backward - gained, 0.0) if gained <= 0.0 else 0.0
        _cross_gates(world, w, k, course, gained)


@kernel
def _cross_gates(world: World, w: int, k: int, course: Record, gained: float) -> None:
    """Find the zone that the kart is in now and count the gate it crossed on the way.

    No kart drives past two gates in one tick: whoever does has jumped, and the gates in between
    do not count.
    """
    kart = world.karts[w, k]
    gates = course.gate_count
    crossed = False
    for _ in range(gates):
        following = kart.zone + 1 if kart.zone + 1 < gates else 0
        if gained >= 0.0 and 0.0 <= _past(world, course, kart.progress, following) <= gained:
            kart.zone = following
            crossed = True
        elif gained < 0.0 and gained <= _past(world, course, kart.progress, kart.zone) < 0.0:
            kart.zone = kart.zone - 1 if kart.zone > 0 else gates - 1
        else:
            break
    if crossed:
        past = _past(world, course, kart.progress, kart.zone)
        _cross(world, w, k, course, kart.zone, past, gained)


@kernel
def _past(world: World, course: Record, progress: float, gate: int) -> float:
    """Return how far past a gate a progress lies, in [-length/2, length/2)."""
    past = progress - world.atlas.gates[course.gate_start + gate].progress
    if past >= 0.5 * course.length:
        return past - course.length
    return past + course.length if past < -0.5 * course.length else past


@kernel
def _cross(
    world: World, w: int, k: int, course: Record, gate: int, past: float, gained: float
) -> None:
    kart, race, rules = world.karts[w, k], world.races[w], world.rules[w]
    gates = course.gate_count
    if kart.status != codes.RACING:
        return
    if gate != kart.next_gate:
        if kart.cutting == 0 and is_missed(kart.next_gate, gate, gates):
            kart.cutting = 1  # one penalty until it has gone back to the gate it missed
            kart.lap_clean = 0
            report(world, w, codes.EVENT_SHORT_CUT, k, kart.next_gate, 0)
            penalise(world, w, k, rules.short_cut_us, codes.EVENT_SHORT_CUT)
        return
    # The tick that is being stepped began at `race.tick`.
    share = crossing_share(past - gained, past)
    now_us = microseconds(race.tick - race.start_tick, share)
    counted = count_gate(kart.next_gate, kart.laps, gate, gates)
    kart.next_gate = counted.next_gate
    kart.cutting = 0
    if gate == 0 and kart.started == 0:
        # From the grid to the line: no lap. A standing start counts from the lights.
        kart.started = 1
        kart.lap_clean = 1
        if rules.standing_start == 0:
            kart.lap_start_us = now_us
            kart.sector_start_us = now_us
        return
    sector = world.atlas.gates[course.gate_start + gate].sector
    if sector > 0:
        report(world, w, codes.EVENT_SECTOR, k, sector, now_us - kart.sector_start_us)
        kart.sector_start_us = now_us
    if gate == 0:
        kart.laps = counted.lap
        _complete_lap(world, w, k, now_us)


@kernel
def _complete_lap(world: World, w: int, k: int, now_us: int) -> None:
    kart, race, rules = world.karts[w, k], world.races[w], world.rules[w]
    lap_us = now_us - kart.lap_start_us
    kart.last_lap_us = lap_us
    if kart.best_lap_us == 0 or lap_us < kart.best_lap_us:
        kart.best_lap_us = lap_us
    kart.lap_start_us = now_us
    kart.lap_clean = 1
    report(world, w, codes.EVENT_LAP, k, kart.laps, lap_us)
    if rules.laps > 0 and kart.laps >= rules.laps:
        kart.status = codes.FINISHED
        kart.finish_us = now_us
        race.finishers += 1
        if race.winner_tick == 0:
            race.winner_tick = race.tick
        report(world, w, codes.EVENT_FINISH, k, -1, now_us)
