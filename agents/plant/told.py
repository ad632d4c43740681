"""What the other karts of a meeting or a race tell: noisy, late, and some of it lost."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from race_server.core.peer import Peer
from race_server.core.vehicles import Vehicle

# A kart is at x, y [m] and moves with vx, vy [m/s], by the time to the meeting [s].
Move = Callable[[float], tuple[float, float, float, float]]

# A message was made this long ago at least and at most [s]: turns of two programs and the network.
LATE_S = 0.02, 0.05
LOST = 0.1  # share of the messages that never come
# Deviations of what a kart knows of itself: place [m], speed [m/s], heading [rad].
PLACE, PACE, HEADING = 0.02, 0.1, 0.003
# Over this time [s] a speed is compared with what it is then.
STEP_S = 0.02


@dataclass
class Told:
    """Hears the karts of one meeting."""

    vehicle: Vehicle
    chance: np.random.Generator
    _newest: dict[int, Peer] = field(default_factory=dict)

    def hear(self, karts: Sequence[Move], until_s: float, now_s: float) -> tuple[Peer, ...]:
        """Return the newest message of each kart; until_s: time to the meeting."""
        for number, move in enumerate(karts):
            if self.chance.random() < LOST:
                continue
            late_s = self.chance.uniform(*LATE_S)
            x, y, vx, vy = move(until_s + late_s)
            _, _, then_vx, then_vy = move(until_s + late_s - STEP_S)
            speed = math.hypot(vx, vy)
            slows = (speed - math.hypot(then_vx, then_vy)) / STEP_S
            heading = heading_of(vx, vy)
            ahead, normal = self.vehicle.box_offset, self.chance.normal
            self._newest[number] = Peer(
                stamp_us=round(1e6 * (now_s - late_s)),
                x=x + ahead * math.cos(heading) + normal(0.0, PLACE),
                y=y + ahead * math.sin(heading) + normal(0.0, PLACE),
                heading=heading + normal(0.0, HEADING),
                speed=speed + normal(0.0, PACE),
                braking=max(slows, 0.0),
                deviation=PLACE,
                heading_deviation=HEADING,
                length=self.vehicle.length,
                width=self.vehicle.width,
            )
        return tuple(self._newest.values())


def heading_of(vx: float, vy: float) -> float:
    """Return where a kart faces [rad] that moves so; one that stands faces east."""
    return math.atan2(vy, vx) if math.hypot(vx, vy) > 0.1 else 0.0
