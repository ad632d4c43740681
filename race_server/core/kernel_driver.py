"""Drivers that decide in a kernel.

A scripted driver is one function of a `Cockpit`. Training runs it compiled, for hundreds of karts
in one call; a driver's own process runs the same function as plain Python and never waits for a
compiler. `KernelDriver` makes a `Driver` of it.
"""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing
from race_server.core.kernels.jit import INTERPRET, bind, written_out
from race_server.core.messages import Button, Control
from race_server.core.observation import Layout, Observation, offsets_of
from race_server.core.rules.items import items
from race_server.core.state import Floats, Ints, Record, Records
from race_server.core.vehicles import vehicle_record

# Places in `Cockpit.setup`: lidar field [rad], lidar reach [m], time between decisions [s].
FIELD, REACH, DECISION = range(3)

# Places in `Cockpit.memory`. How long the kart has stood, or, negative, driven, and how long it is
# still to reverse [s]; the steering while it reverses; attempts to get free; whether a button is
# down; the lane left of the line, or what a driver keeps instead; sum and age [s] of the last scan.
STANDING, REVERSING, ESCAPE, ATTEMPTS, PRESSED, SHIFT, SCAN_SUM, SCAN_AGE = range(8)
# Advice of a policy to a driver that takes it, zeros without one: lane to the left [m], more speed
# as a share, the button (press above URGENT, hold below its negative), more speed as a share where
# no bend forbids it, the share of the distance to the kart ahead that is given up, and whether to
# fetch the next box (above URGENT). From LATELY on: the estimated latency and the commands given
# last, see `agents/planning/latency.py`.
ASIDE, FASTER, URGE, DASH, CLOSE, FETCH, LATELY = range(8, 15)
URGENT = 0.3
# What a driver keeps of its turns, see `agents/planning/turn_back.py`.
TURNED = LATELY + 32
# How many places it has driven through and which, see `agents/planning/driven_way.py`.
DRIVEN, DRIVEN_POINTS = TURNED + 4, 16
# What the actions of a policy keep, see `race_server/envs/actions.py`.
ACTED = DRIVEN + 1 + 2 * DRIVEN_POINTS
# Two scans, the points of a scan (x, y), and a row of WORK numbers: see `memory_size`.
KEPT = ACTED + 6
WORK = 320
# After a longer time [s] without an observation only this much of it counts.
LONGEST_S = 1.0


class Cockpit(NamedTuple):
    """All that one decision of one kart reads and writes.

    Where kernels are interpreted these are lists, and the vehicle has attributes like a record.
    """

    observation: Floats  # (size,) in SI units; a driver may write into it
    offsets: Ints  # (parts + 1,) where each part begins, see `observation.offsets_of`
    vehicle: Record  # VEHICLE
    setup: Floats  # (3,) FIELD, REACH, DECISION
    item_uses: Ints  # (items + 1,) what using each item does, by item number
    memory: Floats  # (M,) kept from one decision to the next, zeros at the start of a race
    control: Floats  # (4,) to be filled: steering, throttle, brake, buttons


class Cockpits(NamedTuple):
    """The cockpits of all karts that one driver drives in a batch."""

    seats: Ints  # (n, 2) world and kart of each
    observations: Floats  # (W, K, size)
    offsets: Ints  # (parts + 1,)
    vehicles: Records  # (W, K) VEHICLE
    setup: Floats  # (3,)
    item_uses: Ints  # (items + 1,)
    memory: Floats  # (W, K, M)
    controls: Floats  # (W, K, 4)


@written_out
def cockpit_at(cockpits: Cockpits, row: int) -> Cockpit:
    """Return the cockpit of the kart in one row of `seats`."""
    w, k = cockpits.seats[row, 0], cockpits.seats[row, 1]
    return Cockpit(
        cockpits.observations[w, k],
        cockpits.offsets,
        cockpits.vehicles[w, k],
        cockpits.setup,
        cockpits.item_uses,
        cockpits.memory[w, k],
        cockpits.controls[w, k],
    )


