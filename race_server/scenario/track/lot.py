"""What a course has of a car park: slots or zones of goals, and what is drawn for each round."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Zone:
    """A rectangle of places. Its role: see `race_server.core.lots.ROLES`."""

    role: str
    x: tuple[float, float]  # [m]
    y: tuple[float, float]  # [m]
    heading: float = 0.0  # [rad]
    spread: float = 0.0  # [rad] headings may be this far from it
    hitch: float = 0.0  # [rad] angles at the hitches of vehicles that start may be this far from 0


@dataclass(frozen=True)
class Taken:
    """Slots that hold a vehicle, other than those that a vehicle drives to."""

    share: float = 0.0  # of the slots, on average
    length: float = 0.0  # [m] of each vehicle
    width: float = 0.0  # [m]


@dataclass(frozen=True)
class Blocks:
    """Loose obstacles, drawn in the zones of their role."""

    count: tuple[int, int] = (0, 0)  # fewest and most
    side: tuple[float, float] = (1.0, 2.0)  # [m] shortest and longest


@dataclass(frozen=True)
class People:
    """People who walk from place to place in the zones of their role."""

    count: int = 0
    speed: tuple[float, float] = (0.8, 1.6)  # [m/s] slowest and fastest
    radius: float = 0.3  # [m]
    stops: float = 0.5  # share of their ways on which they stop
    rest_s: float = 3.0  # longest stop [s]


@dataclass(frozen=True, eq=False)
class Lot:
    """A car park. With slots the goals are among them; without, in its goal zones."""

    slots: Floats  # (S, 5) x, y of the middle [m], heading [rad], length, width [m]
    zones: tuple[Zone, ...] = ()
    slot_size: tuple[float, float] = (3.0, 2.0)  # [m] length and width of a slot in a zone
    distance: tuple[float, float] = (0.0, 0.0)  # [m] from start to slot; 0: no limit
    taken: Taken = field(default_factory=Taken)
    blocks: Blocks = field(default_factory=Blocks)
    people: People = field(default_factory=People)
    vehicle: str = "kart-13"  # that it is made for
    limit_s: float = 60.0  # time to park in [s]
    level: str = "parked"  # of tolerance, see `race_server.scenario.level`
    from_slots: bool = False  # vehicles start in slots, and not in start zones

    @property
    def slot_count(self) -> int | None:
        """How many slots there are; None where one is drawn in a zone that is no single place."""
        if len(self.slots):
            return len(self.slots)
        goals = [zone for zone in self.zones if zone.role == "goal"]
        if any(zone.x[0] < zone.x[1] or zone.y[0] < zone.y[1] for zone in goals):
            return None
        return len({(zone.x[0], zone.y[0]) for zone in goals})
