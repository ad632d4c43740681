"""Vehicles in numbers: what a kart is, and what it draws."""

import math
from collections.abc import Mapping, Sequence
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


# The most trailers that a vehicle draws, one behind the other, and the most feelers that it has.
TRAILERS, FEELERS = 3, 14


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
class Feeler:
    """A ray that measures how far something is from one of the boxes of a vehicle."""

    box: int  # that carries it: 0 is the vehicle's own, 1 that of the nearest trailer
    ahead: float  # [m] from the middle of the box
    left: float  # [m]
    angle: float  # [rad] of the ray against the box, left positive


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
    feelers: tuple[Feeler, ...] = ()

    def __post_init__(self) -> None:
        """Refuse more trailers and feelers than there is room for."""
        if len(self.trailers) > TRAILERS:
            raise VehicleError(
                f"vehicle {self.name!r} draws {len(self.trailers)} trailers: at most {TRAILERS} do"
            )
        if len(self.feelers) > FEELERS:
            raise VehicleError(
                f"vehicle {self.name!r} has {len(self.feelers)} feelers: at most {FEELERS} fit"
            )
        for feeler in self.feelers:
            if not 0 <= feeler.box <= len(self.trailers):
                raise VehicleError(
                    f"vehicle {self.name!r}: a feeler on box {feeler.box}; give 0 to "
                    f"{len(self.trailers)}, the number of its trailers"
                )

    @property
    def wheelbase(self) -> float:
        """Distance between the axles [m]."""
        return self.front_axle + self.rear_axle

    @property
    def is_model_car(self) -> bool:
        """Whether it is shorter than a metre: it drives courses of 1/10."""
        return self.length < 1.0

    @property
    def turning_radius(self) -> float:
        """Smallest radius [m] of the rear axle's path without slip."""
        return self.wheelbase / float(np.tan(self.steering_limit))

    @property
    def ends(self) -> tuple[float, float]:
        """Front and rear [m] of all boxes ahead of the centre of gravity, standing straight."""
        front, rear = self.box_offset + 0.5 * self.length, self.box_offset - 0.5 * self.length
        axle = -self.rear_axle
        for trailer in self.trailers:
            front = max(front, axle - trailer.hitch + trailer.ahead)
            axle -= trailer.hitch + trailer.bar
            rear = min(rear, axle - trailer.behind)
        return front, rear

    @property
    def overall_length(self) -> float:
        """Length [m] of all boxes, standing straight."""
        front, rear = self.ends
        return front - rear

    @property
    def overall_width(self) -> float:
        """Width [m] of the widest box."""
        return max(self.width, *(trailer.width for trailer in self.trailers), 0.0)

    def boxes_at(
        self, x: float, y: float, heading: float, headings: Sequence[float]
    ) -> list[tuple[float, float, float, float, float]]:
        """Return middle (x, y) [m], heading [rad], length and width [m] of each box.

        x, y: centre of gravity; headings: of the trailers.
        """
        cos, sin = math.cos(heading), math.sin(heading)
        boxes = [(x + self.box_offset * cos, y + self.box_offset * sin, heading)]
        sizes = [(self.length, self.width)]
        x, y = x - self.rear_axle * cos, y - self.rear_axle * sin
        for trailer, turned in zip(self.trailers, headings, strict=False):
            x, y = x - trailer.hitch * cos, y - trailer.hitch * sin
            cos, sin = math.cos(turned), math.sin(turned)
            x, y = x - trailer.bar * cos, y - trailer.bar * sin
            boxes.append((x + trailer.box_offset * cos, y + trailer.box_offset * sin, turned))
            sizes.append((trailer.length, trailer.width))
        return [(*box, *size) for box, size in zip(boxes, sizes, strict=True)]

    def without_slip(self) -> "Vehicle":
        """Return the same vehicle with the kinematic model alone: the wheels never slip."""
        return replace(self, name=self.name + KINEMATIC, kinematic_below=1e9, dynamic_above=2e9)


