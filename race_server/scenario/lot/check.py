"""Check whether a vehicle can park in a car park, and what its rounds are like."""

from collections.abc import Iterator

import numpy as np

from race_server.core import codes
from race_server.core.state import Record, World
from race_server.core.vehicles import Vehicle, vehicle_named
from race_server.scenario.lot.faults import faults_of
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.ways import cut_off
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world
from race_server.scenario.track.check import CourseIssue
from race_server.scenario.track.course import Course

# Of the rounds, a larger share without a free place is an error.
FEW = 0.05
# Sentences of one kind that are told; the others are counted.
MOST_TOLD = 5
TOUCH = 1e-3  # [m] rectangles may overlap so much: the sides of a start are rounded


def check_lot(name: str, vehicle: str = "", rounds: int = 200) -> list[CourseIssue]:
    """Return all errors and warnings of a lot; none for a good one.

    vehicle: name, that of the lot where it is empty; rounds: to draw, under the seeds from 0.

    Raises:
        LotError, VehicleError: one of them does not exist, or the file is damaged.
    """
    course = load_lot(name)
    assert course.lot is not None
    vehicle = vehicle or course.lot.vehicle
    preset = vehicle_named(vehicle)
    errors = list(faults_of(course, preset)) or cut_off(course, preset)
    found = [CourseIssue("error", what) for what in errors[:MOST_TOLD]]
    if len(errors) > MOST_TOLD:
        found.append(CourseIssue("error", f"and {len(errors) - MOST_TOLD} more of this kind"))
    if errors or not rounds:
        return found
    world = make_world(parking_scenario(name, vehicle=vehicle), seeds=range(rounds))
    return [*found, *_rounds(course, preset, world)]


def _rounds(course: Course, vehicle: Vehicle, world: World) -> Iterator[CourseIssue]:
    """Yield what goes wrong in the rounds that were drawn."""
    lost: dict[str, list[str]] = {"start": [], "slot": []}
    scarce = 0
    rounds = len(world.races)
    for w in range(rounds):
        body, parker = world.bodies[w, 0], world.parking.parkers[w, 0]
        if under := touched_by(course, world, w, body_at(body, vehicle)):
            lost["start"].append(under)
        if parker.slot < 0 and (under := touched_by(course, world, w, slot_at(parker))):
            lost["slot"].append(under)
        there = int(np.sum(world.parking.blocks["kind"][w] == codes.OBSTACLE))
        scarce += there < course.lot.blocks.count[0] if course.lot else 0
    for what, walls in lost.items():
        if walls:
            yield CourseIssue(
                "error" if len(walls) > FEW * rounds else "warning",
                f"in {len(walls)} of {rounds} rounds ({len(walls) / rounds:.1%}) no free place was "
                f"found for the {what}: first it touches {walls[0]}; make its zone larger",
            )
    if scarce:
        yield CourseIssue(
            "warning",
            f"in {scarce} of {rounds} rounds ({scarce / rounds:.1%}) there was no room for the "
            "fewest blocks; make their zone larger, or ask for fewer",
        )


def slot_at(parker: Record) -> Footprint:
    """Return the slot that a vehicle goes to. parker: PARKER."""
    return Footprint(parker.x, parker.y, parker.heading, parker.length, parker.width)


def body_at(body: Record, vehicle: Vehicle) -> Footprint:
    """Return where a vehicle stands. body: BODY."""
    x = body.x + vehicle.box_offset * np.cos(body.heading)
    y = body.y + vehicle.box_offset * np.sin(body.heading)
    return Footprint(x, y, body.heading, vehicle.length, vehicle.width)


def blocks_in(world: World, w: int) -> list[Footprint]:
    """Return the blocks and parked vehicles of one round."""
    there = world.parking.blocks[w][world.parking.blocks["kind"][w] != codes.NOTHING]
    return [
        Footprint(one.x, one.y, one.heading, 2.0 * one.half_length, 2.0 * one.half_width)
        for one in there
    ]


def touched_by(course: Course, world: World, w: int, place: Footprint) -> str:
    """Return the name of what a place in one round touches; empty for nothing."""
    place = place.grown(-TOUCH)
    for block in blocks_in(world, w):
        if place.overlaps(block):
            return f"a block at ({block.x:.2f}, {block.y:.2f}) m"
    return wall_under(course, place)
