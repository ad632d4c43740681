"""Motion of a kart: a single-track model with saturating tyres, kinematic at low speed."""

import math
from typing import NamedTuple

from race_server.core.kernels.geometry import clip, cos_sin, sign
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record
from race_server.core.vehicles import GRAVITY

# Below this the wheels' own speed is not used as a divisor [m/s].
CREEP = 0.05
# The motor fades out over this share of the allowed speed, so that a cap is met softly.
FADE = 0.03
# Above the allowed speed the motor brakes with at most this share of the brakes.
CAP_BRAKE = 0.5
CAP_RATE = 5.0  # [1/s] of the excess that it would like to lose


class Motion(NamedTuple):
    """Pose and speeds of a body: where it is, and how it moves along and across itself."""

    x: float  # [m] of the centre of gravity
    y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s] along the body, negative in reverse
    lateral_speed: float  # [m/s] to its left
    yaw_rate: float  # [rad/s]
    steering: float  # [rad]


class Command(NamedTuple):
    """What the driver asks for, as shares of the limits."""

    steering: float  # [-1, 1]
    throttle: float  # [-1, 1]
    brake: float  # [0, 1]


class Allowance(NamedTuple):
    """What flags, effects and surface leave of a vehicle."""

    cap: float  # [m/s] speed, which may lie above the top speed while a boost lasts
    thrust: float  # scale of the motor's force and power
    grip: float  # scale of the friction
    roll: float  # rolling resistance on top of the vehicle's, as a share of the weight


class Axles(NamedTuple):
    """Forces along the body at both axles [N], and the most that the tyres of each can give."""

    front: float
    rear: float
    front_grip: float
    rear_grip: float


class Rates(NamedTuple):
    """Speed and lateral speed [m/s] and yaw rate [rad/s] after a step."""

    speed: float
    lateral_speed: float
    yaw_rate: float


@kernel
def tyre_stiffness(slip: float, stiffness: float, limit: float) -> float:
    """Return lateral force over slip of a brush tyre [N].

    slip: tangent of the slip angle; stiffness: force per slip at zero slip [N]; limit: the most
    lateral force that grip and driving force leave [N]. Fiala's brush model with parabolic
    pressure (Pacejka, Tire and Vehicle Dynamics, 3.2): the force rises as a cubic and stays at
    the limit once the whole contact patch slides.
    """
    if limit <= 0.0:
        return 0.0
    # Divisions are slow: divide only where it is needed, and never by a constant.
    if stiffness * abs(slip) >= 3.0 * limit:
        return limit / abs(slip)
    slide = stiffness * abs(slip) / (3.0 * limit)
    return stiffness * (1.0 - slide + slide * slide * (1.0 / 3.0))


@kernel
def motor_force(vehicle: Record, speed: float, throttle: float, allowance: Allowance) -> float:
    """Return the force [N] of the motor at the wheels, negative in reverse.

    vehicle: VEHICLE; speed: along the body [m/s]; throttle: [-1, 1].
    """
    ahead = throttle >= 0.0
    allowed = allowance.cap if ahead else min(vehicle.reverse_speed, allowance.cap)
    rate = speed if ahead else -speed
    force = vehicle.motor_force * allowance.thrust
    if force * rate > vehicle.motor_power * allowance.thrust:
        force = vehicle.motor_power * allowance.thrust / rate
    left, soft = allowed - rate, max(FADE * allowed, CREEP)
    if left < soft:
        force *= max(left, 0.0) / soft
    return throttle * force


@kernel
def resistance(
    vehicle: Record, speed: float, brake: float, allowance: Allowance, rate: float
) -> float:
    """Return the force [N] of brakes, cap and rolling against the motion, for both axles.

    vehicle: VEHICLE; speed: along the body [m/s]; brake: [0, 1]; rate: steps a second [1/s]. It
    never does more than stop the vehicle within a step.
    """
    force = brake * vehicle.brake_force
    over = abs(speed) - allowance.cap
    if over > 0.0:
        force = max(force, min(CAP_BRAKE * vehicle.brake_force, vehicle.mass * over * CAP_RATE))
    force += (vehicle.rolling + allowance.roll) * vehicle.mass * GRAVITY
    return min(force, vehicle.mass * abs(speed) * rate)


@kernel
def axle_loads(vehicle: Record) -> tuple[float, float]:
    """Return the shares of the weight on the front and on the rear axle [N]."""
    per_length = 1.0 / (vehicle.front_axle + vehicle.rear_axle)
    front = vehicle.mass * GRAVITY * vehicle.rear_axle * per_length
    return front, vehicle.mass * GRAVITY * vehicle.front_axle * per_length


@kernel
def longitudinal_forces(
    vehicle: Record, speed: float, command: Command, allowance: Allowance, rate: float
) -> Axles:
    """Return the forces along the body, each axle's within its grip.

    vehicle: VEHICLE; speed: along the body [m/s]; rate: steps a second [1/s].
    """
    front_load, rear_load = axle_loads(vehicle)
    friction = vehicle.grip * allowance.grip
    front_grip, rear_grip = friction * front_load, friction * rear_load
    drive = motor_force(vehicle, speed, command.throttle, allowance)
    drag = sign(speed) * resistance(vehicle, speed, command.brake, allowance, rate)
    front = drive * vehicle.front_drive - drag * vehicle.front_brake
    rear = drive * (1.0 - vehicle.front_drive) - drag * (1.0 - vehicle.front_brake)
    return Axles(
        clip(front, -front_grip, front_grip),
        clip(rear, -rear_grip, rear_grip),
        front_grip,
        rear_grip,
    )


