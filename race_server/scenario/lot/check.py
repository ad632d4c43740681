"""Check whether a vehicle can park in a car park, and what its rounds are like."""

import math
from collections.abc import Iterator, Sequence

from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.lot.drawn import Drawn, draw_rounds
from race_server.scenario.lot.faults import faults_of
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.ways import cut_off
from race_server.scenario.track.check import CourseIssue
from race_server.scenario.track.course import Course

# Of the rounds, a larger share without a free place is an error.
FEW = 0.05
# Sentences of one kind that are told; the others are counted.
MOST_TOLD = 5
# [m] rectangles may overlap by this, and a start be nearer or farther: its place is rounded
TOUCH = 1e-3


def check_lot(
    name: str, vehicle: str = "", rounds: int = 200, vehicles: int = 1
) -> list[CourseIssue]:
    """Return all errors and warnings of a lot; none for a good one.

    vehicle: name, that of the lot where it is empty; rounds: to draw, under the seeds from 0;
    vehicles: that drive there.

    Raises:
        LotError, VehicleError, ScenarioError: the lot or the vehicle does not exist, the file is
            damaged, or there are more vehicles than slots.
    """
    course = load_lot(name)
    assert course.lot is not None
    preset = vehicle_named(vehicle or course.lot.vehicle)
    errors = list(faults_of(course, preset)) or cut_off(course, preset)
    found = [CourseIssue("error", what) for what in errors[:MOST_TOLD]]
    if len(errors) > MOST_TOLD:
        found.append(CourseIssue("error", f"and {len(errors) - MOST_TOLD} more of this kind"))
    if errors or not rounds:
        return found
    drawn = list(draw_rounds(name, range(rounds), vehicle, vehicles))
    return [*found, *_lost(course, drawn)]


def _lost(course: Course, drawn: Sequence[Drawn]) -> Iterator[CourseIssue]:
    """Yield what found no free place in the rounds that were drawn."""
    lot = course.lot
    assert lot is not None
    goals_are_drawn = not len(lot.slots)
    faults = {
        "start": [fault for one in drawn if (fault := _start_fault(course, one))],
        "slot": [fault for one in drawn if goals_are_drawn and (fault := _slot_fault(course, one))],
    }
    for what, found in faults.items():
        if found:
            share = len(found) / len(drawn)
            yield CourseIssue(
                "error" if share > FEW else "warning",
                f"in {len(found)} of {len(drawn)} rounds ({share:.1%}) no free place was found for "
                f"the {what}: first {found[0]}; make its zone larger",
            )
    crowded = [fault for one in drawn if (fault := _person_fault(course, one))]
    if crowded:
        yield CourseIssue(
            "warning",
            f"in {len(crowded)} of {len(drawn)} rounds ({len(crowded) / len(drawn):.1%}) no free "
            f"place was found for a person: first {crowded[0]}; make their zone larger",
        )
    scarce = sum(len(one.blocks) < lot.blocks.count[0] for one in drawn)
    if scarce:
        yield CourseIssue(
            "warning",
            f"in {scarce} of {len(drawn)} rounds ({scarce / len(drawn):.1%}) there was no room for "
            "the fewest blocks; make their zone larger, or ask for fewer",
        )


def _start_fault(course: Course, drawn: Drawn) -> str:
    """Return what is wrong with the starts of a round; empty for nothing."""
    assert course.lot is not None
    nearest, farthest = course.lot.distance
    for k, (start, slot) in enumerate(zip(drawn.starts, drawn.slots, strict=True)):
        others = [box for boxes in drawn.boxes[:k] for box in boxes]
        for box in drawn.boxes[k]:
            if fault := _touched(course, box, (*drawn.blocks, *drawn.parked), others):
                return fault
        away = math.hypot(start.x - slot.x, start.y - slot.y)
        if away < nearest - TOUCH or 0.0 < farthest < away - TOUCH:
            return f"it is {away:.2f} m from its slot"
    return ""


def _slot_fault(course: Course, drawn: Drawn) -> str:
    """Return what is wrong with the slots of a round; empty for nothing."""
    faults = (
        _touched(course, slot, drawn.blocks, drawn.slots[:k]) for k, slot in enumerate(drawn.slots)
    )
    return next(filter(None, faults), "")


def _person_fault(course: Course, drawn: Drawn) -> str:
    """Return what is wrong with the places where people begin; empty for nothing."""
    assert course.lot is not None
    side = math.sqrt(2.0) * course.lot.people.radius  # of the square inside of the disc
    squares = (Footprint(x, y, 0.0, side, side) for x, y, _, _ in drawn.people)
    faults = (_touched(course, square, (*drawn.blocks, *drawn.parked), ()) for square in squares)
    return next(filter(None, faults), "")


def _touched(
    course: Course,
    place: Footprint,
    blocks: Sequence[Footprint],
    others: Sequence[Footprint],
) -> str:
    """Return what a place touches, as a sentence; empty for nothing."""
    place = place.grown(-TOUCH)
    for what, those in (("a block", blocks), ("another", others)):
        for one in those:
            if place.overlaps(one):
                return f"it touches {what} at ({one.x:.2f}, {one.y:.2f}) m"
    wall = wall_under(course, place)
    return wall and f"it touches {wall}"
