"""Parks a real kart on order: a parking driver that sees what the kart itself knows.

It thinks in a thread: the control unit does not wait for it, but for the moment that an answer
takes that needs no thought. An answer that is late is one that the dead man's handle of the control
unit misses, so a kart whose parking driver thinks for long stands.
"""

import math
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from race_agents.unit.orders import Orders
from race_server.core.driver import Briefing, Driver, ParkingDriver
from race_server.core.messages import Control, Pose
from race_server.core.observation import Layout, Observation, layout_of
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError
from race_server.live.client.driver_loop import call_driver
from race_server.net.wire.parking import OrderFrame

# The observation that a kart can make itself, without a server.
PRESET = "lot_lidar"
# An answer is waited for this long [s] at most, once: a fifth of a turn of the control unit.
# Without that it would come a turn later, and on a busy machine too late.
MOMENT_S = 0.004


class KartState(Protocol):
    """What is known of a kart: the control unit itself, or what it told."""

    @property
    def vehicle(self) -> Vehicle:
        """Its figures."""

    @property
    def hud(self) -> Orders | None:
        """The newest orders of the server."""

    @property
    def ranges(self) -> Floats | None:
        """What its lidar sees [m]."""

    def pose(self) -> Pose | None:
        """Return where it is."""


class Parker:
    """Carries out the orders to park of one kart."""

    def __init__(self, driver: Driver, name: str, briefing: Briefing, rays: int) -> None:
        """Get a driver ready. name: of the driver; rays: of the kart's lidar.

        Raises:
            DriverError: it takes no order, or sees what a kart cannot show.
        """
        if not isinstance(driver, ParkingDriver) or driver.preset != PRESET:
            sees = driver.preset if isinstance(driver, ParkingDriver) else "no order"
            raise DriverError(
                f"driver {name!r} takes {sees}: a real kart is parked by a driver that takes an "
                f"order and sees {PRESET}, such as valet"
            )
        self._driver, self._name = driver, name
        self._layout = layout_of(PRESET, rays)
        self._step_s, self._due_s = briefing.decision_s, -math.inf
        self._known = -1, -1  # epoch and number of the newest order
        self._stands = False  # an order that every race begins with
        self._order: ParkingOrder | None = None  # not handed to the driver yet
        self._asked: Future[Control] | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="parker")
        driver.reset(replace(briefing, preset=PRESET))

    def take(self, frame: OrderFrame | None, *, stands: bool = False) -> None:
        """Take an order, if it is a newer one. stands: for the races after this one, too."""
        if frame is not None and (frame.epoch, frame.sequence) > self._known:
            self._known, self._order = (frame.epoch, frame.sequence), frame.order
            self._stands |= stands

    def has_order(self, epoch: int) -> bool:
        """Return whether the kart is to park in the race of this number."""
        return self._stands or 0 <= epoch <= self._known[0]

    def act(self, kart: KartState, now_s: float) -> Control | None:
        """Return the driver's newest answer, None where it is thinking, or nothing is due.

        Raises:
            DriverError: the driver failed.
        """
        if self._asked is None:
            seen = observation_of(kart, self._layout) if now_s >= self._due_s else None
            if seen is None:
                return None
            self._due_s = max(self._due_s + self._step_s, now_s)
            self._asked = self._thread.submit(self._decide, self._order, seen)
            self._order = None
            wait([self._asked], MOMENT_S)
        if not self._asked.done():
            return None
        control, self._asked = self._asked.result(), None
        return control

    def _decide(self, order: ParkingOrder | None, seen: Observation) -> Control:
        """Return what the driver answers. order: a new one."""
        driver = self._driver
        if order is not None:
            call_driver(self._name, "park", partial(driver.park, order))
        return call_driver(self._name, "act", partial(driver.act, seen))

    def close(self) -> None:
        """Ask for nothing more."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def observation_of(kart: KartState, layout: Layout) -> Observation | None:
    """Return what a kart knows of itself, None as long as it does not know its place or sees.

    layout: of the preset `lot_lidar`. What a kart cannot know is 0.
    """
    pose, hud, ranges = kart.pose(), kart.hud, kart.ranges
    if pose is None or hud is None or ranges is None:
        return None
    x, y = middle_of(pose.x, pose.y, pose.heading, kart.vehicle)
    parts: dict[str, float | Floats] = {
        "lidar": ranges,
        "speed": pose.speed,
        "lateral_speed": pose.lateral_speed,
        "yaw_rate": pose.yaw_rate,
        "steering": pose.steering,
        "position_x": x,
        "position_y": y,
        "heading": math.remainder(pose.heading, 2.0 * math.pi),
        "speed_cap": hud.speed_cap,
        "thrust_scale": hud.thrust_scale,
        "grip_scale": hud.grip_scale,
        "lights": hud.lights_s,
        "flag": float(hud.flag),
        # A kart that is told to stand has nothing to do.
        "finished": float(hud.speed_cap <= 0.0),
    }
    values = np.zeros(layout.size, np.float32)
    for name, value in parts.items():
        values[layout.slices[name]] = value
    return Observation(hud.tick, layout, values)


def middle_of(x: float, y: float, heading: float, vehicle: Vehicle) -> tuple[float, float]:
    """Return the middle of the body [m] of a kart whose centre of gravity is at (x, y)."""
    ahead = vehicle.box_offset
    return x + ahead * math.cos(heading), y + ahead * math.sin(heading)
