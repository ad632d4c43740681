"""What a real kart tells the pit wall: how its sensors, its estimate, its link and its battery are.

The numbers of all enumerations are those of `schemas/codes.fbs`; a test compares them.
"""

from enum import IntEnum


class Sensor(IntEnum):
    """What tells a real kart where it is and what is around it."""

    FIXES = 0  # of the place, by satellites or a tracking system
    BEACONS = 1  # ranges by radio
    WHEELS = 2
    GYRO = 3
    ACCELEROMETER = 4
    STEERING = 5  # angle of the road wheels
    RADAR = 6
    LIDAR = 7


class SensorState(IntEnum):
    """What a sensor of a real kart is worth."""

    ABSENT = 0  # it has never said anything
    WELL = 1
    SILENT = 2  # nothing comes, or nothing that is a number in range
    STUCK = 3  # it repeats itself while the kart moves
    REFUSED = 4  # what it says does not agree with the other sensors
