"""Check whether a vehicle can park in a car park, and what its rounds are like."""

import math
from collections.abc import Callable, Iterator, Sequence

from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.level import level_named
from race_server.scenario.lot.drawn import Drawn, draw_rounds
from race_server.scenario.lot.faults import faults_of
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.ways import Ways, cut_off
from race_server.scenario.track.check import CourseIssue
from race_server.scenario.track.course import Course

# Of the rounds, a larger share without a free place is an error.
FEW = 0.05
# Rounds of which it is asked whether they are hopeless are drawn by this number.
AT_ONCE = 64
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
    errors = list(faults_of(course, preset))
    if not errors:
        ways = Ways(course, preset)
        errors = cut_off(ways)
    found = [CourseIssue("error", what) for what in errors[:MOST_TOLD]]
    if len(errors) > MOST_TOLD:
        found.append(CourseIssue("error", f"and {len(errors) - MOST_TOLD} more of this kind"))
    if errors or not rounds:
        return found
    drawn = list(draw_rounds(name, range(rounds), vehicle, vehicles))
    return [*found, *_lost(course, drawn), *_parted(ways, drawn)]


def hopeless(
    name: str, seeds: Sequence[int], vehicle: str = "", vehicles: int = 1
) -> dict[int, str]:
    """Return why a vehicle can never park in some rounds, by the seeds of those.

    seeds: of the rounds; other arguments and errors are those of `check_lot`.
    """
    course = load_lot(name)
    assert course.lot is not None
    ways = Ways(course, vehicle_named(vehicle or course.lot.vehicle))
    faults = {}
    parts = [seeds[first : first + AT_ONCE] for first in range(0, len(seeds), AT_ONCE)]
    rounds = (one for part in parts for one in draw_rounds(name, part, vehicle, vehicles))
    for seed, drawn in zip(seeds, rounds, strict=True):
        if start := _standing_fault(course, drawn):
            faults[seed] = f"a vehicle has no free place to start: {start}"
        elif not len(course.lot.slots) and (slot := _slot_fault(course, drawn)):
            faults[seed] = f"a slot has no free place: {slot}"
        elif way := _way_fault(ways, drawn):
            faults[seed] = way
    return faults


def _lost(course: Course, drawn: Sequence[Drawn]) -> Iterator[CourseIssue]:
    """Yield what found no free place in the rounds that were drawn."""
    lot = course.lot
    assert lot is not None
    finds: dict[str, Callable[[Course, Drawn], str]] = {"start": _start_fault}
    if not len(lot.slots):
        finds["slot"] = _slot_fault
    for what, fault_in in finds.items():
        found = [fault_in(course, one) for one in drawn]
        yield from _told(
            found, f"no free place was found for the {what}", "make its zone larger", is_fatal=True
        )
    found = [_person_fault(course, one) for one in drawn]
    yield from _told(
        found, "no free place was found for a person", "make their zone larger", is_fatal=False
    )
    scarce = sum(len(one.blocks) < lot.blocks.count[0] for one in drawn)
    if scarce:
        yield CourseIssue(
            "warning",
            f"in {scarce} of {len(drawn)} rounds ({scarce / len(drawn):.1%}) there was no room for "
            "the fewest blocks; make their zone larger, or ask for fewer",
        )


def _parted(ways: Ways, drawn: Sequence[Drawn]) -> Iterator[CourseIssue]:
    """Yield in which of the rounds that were drawn a wall parts a vehicle from its slot."""
    found = [_way_fault(ways, one) for one in drawn]
    way_out = "leave a gate, or keep zones and slots on one side of a wall"
    yield from _told(found, "a vehicle cannot get to its slot", way_out, is_fatal=True)


def _told(
    faults: Sequence[str], what: str, way_out: str, *, is_fatal: bool
) -> Iterator[CourseIssue]:
    """Yield how many rounds have a fault. faults: of each round, empty for none."""
    count = sum(map(bool, faults))
    if count:
        share, first = count / len(faults), next(n for n, fault in enumerate(faults) if fault)
        yield CourseIssue(
            "error" if is_fatal and share > FEW else "warning",
            f"in {count} of {len(faults)} rounds ({share:.1%}) {what}, first under the seed "
            f"{first}: {faults[first]}; {way_out}",
        )


def _way_fault(ways: Ways, drawn: Drawn) -> str:
    """Return which vehicle no free way leads to its slot in a round; empty for none."""
    for boxes, slot in zip(drawn.boxes, drawn.slots, strict=True):
        x, y = boxes[0].x, boxes[0].y
        goal = ways.regions((slot.x, slot.x), (slot.y, slot.y))
        if ways.regions((x, x), (y, y)).isdisjoint(goal):
            return (
                f"no free way leads from ({x:.2f}, {y:.2f}) m to the slot at ({slot.x:.2f}, "
                f"{slot.y:.2f}) m"
            )
    return ""


def _standing_fault(course: Course, drawn: Drawn) -> str:
    """Return what a vehicle touches where it starts in a round; empty for nothing."""
    for k, boxes in enumerate(drawn.boxes):
        others = [box for before in drawn.boxes[:k] for box in before]
        for box in boxes:
            if fault := _touched(course, box, (*drawn.blocks, *drawn.parked), others):
                return fault
    return ""


def _start_fault(course: Course, drawn: Drawn) -> str:
    """Return what is wrong with the starts of a round; empty for nothing."""
    assert course.lot is not None
    if fault := _standing_fault(course, drawn):
        return fault
    nearest, farthest = course.lot.distance
    leave = level_named(course.lot.level).leave
    for start, slot in zip(drawn.starts, drawn.slots, strict=True):
        away = math.hypot(start.x - slot.x, start.y - slot.y)
        if away < nearest - TOUCH or 0.0 < farthest < away - TOUCH:
            return f"it is {away:.2f} m from its slot"
        if 0.0 < leave < away:
            return (
                f"it is {away:.2f} m from its slot, and by the level {course.lot.level} a vehicle "
                f"beyond {leave:g} m has left"
            )
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
