"""Karts that do not learn among those that do: their drivers, each called once a decision.

A scripted driver is a kernel, `decide_all`. Another, such as a network, may offer `driving`
instead: from the cockpits and the layout of the observations it makes a call that fills the
controls; so does a function, see `CalledOpponent`. What a driver remembers is in `memory`, which is
zero when a round begins. Any other driver, such as one that takes orders to park, answers for one
kart after the other: see `Asked`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.core.driver import Briefing, Driver, driver_named, tell_to_park
from race_server.core.kernel_driver import ASIDE, FETCH, Cockpits, item_uses_of
from race_server.core.kernels.jit import bind
from race_server.core.observation import PARTS, Layout, Observation, layout_of, offsets_of
from race_server.core.parking_order import order_of
from race_server.core.state import Floats, Ints, World
from race_server.core.vehicles import vehicle_of
from race_server.envs.advice import Adviser
from race_server.envs.buffers import Buffers, Opposition
from race_server.envs.called_opponent import CalledOpponent
from race_server.errors import ScenarioError


@dataclass(frozen=True)
class Opponents:
    """All karts that one driver drives in a batch."""

    name: str
    karts: tuple[int, ...]
    layout: Layout
    driver: Any
    setup: Floats
    item_uses: Ints

    def seats(self, worlds: int) -> Ints:
        """Return world and kart of each kart, shape (n, 2)."""
        pairs = [(w, k) for w in range(worlds) for k in self.karts]
        return np.array(pairs, np.int64).reshape(-1, 2)

    @property
    def keeps_all_in_memory(self) -> bool:
        """Whether all that the driver remembers is in the memory of the batch."""
        return hasattr(self.driver, "driving") or hasattr(type(self.driver), "decide_all")

    def driving(
        self, world: World, views: Floats, memory: Floats, controls: Floats
    ) -> Callable[[], None]:
        """Return a call that fills the controls of these karts from what they see.

        views: (W, K, S); memory: (W, K, M); controls: (W, K, 4).
        """
        driver = self.driver
        cockpits = Cockpits(
            self.seats(len(views)),
            views,
            offsets_of(self.layout),
            world.vehicles,
            self.setup,
            self.item_uses,
            memory,
            controls,
        )
        if hasattr(driver, "driving"):
            drive: Callable[[], None] = driver.driving(cockpits, self.layout)
            return drive
        if hasattr(type(driver), "decide_all"):
            return bind(type(driver).decide_all, cockpits)
        return Asked(self, world, cockpits).drive


class Asked:
    """Drivers that are no kernels, one for each kart: each is asked in turn, as in a live race."""

    def __init__(self, group: Opponents, world: World, cockpits: Cockpits) -> None:
        """Take all seats of a group."""
        self.group = group
        self.world = world
        self.cockpits = cockpits
        self.drivers = [driver_named(group.name) for _ in cockpits.seats]

    def drive(self) -> None:
        """Fill the controls of these karts; a round that begins brings an order."""
        cockpits, races = self.cockpits, self.world.races
        for row, (w, k) in enumerate(cockpits.seats.tolist()):
            driver = self.drivers[row]
            if cockpits.memory[w, k, 0] == 0.0:
                cockpits.memory[w, k, 0] = 1.0
                self._brief(driver, w, k)
            values = cockpits.observations[w, k, : self.group.layout.size].astype(np.float32)
            seen = Observation(int(races[w].tick), self.group.layout, values)
            control = driver.act(seen)
            shares = (control.steering, control.throttle, control.brake)
            cockpits.controls[w, k] = (*shares, float(control.buttons))

    def _brief(self, driver: Driver, w: int, k: int) -> None:
        field, reach, decision_s = (float(value) for value in self.cockpits.setup)
        driver.reset(
            Briefing(
                seat=k,
                vehicle=vehicle_of(self.world.vehicles[w, k]),
                laps=int(self.world.rules[w].laps),
                preset=driver.preset,
                decision_s=decision_s,
                lidar_field=field,
                lidar_reach=reach,
                waits=True,
            )
        )
        parkers = self.world.parking.parkers[w]
        if len(parkers) and parkers[k].length > 0.0:
            tell_to_park(driver, self.group.name, order_of(self.world, w, k))


def opponents_of(
    names: Sequence[str | CalledOpponent],
    first: int,
    karts: int,
    rays: int,
    setup: Floats,
    item_names: tuple[str, ...],
) -> list[Opponents]:
    """Return the drivers of karts `first` to `karts`, whose names, or functions, repeat in turn.

    setup: lidar field [rad], lidar reach [m], time between decisions [s].

    Raises:
        DriverError: a driver is unknown.
    """
    seats: dict[str | CalledOpponent, list[int]] = {}
    for place, kart in enumerate(range(first, karts)):
        seats.setdefault(names[place % len(names)], []).append(kart)
    found = []
    for named, numbers in seats.items():
        driver: Any = driver_named(named) if isinstance(named, str) else named
        layout = layout_of(driver.preset, rays)
        item_uses = item_uses_of(item_names)
        name = named if isinstance(named, str) else named.name
        found.append(Opponents(name, tuple(numbers), layout, driver, setup, item_uses))
    return found


def takes_advice(driver: object) -> bool:
    """Return whether a driver does what is written into its memory, see `KernelDriver`."""
    return bool(getattr(driver, "takes_advice", False))


def advised(name: str) -> str:
    """Return the name of the driver that residual actions advise, if it takes advice.

    Raises:
        DriverError: it is unknown.
        ScenarioError: none is named, or it takes none.
    """
    if not name:
        raise ScenarioError(
            "action 'residual' needs a driver to advise; name one, such as base = 'raceline'"
        )
    if not takes_advice(driver_named(name)):
        raise ScenarioError(
            f"base {name!r} takes no advice; choose a driver on the reference line: raceline or idm"
        )
    return name


def advise(buffers: Buffers, adviser: Adviser) -> None:
    """Write residual actions, (W, L, 6), into the memory of the drivers that they advise."""
    learners = buffers.actions.shape[1]
    advice = adviser.advice(buffers.actions, buffers.observations)
    buffers.memory[:, :learners, ASIDE : FETCH + 1] = advice


def opposition_of(groups: Sequence[Opponents], karts: int) -> Opposition:
    """Return the size of the longest observation, and the offsets of each kart's."""
    offsets = np.full((karts, len(PARTS) + 1), -1, np.int64)
    for group in groups:
        offsets[list(group.karts)] = offsets_of(group.layout)
    return Opposition(max((group.layout.size for group in groups), default=1), offsets)
