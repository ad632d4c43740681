"""Lidar and radar in numbers."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from race_server.core import codes
from race_server.core.clock import ticks_of
from race_server.core.state import RADAR_RAYS, SENSORS, Floats, Records
from race_server.errors import ScenarioError

MOST_RAYS = 2048


@dataclass(frozen=True)
class Lidar:
    """A fan of evenly spaced rays, the first on the right.

    The default is the 1/10 race's: one ray a degree from -100° to +100°, 8 m, 10 scans a second.
    """

    rays: int = 201
    field: float = math.radians(200.0)  # [rad] between the outermost rays
    reach: float = 8.0  # [m]
    ahead: float = 0.07  # [m] of the centre of gravity
    noise: float = 0.01  # [m] standard deviation; the race's simulator uses 1 cm
    dropout: float = 0.0  # share of rays that come back as 0
    period_s: float = 0.1


@dataclass(frozen=True)
class Radar:
    """Nine rays from -60° to +60°, 80 m, ten readings a second."""

    field: float = math.radians(120.0)
    reach: float = 80.0
    ahead: float = 0.0
    noise: float = 0.0
    period_s: float = 0.1


def sensor_records(lidar: Lidar, radar: Radar) -> Records:
    """Return the settings as the kernels read them, shape (1,).

    Raises:
        ScenarioError: a figure makes no sensor.
    """
    if not 2 <= lidar.rays <= MOST_RAYS:
        raise ScenarioError(f"lidar of {lidar.rays} rays: choose 2 to {MOST_RAYS}")
    if not 0.0 < lidar.field <= 2.0 * math.pi:
        raise ScenarioError(f"lidar field of {math.degrees(lidar.field):g}°: choose up to 360°")
    record = np.zeros(1, SENSORS)
    pair: tuple[tuple[str, Lidar | Radar], ...] = (("lidar", lidar), ("radar", radar))
    for kind, sensor in pair:
        if not 0.0 <= sensor.noise <= sensor.reach:
            raise ScenarioError(
                f"{kind} noise of {sensor.noise:g} m: choose 0 to {sensor.reach:g} m, its reach"
            )
        for name in ("reach", "ahead", "field", "noise"):
            record[f"{kind}_{name}"] = getattr(sensor, name)
        record[f"{kind}_period_ticks"] = max(ticks_of(sensor.period_s), 1)
    record["lidar_dropout"] = lidar.dropout
    return record


def fan(rays: int, field: float) -> Floats:
    """Return cosine and sine of each ray, shape (rays, 2), from right to left."""
    angles = np.linspace(-0.5 * field, 0.5 * field, rays)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def radar_fan(radar: Radar) -> Floats:
    """Return cosine and sine of the radar's rays, shape (9, 2)."""
    return fan(RADAR_RAYS, radar.field)


def sensors_for(parts: Iterable[str]) -> int:
    """Return the sensors that an observation of these parts needs, as bits of `codes`."""
    names = set(parts)
    both = codes.LIDAR | codes.RADAR if any(name.startswith("movers_") for name in names) else 0
    lidar = codes.LIDAR if names & {"lidar", "lidar_before"} else 0
    radar = codes.RADAR if names & {"radar", "radar_kind", "radar_before"} else 0
    return both | lidar | radar