_PARTS = {"trailers": Trailer, "feelers": Feeler}
_NUMBERS = [field.name for field in fields(Vehicle) if field.name not in {"name", *_PARTS}]
_TRAILER_NUMBERS = [field.name for field in fields(Trailer)]

# One trailer's sizes as the kernels read them, one feeler, and the vehicle that has them.
DRAWN = record_of(fields_of(" ".join(_TRAILER_NUMBERS), ""))
FEELER = record_of(fields_of("ahead left angle cos sin", "box"))
VEHICLE = record_of(
    [
        *fields_of(" ".join(_NUMBERS), "trailer_count feeler_count"),
        ("trailers", DRAWN, (TRAILERS,)),
        ("feelers", FEELER, (FEELERS,)),
    ]
)


def vehicle_record(vehicle: Vehicle) -> NDArray[np.void]:
    """Return the vehicle's numbers as an array of one VEHICLE record."""
    record = np.zeros(1, VEHICLE)
    for name in _NUMBERS:
        record[name] = getattr(vehicle, name)
    record["trailer_count"] = len(vehicle.trailers)
    record["feeler_count"] = len(vehicle.feelers)
    for part in _PARTS:
        for number, one in enumerate(getattr(vehicle, part)):
            for name, value in vars(one).items():
                record[part][name][0, number] = value
    record["feelers"]["cos"] = np.cos(record["feelers"]["angle"])
    record["feelers"]["sin"] = np.sin(record["feelers"]["angle"])
    return record


def vehicle_of(record: Any) -> Vehicle:
    """Return the vehicle of a VEHICLE record, which knows no name."""
    numbers = {name: float(record[name]) for name in _NUMBERS}
    trailers = record["trailers"][: int(record["trailer_count"])]
    feelers = record["feelers"][: int(record["feeler_count"])]
    return Vehicle(
        "",
        **numbers,
        trailers=tuple(_part(Trailer, one) for one in trailers),
        feelers=tuple(_part(Feeler, one) for one in feelers),
    )


def numbers_of(vehicle: Vehicle) -> dict[str, float]:
    """Return all numbers of a vehicle by name, such as ``mass`` and ``trailers.1.bar``."""
    numbers = {name: float(getattr(vehicle, name)) for name in _NUMBERS}
    for part in _PARTS:
        for number, one in enumerate(getattr(vehicle, part)):
            for name, value in vars(one).items():
                numbers[f"{part}.{number}.{name}"] = float(value)
    return numbers


def vehicle_from(name: str, numbers: Mapping[str, float]) -> Vehicle:
    """Return the vehicle that `numbers_of` took apart.

    Raises:
        KeyError: a number is missing.
        VehicleError: more trailers or feelers than there is room for.
    """
    parts: dict[str, list[Any]] = {part: [] for part in _PARTS}
    for part, kind in _PARTS.items():
        while any(key.startswith(f"{part}.{len(parts[part])}.") for key in numbers):
            prefix = f"{part}.{len(parts[part])}."
            own = {field.name: numbers[prefix + field.name] for field in fields(kind)}
            parts[part].append(_part(kind, own))
    return Vehicle(
        name,
        **{key: numbers[key] for key in _NUMBERS},
        trailers=tuple(parts["trailers"]),
        feelers=tuple(parts["feelers"]),
    )


def vehicle_in(words: Mapping[str, Any]) -> Vehicle:
    """Return the vehicle that `dataclasses.asdict` took apart; old ones have no trailers."""
    parts = {
        part: tuple(kind(**one) for one in words.get(part, ())) for part, kind in _PARTS.items()
    }
    return Vehicle(**{**words, **parts})


def _part(kind: type, numbers: Any) -> Any:
    """Return a trailer or a feeler from its numbers, by name."""
    values = {field.name: float(numbers[field.name]) for field in fields(kind)}
    return kind(**{**values, **({"box": int(values["box"])} if "box" in values else {})})
