"""What makes it impossible to park in a lot, as sentences: seen without a drawn round."""

from collections.abc import Iterator

import numpy as np

from race_server.core.level import Level
from race_server.core.vehicles import Vehicle
from race_server.scenario.level import level_named
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.site import area_in
from race_server.scenario.track.course import Course

PLAY = 0.05  # [m] that a slot is larger where all corners of a vehicle have to be inside
TOUCH = 0.05  # [m] an obstacle or another slot may reach so far into a slot
EQUAL = 1e-9  # [m] of a sum of lengths that are rounded


def faults_of(course: Course, vehicle: Vehicle) -> Iterator[str]:
    """Yield a sentence for everything that keeps a vehicle from parking in a car park."""
    yield from _missing(course)
    assert course.lot is not None
    yield from small_slots(course, vehicle, level_named(course.lot.level))
    yield from _hidden_slots(course)
    yield from _shared_slots(course)
    yield from _large_taken(course)
    yield from _bent_starts(course, vehicle)


def slots_of(course: Course) -> list[Footprint]:
    """Return the slots of a car park; none where goals lie in a zone."""
    assert course.lot is not None
    return [Footprint(*row) for row in course.lot.slots.tolist()]


def _missing(course: Course) -> Iterator[str]:
    lot = course.lot
    assert lot is not None
    roles = {zone.role for zone in lot.zones}
    if not len(lot.slots) and "goal" not in roles:
        yield "no slot: give [[rows]] of slots or a zone with role = 'goal'"
    if len(lot.slots) and "goal" in roles:
        yield "a zone with role = 'goal' beside [[rows]]: the slots are the goals; leave one out"
    if lot.from_slots and len(lot.slots) < 2:
        count = len(lot.slots)
        yield f"from_slots with {count} slots: give two, one to start in and one to go to"
    if not lot.from_slots and "start" not in roles:
        yield "no start: give a zone with role = 'start', or from_slots = true"
    if lot.from_slots and "start" in roles:
        yield "a zone with role = 'start' beside from_slots = true: leave one of the two out"
    if lot.taken.share and not len(lot.slots):
        yield f"[taken] share = {lot.taken.share:g} without [[rows]]: give rows, or leave it out"
    for role, count in (("blocks", lot.blocks.count[1]), ("people", lot.people.count)):
        if count and role not in roles:
            yield f"[{role}] count = {count}: give a zone with role = {role!r}"


def small_slots(course: Course, vehicle: Vehicle, level: Level) -> Iterator[str]:
    """Yield a sentence for each size of slots that a vehicle does not fit into as a level asks."""
    assert course.lot is not None
    play = PLAY if level.fits else 0.0
    sizes = course.lot.slots[:, 3:] if len(course.lot.slots) else np.array([course.lot.slot_size])
    for length, width in dict.fromkeys(map(tuple, sizes.tolist())):
        whole = vehicle.overall_length, vehicle.overall_width
        if length < whole[0] + play - EQUAL or width < whole[1] + play - EQUAL:
            more = f" by {play:g} m or more" if play else ""
            yield (
                f"a slot of {length:g} by {width:g} m is too small for {vehicle.name}, which is "
                f"{whole[0]:g} by {whole[1]:g} m; make it larger{more}, or choose another vehicle"
            )


def _hidden_slots(course: Course) -> Iterator[str]:
    area = area_in(course)[:, :2]
    for number, slot in enumerate(slots_of(course)):
        where = f"slot {number} at ({slot.x:.2f}, {slot.y:.2f}) m"
        corners = slot.corners
        if (corners < area.min(axis=0) - 1e-6).any() or (corners > area.max(axis=0) + 1e-6).any():
            yield f"{where} reaches out of the area; move its row"
        elif wall := wall_under(course, slot.grown(-TOUCH)):
            yield f"{where} lies under {wall}; move one of the two"


def _shared_slots(course: Course) -> Iterator[str]:
    slots = slots_of(course)
    if not slots:
        return
    middles = np.array([(slot.x, slot.y) for slot in slots])
    reach = np.array([0.5 * np.hypot(slot.length, slot.width) for slot in slots])
    gaps = np.hypot(*(middles[:, None] - middles[None]).transpose(2, 0, 1))
    pairs = np.argwhere(np.triu(gaps < reach[:, None] + reach[None], k=1))
    for one, other in pairs.tolist():
        if slots[one].grown(-0.5 * TOUCH).overlaps(slots[other].grown(-0.5 * TOUCH)):
            yield (
                f"slots {one} and {other} overlap near ({slots[other].x:.2f}, "
                f"{slots[other].y:.2f}) m: two vehicles with one place; move a row"
            )


def _large_taken(course: Course) -> Iterator[str]:
    """What is parked in a slot must not reach out of it: into the next one, the aisle, a wall."""
    lot = course.lot
    assert lot is not None
    if not lot.taken.share or not len(lot.slots):
        return
    length, width = lot.slots[:, 3:].min(axis=0).tolist()
    if lot.taken.length > length + EQUAL or lot.taken.width > width + EQUAL:
        yield (
            f"[taken] of {lot.taken.length:g} by {lot.taken.width:g} m: slots are from {length:g} "
            f"by {width:g} m on, and what is parked in one must not reach out of it; make it "
            "smaller, or the slots larger"
        )


def _bent_starts(course: Course, vehicle: Vehicle) -> Iterator[str]:
    """A vehicle that begins with a hitch bent beyond its limit is out at once."""
    lot = course.lot
    assert lot is not None
    limit = min((trailer.limit for trailer in vehicle.trailers), default=np.inf)
    widest = max((zone.hitch for zone in lot.zones if zone.role == "start"), default=0.0)
    if widest > limit and not lot.from_slots:
        yield (
            f"a start zone with hitch = {np.degrees(widest):g}: {vehicle.name} is jack-knifed "
            f"beyond {np.degrees(limit):.3g} degrees; give less, or choose another vehicle"
        )
