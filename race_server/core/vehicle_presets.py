"""Vehicles that have a name, with the sources of their figures."""

from dataclasses import replace

import numpy as np

from race_server.core.vehicles import GRAVITY, KINEMATIC, KMH, Feeler, Trailer, Vehicle
from race_server.errors import VehicleError

# The 1/10 car of the Paris-Saclay autonomous race, on a Tamiya TT-02 chassis.
# Wheelbase, mass, steering, motor: Webots model TT02_2023b of the race's simulator. The final
# drive follows from 13 800 rpm at 36 km/h with wheels of 0.04 m: 5.78, so that 0.0234 N m become
# 3.38 N. Body: the rules allow 400-480 by 160-190 mm. Grip: 5 m/s² in a bend and 4 m/s² of
# braking on a smooth floor, our choice. Inertia: that of a uniform box. Drag is negligible.
TT02 = Vehicle(
    name="tt02",
    length=0.45,
    width=0.19,
    box_offset=0.0,
    front_axle=0.1285,
    rear_axle=0.1285,
    mass=2.331,
    yaw_inertia=2.331 * (0.45**2 + 0.19**2) / 12.0,
    steering_limit=0.314,
    steering_rate=3.2,
    motor_force=3.38,
    motor_power=32.0,
    brake_force=9.3,
    front_drive=0.5,
    front_brake=0.5,
    top_speed=36.0 * KMH,
    reverse_speed=1.0,
    rolling=0.02,
    drag=0.004,
    grip=5.0 / GRAVITY,
    cornering=8.0,
    kinematic_below=0.5,
    dynamic_above=1.5,
)

# The same car with the drift kit of the report of 2023, whose wheels turn by about 30°. Without
# slip it turns on 0.45 m; the report measured 0.70 m at low speed.
TT02_DRIFT = replace(TT02, name="tt02-drift", steering_limit=float(np.radians(30.0)))

# The 1/10 car in round figures, to compare minimum lap times with: turning radius 0.70 m,
# grip and braking on a smooth floor, more motor than ours, a curvature that changes by 6 1/(m s),
# and no losses: neither rolling nor air drag, and tyres so stiff that they hardly slip. At the
# limit 0.2 degrees of slip hold back 0.015 m/s², where those of the TT-02 do 0.94. The motor's
# power is never the limit.
TT02_FACTS = replace(
    TT02,
    name="tt02-facts",
    steering_limit=float(np.arctan(TT02.wheelbase / 0.70)),
    steering_rate=6.0 * TT02.wheelbase,
    motor_force=3.0 * TT02.mass,
    motor_power=3.0 * TT02.mass * 36.0 * KMH,
    brake_force=4.0 * TT02.mass,
    rolling=0.0,
    drag=0.0,
    cornering=500.0,
)

# An electric rental kart with its driver. Size and wheelbase: the vehicle description of the
# Japan Automotive AI Challenge kart (2024): wheelbase 1.087 m, overhangs 0.467 and 0.510 m,
# 1.30 m wide, steering up to 0.64 rad. Mass, power and accelerations: Sodi RSX2, 186 kg and a
# driver of 75 kg, 10.3 kW, 0-50 km/h in about 3.2 s, 0.89 g in bends, 0.75 g braking. Rear
# drive, rear brakes as on rental karts; 60 % of the weight on the rear axle. Tyre stiffness,
# drag and the two blending speeds are our choice.
KART_60 = Vehicle(
    name="kart-60",
    length=2.06,
    width=1.30,
    box_offset=0.087,
    front_axle=0.652,
    rear_axle=0.435,
    mass=261.0,
    yaw_inertia=261.0 * (1.6**2 + 1.0**2) / 12.0,
    steering_limit=0.55,
    steering_rate=2.5,
    motor_force=1200.0,
    motor_power=10_300.0,
    brake_force=0.75 * 261.0 * GRAVITY,
    front_drive=0.0,
    front_brake=0.3,
    top_speed=60.0 * KMH,
    reverse_speed=1.5,
    rolling=0.015,
    drag=0.35,
    grip=0.89,
    cornering=10.0,
    kinematic_below=1.0,
    dynamic_above=3.0,
)

