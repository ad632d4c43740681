"""Scripted karts among the learning ones: their drivers' kernels, each called once a decision."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.autopilot import item_kinds, starts_of
from race_server.driver import driver_named
from race_server.errors import ScenarioError
from race_server.kernels.jit import bind
from race_server.observe import Layout, layout_of
from race_server.state import Floats, Ints, Records


@dataclass(frozen=True)
class Opponents:
    """All karts that one scripted driver drives in a batch."""

    name: str
    karts: tuple[int, ...]
    layout: Layout
    decide_all: Any
    at: Ints
    gear: Floats
    kinds: Ints

    def seats(self, worlds: int) -> Ints:
        """Return world and kart of each kart, shape (n, 2)."""
        pairs = [(w, k) for w in range(worlds) for k in self.karts]
        return np.array(pairs, np.int64).reshape(-1, 2)

    def driving(
        self, worlds: int, views: Floats, vehicles: Records, memory: Floats, controls: Floats
    ) -> Callable[[], None]:
        """Return what fills the controls of these karts from what they see."""
        told = (self.at, vehicles, self.gear, self.kinds)
        return bind(self.decide_all, self.seats(worlds), views, *told, memory, controls)


def opponents_of(
    names: Sequence[str],
    first: int,
    karts: int,
    rays: int,
    gear: Floats,
    item_names: tuple[str, ...],
) -> list[Opponents]:
    """Return the drivers of karts `first` to `karts`, whose names are repeated in turn.

    gear: lidar field [rad], lidar reach [m], time between decisions [s].

    Raises:
        DriverError: a driver is unknown.
        ScenarioError: a driver is no kernel and can only drive in a process of its own.
    """
    seats: dict[str, list[int]] = {}
    for place, kart in enumerate(range(first, karts)):
        seats.setdefault(names[place % len(names)], []).append(kart)
    found = []
    for name, numbers in seats.items():
        driver = driver_named(name)
        decide_all = getattr(type(driver), "decide_all", None)
        if decide_all is None:
            raise ScenarioError(
                f"driver {name!r} cannot race in a batch: it has no `decide_all`, see "
                "race_server/autopilot.py; let it join a live server instead"
            )
        layout = layout_of(driver.preset, rays)
        kinds = item_kinds(item_names)
        found.append(
            Opponents(name, tuple(numbers), layout, decide_all, starts_of(layout), gear, kinds)
        )
    return found
