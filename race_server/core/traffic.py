"""Right of way between vehicles of one car park, by the ways that their drivers announce.

A driver announces the way that it planned, as the places of its body along it, and asks how far it
may drive. What lies between it and there is its own: no other vehicle is cleared into it. A
clearance is given only while an order is left in which all announced vehicles can drive to the ends
of their ways, one after the other, each standing until then where it was cleared to. So vehicles
that keep to their ways neither touch nor wait for each other in a circle, whatever their speeds.
This is the banker's algorithm: Dijkstra, Cooperating sequential processes, 1965.

Vehicles without a way stand where they are, and have to be driven around. A trailer is a box like
the one of the vehicle that draws it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from race_server.core import codes
from race_server.core.box_rows import Bools, boxes_of, listed, meeting, touching
from race_server.core.driven import are_driven
from race_server.core.state import Floats, Ints, World

# Two bodies come nearer than this on their ways [m]: they meet. Each is off its way by a few
# centimetres, and moves on between two places.
APART = 0.1
# A vehicle passes another one that stands at this distance [m] at least.
BESIDE = 0.04
# A plan keeps so far from other vehicles [m], besides its own margin, which is this at most: what
# it leaves is more than APART.
AROUND, MARGIN = 0.1, 0.05
# Slower than this [m/s] a vehicle stands. Where it is seen is off by this noise [m], and by what it
# moves in this time [s].
STANDING, NOISE, SCAN_S = 0.05, 0.1, 0.15
# Ways are compared place by place, and cleared in stretches of this number of places.
STRETCH = 4
# A vehicle is cleared this number of stretches ahead if it can be; of them, and of those farther
# away, it tries one of each few.
HORIZON, STRIDE, FAR_STRIDE = 16, 3, 12


@dataclass(eq=False)
class _Way:
    """A way, and how far a vehicle is on it.

    A stretch is the move from the end of the one before to its own end. The first is the place
    where the way begins alone, the last the one where it ends. A vehicle that waits stands
    somewhere in the stretch that it was cleared into.
    """

    boxes: Floats  # (P, U, 6) of the vehicle, see `boxes_of`
    passed: int = 0  # number of the stretch that was passed last
    cleared: int = 0  # number of the stretch to whose end it may drive
    refused: int = -1  # at this state of all ways it was cleared no farther

    @cached_property
    def ends(self) -> Ints:
        """The last place of each stretch, (S,)."""
        last = len(self.boxes) - 1
        return np.unique([*range(0, last, STRETCH), max(last - 1, 0), last])

    @cached_property
    def starts(self) -> Ints:
        """The first place of each stretch, (S,)."""
        return np.append(0, self.ends[:-1] + 1)

    @property
    def last(self) -> int:
        return len(self.ends) - 1

    def touches(self, others: Floats, apart: float, first: int = 0) -> Bools:
        """Return in which stretches from `first` on it comes near other boxes, (B, 6): (S,)."""
        start = int(self.starts[first])
        near = meeting(self.boxes[start:], others[:, None], apart).any(axis=1)
        return np.logical_or.reduceat(near, self.starts[first:] - start)


class Traffic:
    """What is known of all vehicles of one car park: where they are, and where they are going."""

    def __init__(self, vehicles: int) -> None:
        """Begin without ways."""
        self.boxes = np.zeros((vehicles, 1, 6))  # see `boxes_of`
        self.speeds = np.zeros(vehicles)  # [m/s]
        self.is_there: Bools = np.zeros(vehicles, bool)
        self.is_on_its_way: Bools = np.zeros(vehicles, bool)  # neither parked nor out
        self.changes = 0  # counts what began to stand, and what stands no more
        self._goals: dict[int, Floats] = {}
        self._ways: dict[int, _Way] = {}
        self._meets: dict[tuple[int, int], Bools] = {}  # see `_compare`
        self._will_meet: dict[tuple[int, int], Bools] = {}
        self._order: list[int] = []  # in which all could arrive, found last
        self._state = 0  # counts what clearances depend on
        self._planned = False

    def watch(self, world: World, w: int) -> None:
        """Take the places of all vehicles of a world; one that is not driven has no way left."""
        bodies, vehicles = world.bodies[w], world.vehicles[w]
        self.boxes = boxes_of(bodies, vehicles)
        self.speeds[:] = bodies["speed"]
        self.is_there[:] = bodies["status"] != codes.ABSENT
        drives = are_driven(world, w)
        self.changes += int((drives != self.is_on_its_way).any())
        self.is_on_its_way[:] = drives
        for number in [number for number in self._ways if not drives[number]]:
            self.withdraw(number)
        # A vehicle that drives without a way may have come out of one.
        has_none = np.delete(np.abs(self.speeds), list(self._ways))
        self._state += bool((has_none >= STANDING).any())
        self._planned = False

    def may_plan(self) -> bool:
        """Return True to the first driver that asks between two calls of `watch`.

        So a decision of all drivers takes the time of one plan at most.
        """
        is_first, self._planned = not self._planned, True
        return is_first

    def aim(self, number: int, goal: Floats) -> None:
        """Let others know where a vehicle will stand: one box, (6,), see `boxes_of`."""
        self._goals[number] = goal
        self.withdraw(number)

    def expected(self, number: int) -> Floats:
        """Return where other vehicles are that stand or keep to their ways: (B, 6), see `boxes_of`.

        They are larger than they are by what they move while a sensor scans. What drives without a
        way may do anything.
        """
        mask = self.is_there & (np.abs(self.speeds) < STANDING)
        mask[list(self._ways)] = True
        mask[number] = False
        boxes = self.boxes[mask]
        boxes[..., 4:] += (NOISE + SCAN_S * np.abs(self.speeds[mask]))[:, None, None]
        return listed(boxes)

    def obstacles(self, number: int, *, all_goals: bool) -> Floats:
        """Return what a vehicle has to plan around, (B, 6): what stands, and the goals of others.

        all_goals: also those of vehicles that have not announced a way yet.
        """
        standing = self._standing(number)
        goals = [
            goal
            for other, goal in self._goals.items()
            if other != number and self.is_on_its_way[other] and (all_goals or other in self._ways)
        ]
        boxes = np.concatenate([standing, np.reshape(goals, (-1, 6))])
        # From where it is already nearer there has to be a way, too.
        own, around = self.boxes[number], np.full(len(boxes), AROUND)
        for near, less in ((AROUND, BESIDE), (BESIDE, 0.0)):
            around[touching(boxes, own, near + MARGIN).any(axis=1)] = less
        boxes[:, 4:] += around[:, None]
        return boxes

    def _standing(self, number: int) -> Floats:
        """Return the boxes of other vehicles without a way."""
        mask = self.is_there.copy()
        mask[[number, *self._ways]] = False
        return listed(self.boxes[mask])

    def announce(self, number: int, boxes: Floats) -> bool:
        """Take the way of a vehicle, (P, U, 6) places of its boxes; False where it blocks others.

        The vehicle is at the first place. Places are so near to each other that no corner
        moves by more than APART from one to the next.
        """
        self.withdraw(number)
        self._ways[number] = _Way(boxes)
        self._state += 1
        for other in self._ways:
            if other != number:
                self._compare(number, other)
        if self._can_all_arrive(number, 0):
            self.changes += 1
            return True
        self.withdraw(number)
        return False

    def _compare(self, one: int, other: int) -> None:
        """Find where on their ways two vehicles meet.

        `_meets[one, other]`, (S, T): in stretch s of one and stretch t of the other; `_will_meet`:
        somewhere behind s, while the other is in t.
        """
        way, its = self._ways[one], self._ways[other]
        meets = meeting(way.boxes, its.boxes, APART)
        meets = np.logical_or.reduceat(meets, way.starts, axis=0)
        meets = np.logical_or.reduceat(meets, its.starts, axis=1)
        for pair, table in (((one, other), meets), ((other, one), meets.T)):
            self._meets[pair] = table
            behind = np.logical_or.accumulate(table[:0:-1], axis=0)[::-1]
            self._will_meet[pair] = np.concatenate([behind, np.zeros_like(table[:1])])

    def withdraw(self, number: int) -> None:
        """Forget the way of a vehicle: it stops, and stands."""
        if self._ways.pop(number, None) is None:
            return
        self.changes += 1
        self._state += 1
        for pair in [pair for pair in self._meets if number in pair]:
            del self._meets[pair], self._will_meet[pair]

    def has_way(self, number: int) -> bool:
        """Return whether a vehicle has a way that is announced."""
        return number in self._ways

    def clear(self, number: int, passed: int) -> int:
        """Return the number of the place that a vehicle may drive to.

        passed: number of the place on its way that it has passed.
        """
        way = self._ways[number]
        stretch = int(np.searchsorted(way.ends, passed, side="right")) - 1
        now = max(way.passed, min(stretch, way.cleared))
        self._state += now > way.passed
        way.passed = now
        first, wanted = way.cleared + 1, min(now + HORIZON, way.last)
        if first <= wanted and way.refused != self._state:
            self._clear_on(number, first, wanted)
        return int(way.ends[way.cleared])

    def _clear_on(self, number: int, first: int, wanted: int) -> None:
        """Clear a vehicle into stretches from `first` to `wanted`, and as far on as it must."""
        way, free = self._ways[number], self._free_until(number, first)
        near = range(min(free, wanted), way.cleared, -STRIDE)
        # Beyond a narrow place an order may be left where there is none inside of it.
        for stretch in (*near, *range(wanted + FAR_STRIDE, free, FAR_STRIDE), max(free, wanted)):
            if stretch <= free and self._can_all_arrive(number, stretch):
                self._state += 1
                way.cleared = stretch
                return
        way.refused = self._state

    def _free_until(self, number: int, first: int) -> int:
        """Return the last stretch from `first` on before which no other vehicle is in the way."""
        way = self._ways[number]
        blocked = np.zeros(way.last + 1, bool)
        for other, its in self._ways.items():
            if other != number:
                driven = slice(min(its.passed + 1, its.cleared), its.cleared + 1)
                held = self._meets[number, other][first:, driven]
                blocked[first:] |= held.any(axis=1)
        blocked[first:] |= self._is_occupied(number, first)
        return first + int(blocked[first:].argmax()) - 1 if blocked[first:].any() else way.last

    def is_obstructed(self, number: int) -> bool:
        """Return whether a vehicle without a way stands on the way of this one."""
        way = self._ways[number]
        return bool(self._is_occupied(number, min(way.passed + 1, way.last)).any())

    def _is_occupied(self, number: int, first: int) -> Bools:
        """Return in which stretches of a way from `first` on a vehicle without a way stands."""
        way, standing = self._ways[number], self._standing(number)
        is_near = touching(way.boxes[0], standing, BESIDE).any(axis=0)
        beside = way.touches(standing[~is_near], BESIDE, first)
        return beside | way.touches(standing[is_near], 0.0, first)

    def _can_all_arrive(self, number: int, stretch: int) -> bool:
        """Return whether an order is left for all, once a vehicle is cleared into a stretch."""
        stretches = {other: way.cleared for other, way in self._ways.items()} | {number: stretch}
        left = [other for other in self._order if other in stretches]
        left += [other for other in stretches if other not in left]
        order: list[int] = []
        while left:
            for one in left:
                if self._can_arrive(one, stretches, left, order):
                    left.remove(one)
                    order.append(one)
                    break
            else:
                return False
        self._order = order
        return True

    def _can_arrive(
        self, one: int, stretches: dict[int, int], left: list[int], arrived: list[int]
    ) -> bool:
        """Return whether a vehicle can drive to its end, the others standing.

        stretches: of those that are left, in which they stand; the others have arrived at the ends
        of their ways.
        """
        stretch = stretches[one]
        return not (
            any(o != one and self._will_meet[one, o][stretch, stretches[o]] for o in left)
            or any(self._will_meet[one, o][stretch, -1] for o in arrived)
        )
