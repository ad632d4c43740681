"""Vehicles on their way to a slot: how far they drove, whether they are parked or have left.

In a car park they are on their way from the start. Where there is a line to race along, a kart goes
to a slot once it has finished, if it has one by then.
"""

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.boxes import box_count, box_of, hull_of
from race_server.core.kernels.jit import kernel
from race_server.core.rules.laps import microseconds
from race_server.core.rules.parking import has_parked, judged_box, stand_of
from race_server.core.stages.blocks import forget_rooms
from race_server.core.stages.events import report, retire
from race_server.core.stages.progress import has_line, parks_after_race
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
        if has_line(world, w) and body.status != codes.FINISHED:
            continue
        if body.status == codes.RACING or parks_after_race(world, w, k):
            _count_way(body, parker)
            _judge_stand(world, w, k)
        is_done = body.status != codes.RACING and not parks_after_race(world, w, k)
        if is_done and world.parking.blocks[w, k].kind == codes.NOTHING:
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
    vehicle = world.vehicles[w, k]
    stand = stand_of(parker, vehicle, body, judged_box(parker, vehicle))
    if has_parked(parker, vehicle, body, stand):
        parker.held_ticks += 1
        if parker.held_ticks > parker.hold_ticks:
            _finish(world, w, k, stand_of(parker, vehicle, body, vehicle.trailer_count).turn)
        return
    parker.held_ticks = 0
    square = stand.along * stand.along + stand.across * stand.across
    if parker.leave > 0.0 and square > parker.leave * parker.leave:
        retire(world, w, k, codes.LEFT_LOT)


@kernel
def _finish(world: World, w: int, k: int, turn: float) -> None:
    """Count a vehicle as parked. turn: heading of its last box against the slot's [rad]."""
    body, racer, race = world.bodies[w, k], world.racers[w, k], world.races[w]
    parker = world.parking.parkers[w, k]
    body.speed = body.lateral_speed = body.yaw_rate = 0.0
    parker.parked_tick = race.tick
    if body.status == codes.RACING:
        body.status = codes.FINISHED
        # The tick that is being stepped began at `race.tick`.
        racer.finish_us = microseconds(race.tick - race.start_tick, 1.0)
        race.finishers += 1
        if race.winner_tick == 0:
            race.winner_tick = race.tick
    report(world, w, codes.EVENT_PARKED, k, parker.slot, round(abs(turn) * 1000.0))


@kernel
def _become_block(world: World, w: int, k: int) -> None:
    """Let others meet a vehicle where it stands, parked or crashed."""
    body, vehicle, count = world.bodies[w, k], world.vehicles[w, k], world.bodies.shape[1]
    for number in range(box_count(vehicle)):
        block = world.parking.blocks[w, number * count + k]
        hull = hull_of(vehicle, body, number)
        box = box_of(hull)
        block.x, block.y, block.heading = box.x, box.y, hull.heading
        block.half_length, block.half_width = box.half_length, box.half_width
        block.kind = codes.KART_HIT
    forget_rooms(world.parking.rooms[w])
