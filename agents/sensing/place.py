"""From latitude and longitude to metres east and north of a point of the course."""

import math
from dataclasses import dataclass

# WGS 84: semi-major axis [m], flattening [-].
AXIS, FLATTENING = 6_378_137.0, 1.0 / 298.257223563
ECCENTRICITY = FLATTENING * (2.0 - FLATTENING)  # squared


@dataclass(frozen=True)
class LocalFrame:
    """The plane that touches the ellipsoid at a point, turned to the axes of the course."""

    latitude: float  # [°] of the origin
    longitude: float  # [°]
    height: float = 0.0  # [m] over the ellipsoid
    turn: float = 0.0  # [rad] from east to the x axis of the course

    def place(self, latitude: float, longitude: float, height: float) -> tuple[float, float]:
        """Return x and y [m] of a point: geodetic to geocentric to local, without approximation."""
        here, there = _geocentric(self), _geocentric(LocalFrame(latitude, longitude, height))
        dx, dy, dz = (b - a for a, b in zip(here, there, strict=True))
        phi, lam = math.radians(self.latitude), math.radians(self.longitude)
        east = dy * math.cos(lam) - dx * math.sin(lam)
        out = dx * math.cos(lam) + dy * math.sin(lam)
        north = dz * math.cos(phi) - out * math.sin(phi)
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return east * cos + north * sin, north * cos - east * sin

    def heading(self, bearing: float) -> float:
        """Return a heading in the course [rad] for a bearing from north, clockwise [°]."""
        return math.remainder(0.5 * math.pi - math.radians(bearing) - self.turn, 2.0 * math.pi)


def _geocentric(point: LocalFrame) -> tuple[float, float, float]:
    phi, lam = math.radians(point.latitude), math.radians(point.longitude)
    normal = AXIS / math.sqrt(1.0 - ECCENTRICITY * math.sin(phi) ** 2)
    out = (normal + point.height) * math.cos(phi)
    up = (normal * (1.0 - ECCENTRICITY) + point.height) * math.sin(phi)
    return out * math.cos(lam), out * math.sin(lam), up
