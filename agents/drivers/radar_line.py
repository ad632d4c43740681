"""Drives the reference line on a map of the course, and sees others by its radar alone.

For a kart with a radar and no lidar. Where it is on the line the race tells it: for a real kart
that is the kart's own estimate. The radar's nine rays say what stands on the way. Each echo that
is no border is followed from scan to scan, and becomes a kart that the driver on the line passes,
follows or stops for.
"""

import math
from dataclasses import replace

import numpy as np

from race_agents.drivers.raceline import Raceline
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import NEARBY, Observation, layout_of
from race_server.core.state import Floats
from race_server.core.vehicle_presets import KARTS
from race_server.scenario.sensors import Radar, radar_fan

NOWHERE = 1e3
SCAN_S = Radar().period_s
# An echo is of the same thing as one of the scan before that is nearer than this [m], and than what
# moves at this speed [m/s] comes; its speed is averaged by this share.
NEAR, FASTEST, NEW_SHARE = 1.0, 25.0, 0.5
# The middle of a kart lies behind what the radar sees of it [body lengths].
DEPTH = 0.4


class RadarLine:
    """Drives the reference line by a map and sees others by its radar."""

    preset = "radar_line"
    vehicles = KARTS

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        self._layout = layout_of("line", 0)
        self._driver = Raceline()
        self._driver.reset(replace(briefing, preset="line"))
        self._length = briefing.vehicle.length
        self._rays = radar_fan(Radar())
        self._tick, self._ranges = -1, np.zeros(0)
        self._seen = np.zeros((0, 4))  # x, y [m], velocity against the ground [m/s]

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        self._look(observation)
        slices = self._layout.slices
        values = np.zeros(self._layout.size, np.float32)
        for name, place in observation.layout.slices.items():
            if name in slices:
                values[slices[name]] = observation.values[place]
        for name in ("karts_x", "boxes_x", "hazards_x"):
            values[slices[name]] = NOWHERE
        near = self._seen[np.argsort(np.hypot(self._seen[:, 0], self._seen[:, 1]))][:NEARBY]
        names = ("karts_x", "karts_y", "karts_speed_x", "karts_speed_y")
        for name, numbers in zip(names, near.T, strict=True):
            start = slices[name].start
            values[start : start + len(near)] = numbers
        return self._driver.act(Observation(observation.tick, self._layout, values))

    def _look(self, observation: Observation) -> None:
        """Take a scan, if there is a new one; else move on what was seen."""
        speed, turn = observation.scalar("speed"), observation.scalar("yaw_rate")
        seconds = (observation.tick - self._tick) * TICK_S if self._tick >= 0 else 0.0
        self._tick = observation.tick
        before = moved(self._seen, speed, turn, seconds)
        ranges = observation["radar"].astype(np.float64)
        if np.array_equal(ranges, self._ranges):
            self._seen = before
            return
        self._ranges = ranges
        kinds = np.rint(observation["radar_kind"]).astype(np.int64)
        strange = (kinds != codes.NOTHING) & (kinds != codes.BORDER)
        depths = np.where(kinds == codes.KART_HIT, DEPTH * self._length, 0.0)
        found = self._rays[strange] * (ranges + depths)[strange, None]
        self._seen = tracked(found, before)


def moved(seen: Floats, speed: float, turn: float, seconds: float) -> Floats:
    """Return things (N, 4) in the frame of a kart that has moved on for some time [s]."""
    x = seen[:, 0] + (seen[:, 2] - speed) * seconds
    y = seen[:, 1] + seen[:, 3] * seconds
    cos, sin = math.cos(turn * seconds), math.sin(turn * seconds)
    vx, vy = seen[:, 2], seen[:, 3]
    columns = (cos * x + sin * y, cos * y - sin * x, cos * vx + sin * vy, cos * vy - sin * vx)
    return np.column_stack(columns)


def tracked(found: Floats, before: Floats) -> Floats:
    """Return what a scan found (N, 2) with velocities (N, 4), from what was there before.

    What is new is taken to stand until the next scan.
    """
    seen = np.column_stack([found, np.zeros_like(found)])
    if not len(before):
        return seen
    for thing in seen:
        off = thing[:2] - before[:, :2]
        nearest = int(np.argmin(np.hypot(off[:, 0], off[:, 1])))
        if math.hypot(*off[nearest]) < NEAR + FASTEST * SCAN_S:
            thing[2:] = before[nearest, 2:] + NEW_SHARE * off[nearest] / SCAN_S
    return seen
