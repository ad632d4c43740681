"""Vehicles in numbers: what a kart is, and what it draws."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.core.records import fields_of, record_of
from race_server.errors import VehicleError

# Ends the name of a preset that is to be driven without slip.
KINEMATIC = "-kinematic"
GRAVITY = 9.81  # [m/s²]
KMH = 1.0 / 3.6  # [m/s] in one km/h


# A vehicle draws at most so many trailers, one behind the other.
TRAILERS = 3


@dataclass(frozen=True)
class Trailer:
    """One axle behind a hitch, with a box on it. Led without force: it has no mass here.

    The mass of what is drawn belongs to that of the vehicle.
    """

    hitch: float  # [m] from the axle ahead back to the hitch; negative: the hitch is ahead of it
    bar: float  # [m] from the hitch back to the axle of this trailer
    ahead: float  # [m] from the hitch forward to the front of the box; negative behind a drawbar
    behind: float  # [m] from the axle back to the rear of the box
    width: float  # [m] of the box
    limit: float  # [rad] a larger angle at the hitch is a jack-knife

    @property
    def length(self) -> float:
        """Length of the box [m]."""
        return self.ahead + self.bar + self.behind

    @property
    def box_offset(self) -> float:
        """Distance from the axle forward to the middle of the box [m]."""
        return 0.5 * (self.ahead + self.bar - self.behind)


@dataclass(frozen=True)
class Vehicle:
    """One kind of kart. SI units; forces act on the whole vehicle.

    The position of a kart is its centre of gravity. Its body is a box of `length` by `width`
    whose centre lies `box_offset` ahead of that point.
    """

    name: str
    length: float  # [m] of the body
    width: float  # [m] of the body
    box_offset: float  # [m] from the centre of gravity forward to the middle of the body
    front_axle: float  # [m] from the centre of gravity forward to the front axle
    rear_axle: float  # [m] from the centre of gravity back to the rear axle
    mass: float  # [kg] with driver
    yaw_inertia: float  # [kg m²] about the vertical axis
    steering_limit: float  # [rad] at the road wheels
    steering_rate: float  # [rad/s] at the road wheels
    motor_force: float  # [N] at the wheels, the limit of the motor's torque
    motor_power: float  # [W]
    brake_force: float  # [N]
    front_drive: float  # [-] share of the driving force on the front axle
    front_brake: float  # [-] share of the braking force on the front axle
    top_speed: float  # [m/s] set in the motor controller
    reverse_speed: float  # [m/s] set in the motor controller
    rolling: float  # [-] rolling resistance as a share of the weight
    drag: float  # [kg/m] air drag is drag · speed²
    grip: float  # [-] friction of tyre on dry asphalt
    cornering: float  # [1/rad] cornering stiffness as a share of the load
    kinematic_below: float  # [m/s] slower than this there is no slip
    dynamic_above: float  # [m/s] faster than this the tyres alone decide
    trailers: tuple[Trailer, ...] = ()  # the nearest one first

    def __post_init__(self) -> None:
        """Refuse more trailers than there is room for."""
        if len(self.trailers) > TRAILERS:
            raise VehicleError(
                f"vehicle {self.name!r} draws {len(self.trailers)} trailers: at most {TRAILERS} do"
            )

    @property
    def wheelbase(self) -> float:
        """Distance between the axles [m]."""
        return self.front_axle + self.rear_axle

    @property
    def turning_radius(self) -> float:
        """Smallest radius [m] of the rear axle's path without slip."""
        return self.wheelbase / float(np.tan(self.steering_limit))

    def without_slip(self) -> "Vehicle":
        """Return the same vehicle with the kinematic model alone: the wheels never slip."""
        return replace(self, name=self.name + KINEMATIC, kinematic_below=1e9, dynamic_above=2e9)


_NUMBERS = [field.name for field in fields(Vehicle) if field.name not in {"name", "trailers"}]
_TRAILER_NUMBERS = [field.name for field in fields(Trailer)]

# One trailer's sizes as the kernels read them, and the vehicle that draws it.
DRAWN = record_of(fields_of(" ".join(_TRAILER_NUMBERS), ""))
VEHICLE = record_of(
    [*fields_of(" ".join(_NUMBERS), "trailer_count"), ("trailers", DRAWN, (TRAILERS,))]
)


def vehicle_record(vehicle: Vehicle) -> NDArray[np.void]:
    """Return the vehicle's numbers as an array of one VEHICLE record."""
    record = np.zeros(1, VEHICLE)
    for name in _NUMBERS:
        record[name] = getattr(vehicle, name)
    record["trailer_count"] = len(vehicle.trailers)
    for number, trailer in enumerate(vehicle.trailers):
        for name in _TRAILER_NUMBERS:
            record["trailers"][name][0, number] = getattr(trailer, name)
    return record


def vehicle_of(record: Any) -> Vehicle:
    """Return the vehicle of a VEHICLE record, which knows no name."""
    drawn = record["trailers"][: int(record["trailer_count"])]
    trailers = tuple(Trailer(*(float(one[name]) for name in _TRAILER_NUMBERS)) for one in drawn)
    return Vehicle("", **{name: float(record[name]) for name in _NUMBERS}, trailers=trailers)