# Rental karts are throttled by the hall: 30 km/h for learners, 13 km/h for automatic parking.
KART_30 = replace(KART_60, name="kart-30", top_speed=30.0 * KMH)
KART_13 = replace(KART_60, name="kart-13", top_speed=13.0 * KMH)

# The car of the Trajectory Planning Competition for Automated Parking (TPCAP, 2022): wheelbase
# 2.80 m, overhangs 0.96 and 0.929 m, 1.942 m wide, steering up to 0.75 rad at 0.5 rad/s, 2.5 m/s
# both ways, 1.0 m/s² of speeding up and of braking. Motor and brakes give just that, with a rolling
# resistance of 0.12 m/s². Our choice: 1500 kg, 55 % of them on the driven front axle, the inertia
# of a uniform box, drag of 2.2 m² with a coefficient of 0.3, and speeds up to which it never slips.
CAR = Vehicle(
    name="car",
    length=0.96 + 2.80 + 0.929,
    width=1.942,
    box_offset=0.5 * (0.96 + 2.80 - 0.929) - 1.54,
    front_axle=1.26,
    rear_axle=1.54,
    mass=1500.0,
    yaw_inertia=1500.0 * (4.689**2 + 1.942**2) / 12.0,
    steering_limit=0.75,
    steering_rate=0.5,
    motor_force=1500.0 * (1.0 + 0.012 * GRAVITY),
    motor_power=5000.0,
    brake_force=1500.0 * (1.0 - 0.012 * GRAVITY),
    front_drive=1.0,
    front_brake=0.6,
    top_speed=2.5,
    reverse_speed=2.5,
    rolling=0.012,
    drag=0.4,
    grip=0.9,
    cornering=10.0,
    kinematic_below=3.0,
    dynamic_above=6.0,
)


# Our choice, as the report on an articulated vehicle that learns to park names 14 rays and no
# directions: from the middle of the front of what draws; from the sides of the trailer, in its
# middle and at its rear; from the middle of its rear.
_FRONT_RAYS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0)
_REAR_RAYS = (180.0, 150.0, -150.0)


def _feelers(length: float, trailer: Trailer) -> tuple[Feeler, ...]:
    """Return the feelers of a vehicle with one trailer. length: of what draws it [m]."""
    rear, side = -0.5 * trailer.length, 0.5 * trailer.width
    rays = [
        *((0, 0.5 * length, 0.0, angle) for angle in _FRONT_RAYS),
        *((1, at, turn * side, turn * 90.0) for at in (0.0, rear) for turn in (1.0, -1.0)),
        *((1, rear, 0.0, angle) for angle in _REAR_RAYS),
    ]
    return tuple(
        Feeler(box, ahead, left, float(np.radians(angle))) for box, ahead, left, angle in rays
    )


def _slow(
    name: str, base: Vehicle, trailer: Trailer, mass: float, acceleration: float, reverse: float
) -> Vehicle:
    """Return `base` as it draws a trailer at 2 m/s, with motor and brakes for `acceleration`.

    mass: of both [kg]; acceleration: [m/s²]; reverse: most speed backwards [m/s].
    """
    rolling = base.rolling * GRAVITY
    return replace(
        base,
        name=name,
        mass=mass,
        yaw_inertia=base.yaw_inertia * mass / base.mass,
        motor_force=mass * (acceleration + rolling),
        motor_power=mass * (acceleration + rolling) * 4.0,
        brake_force=mass * max(acceleration - rolling, 0.5 * acceleration),
        top_speed=2.0,
        reverse_speed=reverse,
        kinematic_below=3.0,
        dynamic_above=6.0,
        trailers=(trailer,),
        feelers=_feelers(base.length, trailer),
    )


# A tractor with two axles and a semitrailer of 13.6 m, together 16.50 m long: within directive
# 96/53/EC (12.00 m from the kingpin to the rear, front corners 2.046 m from the kingpin, 2.55 m
# wide). The fifth wheel lies 0.60 m ahead of the rear axle. 15 t empty, 0.6 m/s² at most; the
# rest is our choice.
_TRACTOR = replace(
    CAR,
    name="tractor",
    length=1.40 + 3.70 + 0.90,
    width=2.55,
    box_offset=0.5 * (1.40 + 3.70 - 0.90) - 1.85,
    front_axle=1.85,
    rear_axle=1.85,
    steering_limit=0.70,
    steering_rate=0.5,
    rolling=0.006,
    drag=3.0,
    front_drive=0.0,
)
_SEMITRAILER = Trailer(
    hitch=-0.60, bar=7.70, ahead=1.60, behind=4.30, width=2.55, limit=float(np.pi / 2.0)
)
LORRY = _slow("lorry-16m5", _TRACTOR, _SEMITRAILER, 15_000.0, 0.6, 1.5)

