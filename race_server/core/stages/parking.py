"""Vehicles on their way to a slot: how far they drove, whether they are parked or have left."""

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.boxes import hull_of
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.rules.laps import microseconds
from race_server.core.rules.parking import is_parked, stand_in
from race_server.core.stages.events import report, retire
from race_server.core.state import Record, World

# Slower than this [m/s] a vehicle drives neither forward nor back.
CREEP = 0.02


@kernel
def park(world: World, w: int) -> None:
    """Follow every vehicle that goes to a slot, and let those that are done stand as blocks."""
    parkers = world.parking.parkers[w]
    for k in range(len(parkers)):
        body, parker = world.bodies[w, k], parkers[k]
        if parker.length <= 0.0 or body.status == codes.ABSENT:
            continue
        if body.status == codes.RACING:
            _count_way(body, parker)
            _judge_stand(world, w, k)
        if body.status != codes.RACING and world.parking.blocks[w, k].kind == codes.NOTHING:
            _become_block(world, w, k)


@kernel
def _count_way(body: Record, parker: Record) -> None:
    """Add what a vehicle drove in this tick, and count a change of direction."""
    parker.way += abs(body.speed) * TICK_S
    if body.speed < 0.0:
        parker.reversed -= body.speed * TICK_S
    gear = 0
    if body.speed > CREEP:
        gear = 1
    elif body.speed < -CREEP:
        gear = -1
    if gear != 0:
        if parker.gear == -gear:
            parker.moves += 1
        parker.gear = gear


@kernel
def _judge_stand(world: World, w: int, k: int) -> None:
    """Finish a vehicle that stood well in its slot for long enough; retire one that left."""
    body, parker = world.bodies[w, k], world.parking.parkers[w, k]
    hull = hull_of(world.vehicles[w, k], body, 0)
    stand = stand_in(parker, hull)
    if is_parked(parker, hull, stand, body.speed):
        parker.held_ticks += 1
        if parker.held_ticks > parker.hold_ticks:
            _finish(world, w, k, stand.turn)
        return
    parker.held_ticks = 0
    square = stand.along * stand.along + stand.across * stand.across
    if parker.leave > 0.0 and square > parker.leave * parker.leave:
        retire(world, w, k, codes.LEFT_LOT)


@kernel
def _finish(world: World, w: int, k: int, turn: float) -> None:
    """Count a vehicle as parked. turn: its heading against the slot's [rad]."""
    body, racer, race = world.bodies[w, k], world.racers[w, k], world.races[w]
    parker = world.parking.parkers[w, k]
    body.status = codes.FINISHED
    body.speed = body.lateral_speed = body.yaw_rate = 0.0
    parker.parked_tick = race.tick
    # The tick that is being stepped began at `race.tick`.
    racer.finish_us = microseconds(race.tick - race.start_tick, 1.0)
    race.finishers += 1
    if race.winner_tick == 0:
        race.winner_tick = race.tick
    report(world, w, codes.EVENT_PARKED, k, parker.slot, round(abs(turn) * 1000.0))


@kernel
def _become_block(world: World, w: int, k: int) -> None:
    """Let others meet a vehicle where it stands, parked or crashed."""
    body, vehicle, block = world.bodies[w, k], world.vehicles[w, k], world.parking.blocks[w, k]
    hull = hull_of(vehicle, body, 0)
    cos, sin = cos_sin(hull.heading)
    block.x, block.y = hull.x + hull.offset * cos, hull.y + hull.offset * sin
    block.heading = hull.heading
    block.half_length, block.half_width = hull.half_length, hull.half_width
    block.kind = codes.KART_HIT
