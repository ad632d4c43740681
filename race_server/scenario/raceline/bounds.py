"""What a vehicle can do at most, as a point mass that follows a line."""

import math
from dataclasses import dataclass, replace

from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.errors import VehicleError

# Free room beside the body, as a share of the vehicle's width: 0.05 m for a 1/10 car.
MARGIN_SHARE = 0.05 / 0.19
# Slowest speed [m/s] of a flying lap: time per distance must stay finite.
SLOWEST = 0.3
# Stands for no limit at all [m/s²].
_ENDLESS = 1e3

# Tyres stiffer than this (force over load and slip) count as ideal: a point mass without losses.
STIFF = 100.0


@dataclass(frozen=True)
class Bounds:
    """Limits of a vehicle. Accelerations are forces over its mass."""

    lateral: float  # [m/s²] most acceleration across the line, where none is along it
    drive_grip: float  # [m/s²] most that the driven tyres pass on, where none is across
    brake_grip: float  # [m/s²] the same for the braked tyres
    slide: float  # [-] slip at which a tyre slides altogether; 0 where bends cost nothing
    front_load: float  # [-] share of the weight on the front axle
    front_drive: float  # [-] share of the driving force there
    front_brake: float  # [-] share of the braking force there
    drive: float  # [m/s²] of the motor
    brake: float  # [m/s²] of the brakes
    power: float  # [W/kg] of the motor
    rolling: float  # [m/s²] of rolling resistance
    drag: float  # [1/m] air drag is drag · speed²
    curvature: float  # [1/m] at full steering
    steering_rate: float  # [rad/s] at the road wheels
    wheelbase: float  # [m]
    top_speed: float  # [m/s]
    width: float  # [m] of the body
    reach: float  # [m] from the middle of the body to where the borders may begin
    lag: float  # [s²/m] time in which the yaw rate follows the steering, over the speed


def bounds_of(
    vehicle: Vehicle, speed_cap: float | None = None, margin: float | None = None
) -> Bounds:
    """Return the limits of a vehicle that drives no faster than `speed_cap` [m/s].

    margin: [m] of free room beside the body, by default a share of its width.

    Each axle has its own friction circle: with the share s of the longitudinal force and the
    share w of the weight (and so of the lateral force) on an axle, it slides at
    (s a)² + (w a_lateral)² = (w grip g)². The axle that slides first decides, which makes the
    vehicle's limit an ellipse with the half-axes grip g w / s and grip g. Four driven wheels with
    s = w make it a circle. What a bend costs by slip follows in `scenario/raceline/tyres.py`.

    Raises:
        VehicleError: the cap leaves no speed to lap at, or the margin is no length.
    """
    if speed_cap is not None and not SLOWEST < speed_cap < math.inf:
        raise VehicleError(f"speed cap {speed_cap} m/s: give a speed above {SLOWEST} m/s")
    if margin is not None and not 0.0 <= margin < math.inf:
        raise VehicleError(f"margin {margin} m: give a length of zero or more")
    front_load = vehicle.rear_axle / vehicle.wheelbase
    grip = vehicle.grip * GRAVITY
    slips = vehicle.kinematic_below < vehicle.top_speed
    loses = slips and vehicle.cornering < STIFF
    stiffness = vehicle.cornering * vehicle.mass * GRAVITY  # [N/rad] of all tyres
    turning = vehicle.yaw_inertia if slips else 0.0  # without slip it follows the wheels at once
    bounds = Bounds(
        lateral=grip if slips else _ENDLESS,
        drive_grip=grip * _load_per_force(vehicle.front_drive, front_load),
        brake_grip=grip * _load_per_force(vehicle.front_brake, front_load),
        slide=3.0 * vehicle.grip / vehicle.cornering if loses else 0.0,
        front_load=front_load,
        front_drive=vehicle.front_drive,
        front_brake=vehicle.front_brake,
        drive=vehicle.motor_force / vehicle.mass,
        brake=vehicle.brake_force / vehicle.mass,
        power=vehicle.motor_power / vehicle.mass,
        rolling=vehicle.rolling * GRAVITY,
        drag=vehicle.drag / vehicle.mass,
        curvature=1.0 / vehicle.turning_radius,
        steering_rate=vehicle.steering_rate,
        wheelbase=vehicle.wheelbase,
        top_speed=vehicle.top_speed,
        width=vehicle.width,
        reach=0.5 * vehicle.width + (MARGIN_SHARE * vehicle.width if margin is None else margin),
        lag=turning / (stiffness * vehicle.front_axle * vehicle.rear_axle),
    )
    if speed_cap is None:
        return bounds
    return replace(bounds, top_speed=min(speed_cap, vehicle.top_speed))


def _load_per_force(front_force: float, front_load: float) -> float:
    """Return load over longitudinal force, as shares, of the axle that slides first."""
    front = front_load / max(front_force, 1e-9)
    rear = (1.0 - front_load) / max(1.0 - front_force, 1e-9)
    return min(front, rear)
