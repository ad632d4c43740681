"""A real kart, as it tells the others of itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Peer:
    """Where a real kart tells the others that it is. SI units; see `schemas/drive.fbs`."""

    stamp_us: int  # when it was there: by its own clock as sent, by ours once it is received
    x: float  # of the middle of the body
    y: float
    heading: float
    speed: float
    lateral_speed: float = 0.0  # of the middle of the body
    yaw_rate: float = 0.0
    braking: float = 0.0
    deviation: float = 0.0
    heading_deviation: float = 0.0
    length: float = 1.0
    width: float = 1.0
