"""Motion of a kart: a single-track model with saturating tyres, kinematic at low speed."""

import math

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
    # Divisions are dear: only what is needed is divided, and by constants nothing is.
    if stiffness * abs(slip) >= 3.0 * limit:
        return limit / abs(slip)
    slide = stiffness * abs(slip) / (3.0 * limit)
    return stiffness * (1.0 - slide + slide * slide * (1.0 / 3.0))


@kernel
def motor_force(vehicle: Record, speed: float, throttle: float, cap: float, thrust: float) -> float:
    """Return the force [N] of the motor at the wheels, negative in reverse.

    throttle: [-1, 1]; cap: speed allowed by flags and effects [m/s], which may lie above the top
    speed while a boost lasts; thrust: scale of force and power.
    """
    ahead = throttle >= 0.0
    allowed = cap if ahead else min(vehicle.reverse_speed, cap)
    rate = speed if ahead else -speed
    force = vehicle.motor_force * thrust
    if force * rate > vehicle.motor_power * thrust:
        force = vehicle.motor_power * thrust / rate
    left, soft = allowed - rate, max(FADE * allowed, CREEP)
    if left < soft:
        force *= max(left, 0.0) / soft
    return throttle * force


@kernel
def resistance(
    vehicle: Record, speed: float, brake: float, cap: float, roll: float, rate: float
) -> float:
    """Return the force [N] of brakes, cap and rolling against the motion, for both axles.

    It never does more than stop the kart within a step, of which there are `rate` a second.
    roll: rolling resistance of the surface, on top of the vehicle's own, as a share of the weight.
    """
    force = brake * vehicle.brake_force
    over = abs(speed) - cap
    if over > 0.0:
        force = max(force, min(CAP_BRAKE * vehicle.brake_force, vehicle.mass * over * CAP_RATE))
    force += (vehicle.rolling + roll) * vehicle.mass * GRAVITY
    return min(force, vehicle.mass * abs(speed) * rate)


@kernel
def move(
    vehicle: Record,
    x: float,
    y: float,
    heading: float,
    speed: float,
    lateral_speed: float,
    yaw_rate: float,
    steering: float,
    steering_command: float,
    throttle: float,
    brake: float,
    cap: float,
    thrust: float,
    grip: float,
    roll: float,
    dt: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Return x, y, heading, speed, lateral speed, yaw rate and steering after `dt` [s].

    Forces follow from the state at the start; lateral speed and yaw rate are then solved
    implicitly with the tyres' secant stiffness, which is stable at every speed and step. Slower
    than `kinematic_below` the wheels roll without slip; in between the two are blended.
    grip: scale of the friction; the heading is not wrapped.
    """
    # Steering moves at a limited rate towards what was asked for.
    target = steering_command * vehicle.steering_limit
    turn = vehicle.steering_rate * dt
    steering += clip(target - steering, -turn, turn)
    cos, sin = cos_sin(steering)
    a, b = vehicle.front_axle, vehicle.rear_axle
    rate, per_mass, per_length = 1.0 / dt, 1.0 / vehicle.mass, 1.0 / (a + b)
    # The axles' share of the weight [N].
    front_load = vehicle.mass * GRAVITY * b * per_length
    rear_load = vehicle.mass * GRAVITY * a * per_length

    # Longitudinal forces, each axle within its grip.
    friction = vehicle.grip * grip
    front_grip, rear_grip = friction * front_load, friction * rear_load
    drive = motor_force(vehicle, speed, throttle, cap, thrust)
    drag = sign(speed) * resistance(vehicle, speed, brake, cap, roll, rate)
    front = drive * vehicle.front_drive - drag * vehicle.front_brake
    rear = drive * (1.0 - vehicle.front_drive) - drag * (1.0 - vehicle.front_brake)
    front = clip(front, -front_grip, front_grip)
    rear = clip(rear, -rear_grip, rear_grip)
    air = vehicle.drag * speed * abs(speed)

    # Without slip: the rear axle moves along the body.
    pace = speed + dt * (front + rear - air) * per_mass
    turning = pace * sin / cos * per_length
    sliding = b * turning

    if abs(speed) > vehicle.kinematic_below:
        blend = 1.0
        if abs(speed) < vehicle.dynamic_above:
            blend = (abs(speed) - vehicle.kinematic_below) / (
                vehicle.dynamic_above - vehicle.kinematic_below
            )
        # Slip at both wheels; the axle's longitudinal force takes its part of the grip first.
        across = lateral_speed + a * yaw_rate
        per_front = 1.0 / max(abs(speed * cos + across * sin), CREEP)
        front_slip = (across * cos - speed * sin) * per_front
        per_rear = 1.0 / max(abs(speed), CREEP)
        rear_slip = (lateral_speed - b * yaw_rate) * per_rear
        front_limit = math.sqrt(front_grip * front_grip - front * front)
        rear_limit = math.sqrt(rear_grip * rear_grip - rear * rear)
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
        slip_pace = speed + dt * (ahead * per_mass + slip_speed * slip_rate)

        pace += blend * (slip_pace - pace)
        sliding += blend * (slip_speed - sliding)
        turning += blend * (slip_rate - turning)

    middle = heading + 0.5 * dt * turning
    cos, sin = cos_sin(middle)
    x += dt * (pace * cos - sliding * sin)
    y += dt * (pace * sin + sliding * cos)
    return x, y, heading + dt * turning, pace, sliding, turning, steering