# The tractor with its hitch behind the rear axle, as the report on an articulated vehicle that
# learns to park has it; it prints no sizes, so they are those of the lorry, the box behind a
# drawbar of 1.5 m.
LORRY_OFF_AXLE = _slow(
    "lorry-off-axle",
    _TRACTOR,
    replace(_SEMITRAILER, hitch=0.60, ahead=-1.50, limit=float(np.radians(60.0))),
    15_000.0,
    0.6,
    1.5,
)

# A car with a caravan on its ball, and a kart with a cart; sizes are our choice, such
# that a box just clears what draws it at the limit of the hitch.
_FAMILY_CAR = replace(
    CAR,
    length=0.96 + 2.80 + 0.93,
    width=1.94,
    box_offset=0.5 * (0.96 + 2.80 - 0.93) - 1.54,
    steering_limit=0.60,
)
CAR_TRAILER = _slow(
    "car-trailer",
    _FAMILY_CAR,
    Trailer(hitch=1.20, bar=3.60, ahead=-1.20, behind=2.0, width=2.0, limit=float(np.pi / 3.0)),
    2700.0,
    1.0,
    1.5,
)
KART_CART = _slow(
    "kart-cart",
    KART_13,
    Trailer(
        hitch=0.35, bar=1.20, ahead=-0.65, behind=0.5, width=1.1, limit=float(np.radians(50.0))
    ),
    300.0,
    1.5,
    1.0,
)

# The vehicle of highway-env 1.12.1: 5 by 2 m, axles 5 m apart, wheels that turn by 45° at once and
# never slip, 5 m/s² both ways, 40 m/s (https://github.com/Farama-Foundation/HighwayEnv). It has no
# mass: ours gives the forces, and its tyres hold them.
HIGHWAY_CAR = Vehicle(
    name="highway-car",
    length=5.0,
    width=2.0,
    box_offset=0.0,
    front_axle=2.5,
    rear_axle=2.5,
    mass=1000.0,
    yaw_inertia=1000.0 * (5.0**2 + 2.0**2) / 12.0,
    steering_limit=float(np.radians(45.0)),
    steering_rate=1000.0,
    motor_force=5000.0,
    motor_power=1e6,
    brake_force=5000.0,
    front_drive=0.5,
    front_brake=0.5,
    top_speed=40.0,
    reverse_speed=40.0,
    rolling=0.0,
    drag=0.0,
    grip=2.0,
    cornering=10.0,
    kinematic_below=1e9,
    dynamic_above=2e9,
)

VEHICLES = {
    vehicle.name: vehicle
    for vehicle in (
        *(TT02, TT02_DRIFT, TT02_FACTS, KART_13, KART_30, KART_60, CAR, HIGHWAY_CAR),
        *(LORRY, LORRY_OFF_AXLE, CAR_TRAILER, KART_CART),
    )
}


# Those that race, by the scale of their courses.
TENTH = ("tt02", "tt02-drift", "tt02-facts")
KARTS = ("kart-13", "kart-30", "kart-60")


def vehicle_named(name: str) -> Vehicle:
    """Return the preset called `name`; ``tt02-kinematic`` is ``tt02`` without slip.

    Raises:
        VehicleError: there is none.
    """
    preset = name.removesuffix(KINEMATIC) if isinstance(name, str) else ""
    if preset not in VEHICLES:
        known = ", ".join(sorted(VEHICLES))
        raise VehicleError(
            f"vehicle {name!r} is unknown; choose one of {known}, "
            f"or one of them with {KINEMATIC!r} behind its name"
        )
    vehicle = VEHICLES[preset]
    return vehicle.without_slip() if name.endswith(KINEMATIC) else vehicle