@kernel
def slip_solution(
    vehicle: Record, motion: Motion, axles: Axles, air: float, cos: float, sin: float, dt: float
) -> Rates:
    """Return the rates after `dt` [s] with slipping tyres.

    vehicle: VEHICLE; motion: at the start; air: drag [N]; cos, sin: of the steering angle. The
    axle's force along the body takes its part of the grip first.
    """
    a, b = vehicle.front_axle, vehicle.rear_axle
    speed, lateral_speed, yaw_rate = motion.speed, motion.lateral_speed, motion.yaw_rate
    rate, per_mass = 1.0 / dt, 1.0 / vehicle.mass
    front_load, rear_load = axle_loads(vehicle)
    front, rear = axles.front, axles.rear
    across = lateral_speed + a * yaw_rate
    per_front = 1.0 / max(abs(speed * cos + across * sin), CREEP)
    front_slip = (across * cos - speed * sin) * per_front
    per_rear = 1.0 / max(abs(speed), CREEP)
    rear_slip = (lateral_speed - b * yaw_rate) * per_rear
    front_limit = math.sqrt(axles.front_grip * axles.front_grip - front * front)
    rear_limit = math.sqrt(axles.rear_grip * axles.rear_grip - rear * rear)
    kf = tyre_stiffness(front_slip, vehicle.cornering * front_load, front_limit) * per_front
    kr = tyre_stiffness(rear_slip, vehicle.cornering * rear_load, rear_limit) * per_rear

    # Two linear equations for lateral speed and yaw rate at the end of the step.
    kfc = kf * cos * cos
    push = kf * cos * sin * speed + front * sin
    m11 = vehicle.mass * rate + kfc + kr
    m12 = vehicle.mass * speed + kfc * a - kr * b
    m21 = kfc * a - kr * b
    m22 = vehicle.yaw_inertia * rate + kfc * a * a + kr * b * b
    r1 = vehicle.mass * rate * lateral_speed + push
    r2 = vehicle.yaw_inertia * rate * yaw_rate + a * push
    inverse = 1.0 / (m11 * m22 - m12 * m21)
    slip_speed = (r1 * m22 - r2 * m12) * inverse
    slip_rate = (m11 * r2 - m21 * r1) * inverse
    side = -kf * ((slip_speed + a * slip_rate) * cos - speed * sin)
    ahead = front * cos - side * sin + rear - air
    pace = speed + dt * (ahead * per_mass + slip_speed * slip_rate)
    return Rates(pace, slip_speed, slip_rate)


@kernel
def integrate(motion: Motion, rates: Rates, steering: float, dt: float) -> Motion:
    """Return the motion after `dt` [s] at the given rates; the heading is not wrapped.

    steering: angle after the step [rad].
    """
    cos, sin = cos_sin(motion.heading + 0.5 * dt * rates.yaw_rate)
    x = motion.x + dt * (rates.speed * cos - rates.lateral_speed * sin)
    y = motion.y + dt * (rates.speed * sin + rates.lateral_speed * cos)
    heading = motion.heading + dt * rates.yaw_rate
    return Motion(x, y, heading, rates.speed, rates.lateral_speed, rates.yaw_rate, steering)


@kernel
def move(
    vehicle: Record, motion: Motion, command: Command, allowance: Allowance, dt: float
) -> Motion:
    """Return the motion after `dt` [s]; the heading is not wrapped.

    vehicle: VEHICLE; motion: at the start. Forces follow from it; lateral speed and yaw rate are
    then solved implicitly with the tyres' secant stiffness, which is stable at every speed and
    step. Slower than `kinematic_below` the wheels roll without slip; up to `dynamic_above` the two
    are blended.
    """
    # Steering moves at a limited rate towards what was asked for.
    target = command.steering * vehicle.steering_limit
    turn = vehicle.steering_rate * dt
    steering = motion.steering + clip(target - motion.steering, -turn, turn)
    cos, sin = cos_sin(steering)
    speed = motion.speed
    axles = longitudinal_forces(vehicle, speed, command, allowance, 1.0 / dt)
    air = vehicle.drag * speed * abs(speed)

    # Without slip: the rear axle moves along the body.
    pace = speed + dt * (axles.front + axles.rear - air) * (1.0 / vehicle.mass)
    turning = pace * sin / cos * (1.0 / (vehicle.front_axle + vehicle.rear_axle))
    sliding = vehicle.rear_axle * turning

    if abs(speed) > vehicle.kinematic_below:
        blend = 1.0
        if abs(speed) < vehicle.dynamic_above:
            blend = (abs(speed) - vehicle.kinematic_below) / (
                vehicle.dynamic_above - vehicle.kinematic_below
            )
        slip = slip_solution(vehicle, motion, axles, air, cos, sin, dt)
        pace += blend * (slip.speed - pace)
        sliding += blend * (slip.lateral_speed - sliding)
        turning += blend * (slip.yaw_rate - turning)
    return integrate(motion, Rates(pace, sliding, turning), steering, dt)
