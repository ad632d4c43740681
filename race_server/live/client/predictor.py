"""Latency compensation: observations as they will be when the answer to them acts.

An observation that is half a second old shows the kart where it was, and the control that answers
it acts later still. The client knows what it has sent meanwhile and how its kart moves, so it works
out how far the kart will have moved when the control acts (a Smith predictor), and moves what is
seen by that much: scans, the course ahead, other karts, and the kart's own speeds. On a good
network observations stay as they are.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.kernels.jit import INTERPRET
from race_server.core.kernels.motion import Allowance, Command, Motion, move
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle, vehicle_record
from race_server.session.failsafe import FRESH_TICKS

# A shorter horizon [s] is not worth a prediction; a longer one is guesswork.
SHORT_S, FURTHEST_S = 0.15, 1.5
STEP_S = 1.0 / 30.0
# A control is small and queues behind nothing: share of an observation's latency that it takes.
WAY_SHARE = 0.3
# x, y, heading, speed, lateral speed, yaw rate, steering
_POINTS = (("path_ahead_x", "path_ahead_y"), ("karts_x", "karts_y"), ("hazards_x", "hazards_y"))


@dataclass
class Predictor:
    """Remembers what was sent, and predicts observations from it."""

    vehicle: Vehicle
    field_angle: float  # [rad] between the outermost rays of the lidar
    _sent: deque[tuple[float, Control]] = field(default_factory=lambda: deque(maxlen=128))

    def __post_init__(self) -> None:
        """Read the vehicle as the kernels do, which plain Python reads faster as it is."""
        self._figures: Any = self.vehicle if INTERPRET else vehicle_record(self.vehicle)[0]

    def record(self, now_s: float, control: Control) -> None:
        """Record that a control is sent."""
        self._sent.append((now_s, control))

    def ahead(self, seen: Observation, now_s: float, age_s: float, late_s: float) -> Observation:
        """Return what will be seen when a control that is sent now acts.

        now_s: by the clock of `record`; age_s: of what is seen now [s]; late_s: of observations on
        average [s].
        """
        way = WAY_SHARE * late_s
        horizon = min(age_s + way, FURTHEST_S)
        if horizon < SHORT_S:
            return seen
        state = self._predict(seen, now_s - age_s - way, horizon)
        return _moved(seen, state, self.field_angle)

    def _predict(self, seen: Observation, begin_s: float, horizon_s: float) -> Motion:
        """Return the kart's state after the horizon, from where it was seen."""
        speed, lateral = seen.scalar("speed"), seen.scalar("lateral_speed")
        yaw_rate, steering = seen.scalar("yaw_rate"), seen.scalar("steering")
        state = Motion(0.0, 0.0, 0.0, speed, lateral, yaw_rate, steering)
        allowance = Allowance(seen.scalar("speed_cap"), 1.0, 1.0, 0.0)
        for step in range(round(horizon_s / STEP_S)):
            acting = self._acting(begin_s + step * STEP_S)
            command = Command(acting.steering, acting.throttle, acting.brake)
            state = move(self._figures, state, command, allowance, STEP_S)
        return state

    def _acting(self, at_s: float) -> Control:
        """Return what acted on the kart when what was sent by then had arrived."""
        for sent_s, control in reversed(self._sent):
            if sent_s <= at_s:
                if at_s - sent_s > 2 * FRESH_TICKS * TICK_S:
                    return Control(steering=control.steering)
                return control
        return Control()


def _moved(seen: Observation, state: Motion, field_angle: float) -> Observation:
    """Return an observation as it is from another place; state: relative to the old one."""
    x, y, heading = state[:3]
    values = seen.values.astype(np.float64)
    slices = seen.layout.slices
    cos, sin = math.cos(heading), math.sin(heading)
    for across, along in _POINTS:
        if across in slices:
            px, py = values[slices[across]] - x, values[slices[along]] - y
            values[slices[across]], values[slices[along]] = cos * px + sin * py, cos * py - sin * px
    for name in ("lidar", "lidar_before"):
        if name in slices:
            values[slices[name]] = moved_scan(values[slices[name]], x, y, heading, field_angle)
    names = ("speed", "lateral_speed", "yaw_rate", "steering")
    for name, value in zip(names, state[3:], strict=True):
        values[slices[name]] = value
    if "heading_error" in slices:
        error = values[slices["heading_error"]]
        values[slices["lateral_offset"]] += x * np.sin(error) + y * np.cos(error)
        values[slices["heading_error"]] = error + heading
    return Observation(seen.tick, seen.layout, values.astype(np.float32))


def moved_scan(ranges: Floats, x: float, y: float, heading: float, field_angle: float) -> Floats:
    """Return a scan (N,) [m] as it is from a place (x, y) [m], turned by `heading` [rad].

    A ray without a point takes its range from its neighbours; a range of 0, where nothing came
    back, is left out.
    """
    angles = np.linspace(-0.5, 0.5, len(ranges)) * field_angle
    hit = ranges > 0.0
    if not hit.any():
        return ranges
    px, py = ranges[hit] * np.cos(angles[hit]) - x, ranges[hit] * np.sin(angles[hit]) - y
    away = np.hypot(px, py)
    turned = np.arctan2(py, px) - heading
    turned = (turned + math.pi) % (2.0 * math.pi) - math.pi
    step = field_angle / (len(ranges) - 1)
    bins = np.round((turned + 0.5 * field_angle) / step).astype(int)
    inside = (bins >= 0) & (bins < len(ranges))
    found = np.full(len(ranges), np.inf)
    np.minimum.at(found, bins[inside], away[inside])
    known = np.flatnonzero(np.isfinite(found))
    if not len(known):
        return ranges
    return np.interp(np.arange(len(ranges)), known, found[known])