# (Cockpit) -> None or (Cockpits) -> None; a class variable of such a type would count as a method.
Decide = Callable[..., None]


def memory_size(rays: int) -> int:
    """Return how many numbers a driver needs to keep and to work with."""
    return KEPT + 4 * rays + WORK


def item_uses_of(names: tuple[str, ...]) -> Ints:
    """Return what using each item does, by item number; 0 for no item and for unknown ones."""
    known = {item.name: int(item.use) for item in items()}
    return np.array([0, *(known.get(name, 0) for name in names)], np.int64)


def cockpit_for(briefing: Briefing, layout: Layout) -> Cockpit:
    """Return the cockpit of a driver that drives alone, at the start of a race."""
    offsets, uses = offsets_of(layout), item_uses_of(briefing.items)
    setup = np.array([briefing.lidar_field, briefing.lidar_reach, briefing.decision_s])
    memory, control = np.zeros(memory_size(int(offsets[-1]))), np.zeros(4)
    vehicle = vehicle_record(briefing.vehicle)[0]
    cockpit = Cockpit(np.zeros(layout.size), offsets, vehicle, setup, uses, memory, control)
    if not INTERPRET:
        return cockpit
    # Plain Python reads lists and attributes several times faster than arrays.
    arrays = cockpit._asdict() | {"vehicle": np.zeros(0)}
    lists: dict[str, Any] = {name: array.tolist() for name, array in arrays.items()}
    return Cockpit(**(lists | {"vehicle": briefing.vehicle}))


def elapsed_s(last: int, tick: int, regular: float) -> float:
    """Return the time since the last decision [s]; a bad network makes it a long one.

    What a driver counts, such as the time that it stands, would otherwise go too slowly.
    last: its tick, negative before the first; regular: [s] from one decision to the next.
    """
    elapsed = (tick - last) * TICK_S
    return min(elapsed, LONGEST_S) if last >= 0 and elapsed > 1.5 * regular else regular


class KernelDriver:
    """A driver that decides in a kernel.

    decide: fills `control` of a cockpit. decide_all: the same for many karts in one call, see
    `agents/drivers/avoider.py`; it is written out for each driver, because numba's cache on disk
    misses in every new process where a function closes over another kernel or is handed one.
    takes_advice: whether it follows what a policy writes into its memory, see ASIDE. vehicles: for
    which it is made, by name.
    """

    preset: ClassVar[str]
    vehicles: ClassVar[tuple[str, ...]] = ()
    takes_advice: ClassVar[bool] = False
    decide: ClassVar[Decide]
    decide_all: ClassVar[Decide]

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        self._cockpit: Cockpit | None = None
        self._tick = -1  # of the last decision
        self._briefing = briefing

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        cockpit = self._cockpit or self.prepare(observation.layout)
        regular = self._briefing.decision_s
        cockpit.setup[DECISION] = elapsed_s(self._tick, observation.tick, regular)
        self._tick = observation.tick
        values: Any = observation.values
        cockpit.observation[:] = values.tolist() if INTERPRET else values
        self._drive()
        steering, throttle, brake, buttons = (float(value) for value in cockpit.control)
        return Control(steering, throttle, brake, Button(int(buttons)))

    def take_advice(self, observation: Observation, advice: Sequence[float]) -> None:
        """Keep advice for the next decision: six numbers, see ASIDE."""
        cockpit = self._cockpit or self.prepare(observation.layout)
        for place, value in zip(range(ASIDE, FETCH + 1), advice, strict=True):
            cockpit.memory[place] = value

    def prepare(self, layout: Layout) -> Cockpit:
        """Compile what decides, if it is not; the first decision does so by itself."""
        self._cockpit = cockpit = cockpit_for(self._briefing, layout)
        self._drive = bind(type(self).decide, cockpit)
        return cockpit
