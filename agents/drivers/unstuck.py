"""The way out of a jam as a wrapper of any driver that sees a lidar: ``unstuck:NAME``.

After the learned driver of the 1/10 race's report of 2023: where the nearest thing is closer than
a threshold the car reverses and turns away from it, and it never drives slower than 0.1 m/s, so
that a policy cannot stall. The report guards the reversing with an ultrasonic sensor at the back;
no observation here has one, so the reversing is short.
"""

import numpy as np

from race_server.core.driver import Briefing, driver_named
from race_server.core.messages import Control, Flag
from race_server.core.observation import PRESETS, Observation
from race_server.core.state import Float32s, Floats
from race_server.core.suitability import vehicles_of
from race_server.errors import DriverError

LEAST_SPEED = 0.1  # [m/s] forward, the report's
PUSH = 0.3  # throttle that gets a standing car going
REVERSE_S = 1.0
ENOUGH = 1.0  # body lengths of free space at which the reversing ends
GAP = 0.1  # body widths that count as too close
# Faster than this [body lengths a second] a driver that passes something closely is racing.
SLOW = 2.0


class Unstuck:
    """Drives as another driver does; reverses where it is stuck, and never lets it stall."""

    def __init__(self, name: str) -> None:
        """Wrap the driver called `name`.

        Raises:
            DriverError: it is unknown, or what it sees has no lidar.
        """
        self.driver = driver_named(name)
        self.preset, self.vehicles = self.driver.preset, vehicles_of(self.driver)
        if "lidar" not in PRESETS.get(self.preset, ()):
            seeing = ", ".join(title for title, parts in PRESETS.items() if "lidar" in parts)
            raise DriverError(
                f"driver {name!r} sees {self.preset!r}, which has no lidar, so nothing can tell "
                f"that it is stuck; wrap a driver that sees one of {seeing}"
            )

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        self.driver.reset(briefing)
        self._briefing = briefing
        self._outline: Floats = np.zeros(0)
        self._left_s, self._steering = 0.0, 0.0

    def act(self, observation: Observation) -> Control:
        """Return what the driver wants, or the way out where it is stuck."""
        wanted = self.driver.act(observation)
        if _must_stand(observation):
            self._left_s = 0.0
            return wanted
        ranges = _seen(observation["lidar"])
        if len(ranges) != len(self._outline):
            self._outline = outline(self._briefing, len(ranges))
        free = ranges - self._outline
        nearest = int(np.argmin(free))
        body, speed = self._briefing.vehicle, observation.scalar("speed")
        if self._left_s <= 0.0:
            slow = speed < SLOW * body.length
            if not (slow and free[nearest] < GAP * body.width):
                return _kept_going(wanted, speed)
            # Backwards, wheels towards the obstacle turn the nose away from it.
            self._steering = 1.0 if nearest >= 0.5 * len(ranges) else -1.0
            self._left_s = REVERSE_S
        self._left_s -= self._briefing.decision_s
        if free[nearest] > ENOUGH * body.length:
            self._left_s = 0.0
        return Control(self._steering, -1.0, 0.0, wanted.buttons)


def outline(briefing: Briefing, rays: int) -> Floats:
    """Return how far the body reaches from its middle along each ray [m], shape (rays,).

    A lidar sits ahead of the middle, so in front there is a little more room than this says.
    """
    angles = np.linspace(-0.5, 0.5, rays) * briefing.lidar_field
    along, across = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    body = briefing.vehicle
    with np.errstate(divide="ignore"):
        return np.minimum(0.5 * body.length / along, 0.5 * body.width / across)


def _seen(ranges: Float32s) -> Floats:
    """Return the ranges; drop-outs, which are zeros, tell of nothing near."""
    return np.where(ranges > 0.0, ranges.astype(np.float64), np.inf)


def _must_stand(observation: Observation) -> bool:
    standing = ("lights", "finished", "wrong_way")
    held = observation.scalar("flag") == Flag.RED
    return held or any(observation.scalar(name) > 0.0 for name in standing)


def _kept_going(wanted: Control, speed: float) -> Control:
    """Return a control that does not let the car stop; who reverses may go on."""
    if speed >= LEAST_SPEED or wanted.throttle < 0.0:
        return wanted
    return Control(wanted.steering, max(wanted.throttle, PUSH), 0.0, wanted.buttons)
