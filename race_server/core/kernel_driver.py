"""How a driver written as a kernel takes a seat.

A scripted driver is one function of numbers. Training runs it compiled, for hundreds of karts in
one call; a driver's own process runs the same function as plain Python and never waits for a
compiler. `KernelDriver` is what makes a `Driver` of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing
from race_server.core.kernels.jit import INTERPRET
from race_server.core.messages import Button, Control
from race_server.core.observation import PART_NUMBERS, Layout, Observation
from race_server.core.rules.items import items
from race_server.core.vehicles import vehicle_record

# What a kernel is told of its gear, by place in `gear`.
FIELD, REACH, DECISION = range(3)

# Numbers that a driver keeps from one decision to the next; the last are what it commanded lately.
# Behind them is room for two scans, for the points of a scan, and for a row of WORK numbers.
STANDING, REVERSING, ESCAPE, ATTEMPTS, PRESSED, SHIFT, SCAN_SUM, SCAN_AGE = range(8)
# Advice of a policy to a driver that takes it, zeros without one: so far to the left [m], so much
# faster as a share, the button (press above URGENT, hold below its negative), so much faster as a
# share where no bend forbids it, the share of the distance to the kart ahead that is given up, and
# whether to fetch the next box (above URGENT).
ASIDE, FASTER, URGE, DASH, CLOSE, FETCH, LATELY = range(8, 15)
URGENT = 0.3
KEPT = LATELY + 32
WORK = 320
# A driver that was away for longer begins its counts anew all the same [s].
LONGEST_S = 1.0

# (seen, at, vehicle, gear, kinds, memory, control) -> None
Decide = Callable[..., None]


def memory_size(rays: int) -> int:
    """Return how many numbers a driver needs to keep and to work with."""
    return KEPT + 4 * rays + WORK


def starts_of(layout: Layout) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return where each part begins in a vector, by part number; -1 for parts it lacks.

    The last number is the count of lidar rays.
    """
    starts = np.full(len(PART_NUMBERS) + 1, -1, np.int64)
    for name, place in layout.slices.items():
        starts[PART_NUMBERS[name]] = place.start
    if "lidar" in layout.slices:
        starts[-1] = layout.slices["lidar"].stop - layout.slices["lidar"].start
    return starts


def item_kinds(names: tuple[str, ...]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return what using each item does, by item number; 0 for no item and for unknown ones."""
    known = {item.name: int(item.use) for item in items()}
    return np.array([0, *(known.get(name, 0) for name in names)], np.int64)


@dataclass(frozen=True)
class _Figures:
    """What the kernel is handed besides what it sees: arrays, or lists where it is interpreted."""

    at: Any
    vehicle: Any
    gear: Any
    kinds: Any
    memory: Any
    control: Any


class KernelDriver:
    """A driver whose thinking is a kernel.

    decide: fills `control` (4,) steering, throttle, brake, buttons from `seen` (size,), where
    part p begins at `at[p]`; vehicle: its figures; gear: lidar field [rad], lidar reach [m], time
    between decisions [s]; kinds: what using each item does; memory: zeros at the start.
    decide_all: the same for many karts in one call, see `agents/drivers/avoider.py`.
    takes_advice: whether it does what a policy writes into its memory, see ASIDE.
    """

    preset: ClassVar[str]
    takes_advice: ClassVar[bool] = False
    decide: ClassVar[Decide]
    decide_all: ClassVar[Decide]

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        self._figures: _Figures | None = None
        self._tick = -1  # of the last decision
        self._briefing = briefing

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        figures = self._figures or self._prepare(observation.layout)
        figures.gear[DECISION] = self._elapsed_s(observation.tick)
        seen = observation.values.astype(np.float64)
        type(self).decide(
            seen.tolist() if INTERPRET else seen,
            figures.at,
            figures.vehicle,
            figures.gear,
            figures.kinds,
            figures.memory,
            figures.control,
        )
        steering, throttle, brake, buttons = (float(value) for value in figures.control)
        return Control(steering, throttle, brake, Button(int(buttons)))

    def take_advice(self, observation: Observation, advice: Sequence[float]) -> None:
        """Keep advice for the next decision: six numbers, see ASIDE."""
        figures = self._figures or self._prepare(observation.layout)
        for place, value in zip(range(ASIDE, FETCH + 1), advice, strict=True):
            figures.memory[place] = value

    def _elapsed_s(self, tick: int) -> float:
        """Return the time since the last decision [s]; a bad network makes it a long one.

        What a driver counts, such as for how long it stands, would otherwise go too slowly.
        """
        last, self._tick = self._tick, tick
        regular = self._briefing.decision_s
        elapsed = (tick - last) * TICK_S
        return min(elapsed, LONGEST_S) if last >= 0 and elapsed > 1.5 * regular else regular

    def _prepare(self, layout: Layout) -> _Figures:
        briefing = self._briefing
        at, kinds = starts_of(layout), item_kinds(briefing.items)
        gear = np.array([briefing.lidar_field, briefing.lidar_reach, briefing.decision_s])
        memory, control = np.zeros(memory_size(max(int(at[-1]), 0))), np.zeros(4)
        if INTERPRET:
            # Plain Python reads lists and attributes several times faster than arrays.
            arrays = (at, gear, kinds, memory, control)
            lists = [array.tolist() for array in arrays]
            figures = _Figures(lists[0], briefing.vehicle, *lists[1:])
        else:
            vehicle = vehicle_record(briefing.vehicle)[0]
            figures = _Figures(at, vehicle, gear, kinds, memory, control)
        self._figures = figures
        return figures
