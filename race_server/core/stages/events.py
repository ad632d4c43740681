"""Events: how a stage reports what happened."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import EVENTS, Record, World


@kernel
def report(world: World, w: int, kind: int, kart: int, other: int, value: int) -> None:
    """Add an event of this tick.

    kind: EventKind; kart: number, -1 for an event of the whole race; other, value: as the kind
    needs them.
    """
    race = world.races[w]
    race.sequence += 1
    count = world.event_counts[w]
    if count < EVENTS:
        event = world.events[w, count]
        event.sequence = race.sequence
        event.tick = race.tick
        event.kind = kind
        event.kart = kart
        event.other = other
        event.value = value
        event.detail = 0
        world.event_counts[w] = count + 1


@kernel
def report_lap(world: World, w: int, kart: int, lap_us: int, is_clean: bool) -> None:
    """Add the event of a lap that a kart has completed. lap_us: its time [µs]."""
    count = world.event_counts[w]
    report(world, w, codes.EVENT_LAP, kart, world.racers[w, kart].laps, lap_us)
    if count < EVENTS:
        world.events[w, count].detail = codes.CLEAN if is_clean else codes.UNCLEAN


@kernel
def penalise(world: World, w: int, k: int, penalty_us: int, cause: int) -> None:
    """Add `penalty_us` to the race time of a kart; nothing for a penalty of zero."""
    if penalty_us > 0:
        racer: Record = world.racers[w, k]
        racer.penalties += 1
        racer.penalty_us += penalty_us
        report(world, w, codes.EVENT_PENALTY, k, cause, penalty_us)


@kernel
def retire(world: World, w: int, k: int, reason: int) -> None:
    """Take a kart out of the race."""
    body: Record = world.bodies[w, k]
    racer: Record = world.racers[w, k]
    if body.status == codes.RACING:
        body.status = codes.RETIRED
        racer.retired_for = reason
        body.speed = body.lateral_speed = body.yaw_rate = 0.0
        report(world, w, codes.EVENT_RETIRED, k, reason, 0)
