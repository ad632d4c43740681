"""How to stay on the reference line and at its speeds; drivers decide where beside it.

Steering: feed-forward from the line's curvature with the slip that both axles need for it, feedback
on the offset and on the heading that the body should have in that bend (Kapania and Gerdes,
Design of a feedback-feedforward steering controller for accurate path tracking and stability at the
limits of handling, 2015).
"""

import math

from race_agents.planning.latency import STEERING, take_up_play
from race_agents.planning.tactics import SPEED
from race_agents.planning.traffic import is_alone
from race_agents.planning.tyre_slip import (
    GRIP_SCALE,
    LATERAL_SPEED,
    YAW_RATE,
    grip_of,
    rear_effort,
    slide_of,
    slip_share,
    slips_in,
)
from race_server.core.kernel_driver import ATTEMPTS, DECISION, Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, BRAKE_SHARE, PART_NUMBERS
from race_server.core.state import Floats, Record
from race_server.core.vehicles import GRAVITY

OFFSET = PART_NUMBERS["line_offset"]
HEADING = PART_NUMBERS["line_heading"]
STEP = PART_NUMBERS["line_step"]
CURVATURE = PART_NUMBERS["line_curvature_ahead"]
LINE_SPEED = PART_NUMBERS["line_speed_ahead"]
LINE_HELD = PART_NUMBERS["line_speed_held"]
SPEED_CAP = PART_NUMBERS["speed_cap"]
THRUST_SCALE = PART_NUMBERS["thrust_scale"]

# Shares of the line's speed: on the straight, and where it takes all the grip for the bend. A line
# of minimum time knows what slip costs, but leaves no grip to correct an error with.
STRAIGHT_SHARE = 0.99
BEND_SHARE = 0.98
# The same on tyres so stiff that the wheels turn through all their slip within one decision: they
# slide at once, and without a warning.
STIFF_BEND_SHARE = 0.95
# A vehicle that goes farther than this [own lengths] while its body begins to turn is given so much
# less of the bend's speed for each length more: what it does wrong it notices late, and the rear
# axle slides before it is corrected.
PROMPT, LATE_SHARE = 0.5, 0.0145
# Share of the grip that brakes have where the line does not brake yet, or a dash exceeds it.
DASH_BRAKE_SHARE = 0.55
# Share of the rear tyres' grip beyond which neither motor nor brakes may go: a rear axle that
# slides turns the kart round, a front axle only makes its bend wider.
REAR_SHARE = 0.95
# The wheels follow the line as far ahead as the body takes to turn; on stiff tyres so much farther
# [s]. Else more would cut the inside of the next bend where the line turns from one side to the
# other: 0.02 s are 3 cm at 4 m/s.
STIFF_LEAD_S = 0.04
# Errors are predicted this far ahead [s]: half a decision, and this share of the time to turn.
DELAY_S, DELAY_SHARE = 0.05, 0.1
# Feedback: natural frequency [rad/s] of the offset, and on stiff tyres, which pass each correction
# on at once; damping ratio; damping of the yaw rate.
FREQUENCY, STIFF_FREQUENCY, DAMPING, YAW_DAMPING = 10.0, 6.5, 0.9, 0.6
# What is added at least to the damping of the yaw rate [1/s].
YAW_RATE_DAMPING = 8.0
# An offset is never closed at a steeper angle, of this sine, nor faster than what this share of the
# grip brings to rest on the line. Each attempt to get free adds to the sine, up to a bound: a kart
# that stands at a wall between it and the line comes past its end so. Not where others are within
# this number of lengths: in a jam it would cut across them.
STEEPEST, JOINING = 0.35, 0.4
STEEPER, STEEPEST_OF_ALL, JAM_LENGTHS = 0.3, 0.95, 5.0
# Square of the share of the grip that brakes have in any bend.
LEAST_BRAKES = 0.05
# Share of the slip at which a tyre slides altogether that the front wheels may have.
SLIP_SHARE = 0.9
# No kart is thought to be slower than this [m/s]: where it stands, any steering will do.
SLOWEST = 0.3
# Gain [1/s] of the speed error.
SPEED_GAIN = 20.0


@kernel
def at_distance(observation: Floats, start: int, place: float) -> float:
    """Return a part of the observation that begins at `start`, `place` line steps ahead."""
    place = min(max(place, 0.0), AHEAD - 1.001)
    index = int(place)
    share = place - index
    return observation[start + index] * (1.0 - share) + observation[start + index + 1] * share


@large_kernel
def speed_on_line(cockpit: Cockpit, shift: float, distance: float, dash: float) -> float:
    """Return the speed [m/s] to have a distance [m] ahead, `shift` [m] to the left of the line.

    The line brakes into bends with all tyres at their limit, and a kart that does so cannot be
    steered: BRAKE_SHARE of its braking is planned with, beyond the last sample by
    `line_speed_held`. Less grip means that all accelerations of the line, and so the squares of
    its speeds, shrink.
    dash: share by which its speed is exceeded where no bend needs the grip, and the brakes can undo
    it before the next one.
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    grip, bend_share = vehicle.grip * GRAVITY, BEND_SHARE
    if is_stiff(vehicle):
        bend_share = STIFF_BEND_SHARE
    turning = turning_time(vehicle, 1.0) / vehicle.length
    place = distance / max(observation[offsets[STEP]], 0.01)
    square = math.inf
    if offsets[LINE_HELD] >= 0:
        square = (STRAIGHT_SHARE * observation[offsets[LINE_HELD]]) ** 2
    brakes = 2.0 * DASH_BRAKE_SHARE / BRAKE_SHARE * grip * observation[offsets[STEP]]
    unused = 0.0
    for back in range(AHEAD):
        index = AHEAD - 1 - back
        speed = observation[offsets[LINE_SPEED] + index]
        bend = observation[offsets[CURVATURE] + index]
        following = square
        if back > 0:
            later = observation[offsets[LINE_SPEED] + index + 1]
            square += BRAKE_SHARE * max(speed * speed - later * later, brakes * unused)
        used = min(speed * speed * abs(bend) / grip, 1.0)
        unused = 1.0 - used
        late = LATE_SHARE * max(speed * speed * turning - PROMPT, 0.0)
        share = STRAIGHT_SHARE + (bend_share - late - STRAIGHT_SHARE) * used + dash * unused
        # Nearer to the middle of a bend it is tighter.
        tighter = min(max(1.0 - shift * bend, 0.3), 1.0)
        square = min(square, share * share * speed * speed * tighter)
        if index <= place:
            if back > 0:
                square += (place - index) * (following - square)
            break
    return min(
        math.sqrt(square * min(observation[offsets[GRIP_SCALE]], 1.0)),
        observation[offsets[SPEED_CAP]],
    )


@kernel
def acceleration_on_line(cockpit: Cockpit, shift: float, faster: float, dash: float) -> float:
    """Return the acceleration [m/s²] that brings the kart to the line's speeds.

    shift: of the kart's lane to the left of the line [m]; faster: share by which they are exceeded,
    within what flags and effects allow; dash: the same where no bend forbids it.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    speed, step = max(observation[offsets[SPEED]], SLOWEST), setup[DECISION]
    now = speed_on_line(cockpit, shift, 0.0, dash)
    soon = speed_on_line(cockpit, shift, speed * step, dash)
    now = min((1.0 + faster) * now, observation[offsets[SPEED_CAP]])
    soon = min((1.0 + faster) * soon, observation[offsets[SPEED_CAP]])
    # A kart off the line or across it has less room than the line assumes.
    off = abs(observation[offsets[OFFSET]] - shift) / vehicle.width
    across = abs(observation[offsets[HEADING]])
    doubt = 1.0 - 0.25 * min(max(off - 0.6, 0.0), 1.0) - 0.5 * min(max(across - 0.5, 0.0), 1.0)
    return (soon - now) / step + SPEED_GAIN * (doubt * now - observation[offsets[SPEED]])


@large_kernel
def press_for(cockpit: Cockpit, acceleration: float) -> float:
    """Set throttle and brake for an acceleration [m/s²]; return the force [N] they give."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, control = cockpit.vehicle, cockpit.control
    speed = max(observation[offsets[SPEED]], SLOWEST)
    wanted = acceleration + GRAVITY * vehicle.rolling + vehicle.drag * speed * speed / vehicle.mass
    if speed > vehicle.dynamic_above:
        grip = grip_of(cockpit)
        bend = max(abs(observation[offsets[CURVATURE]]), abs(observation[offsets[CURVATURE] + 1]))
        planned = speed * speed * bend / grip
        turning = max(planned, abs(speed * observation[offsets[YAW_RATE]]) / grip)
        wanted = min(wanted, rear_limit(vehicle, vehicle.front_drive, turning) * grip)
        wanted = max(wanted, -rear_limit(vehicle, vehicle.front_brake, planned) * grip)
        # Off the line, too, the bend comes first: what brakes harder runs wide, and a motor that
        # pulls on a rear axle which slides keeps it sliding.
        wanted = max(wanted, -math.sqrt(max(1.0 - planned * planned, LEAST_BRAKES)) * grip)
        holding = rear_effort(cockpit, speed)
        wanted = min(wanted, math.sqrt(max(1.0 - holding * holding, 0.0)) * grip)
    most = min(vehicle.motor_force, vehicle.motor_power / speed) * max(
        observation[offsets[THRUST_SCALE]], 0.05
    )
    force = min(max(vehicle.mass * wanted, -vehicle.brake_force), most)
    control[1] = max(force / most, 0.0)
    control[2] = max(-force / vehicle.brake_force, 0.0)
    return force


@kernel
def rear_limit(vehicle: Record, front_force: float, turning: float) -> float:
    """Return the most acceleration along, as a share of the grip, that leaves the rear its hold.

    front_force: share of the force on the front axle; turning: share of the grip in use across.
    """
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    rear_load = vehicle.front_axle / wheelbase
    if 1.0 - front_force < 1.02 * rear_load:
        return math.inf  # the front slides first
    room = math.sqrt(max(REAR_SHARE * REAR_SHARE - turning * turning, 0.01))
    return room * rear_load / (1.0 - front_force)


@kernel
def spare_rear(vehicle: Record, grip: float, turning: float, control: Floats) -> None:
    """Press the pedals no further than the rear tyres hold: a kart that slides there turns round.

    grip: [m/s²]; turning: the share of it in use across.
    """
    force = vehicle.mass * max(grip, 0.1)
    drive = force * rear_limit(vehicle, vehicle.front_drive, turning)
    brake = force * rear_limit(vehicle, vehicle.front_brake, turning)
    control[1] = min(control[1], drive / vehicle.motor_force)
    control[2] = min(control[2], brake / vehicle.brake_force)


@large_kernel
def steering_on_line(cockpit: Cockpit, shift: float, force: float) -> float:
    """Return the steering, a share of full, that holds the kart `shift` [m] left of the line.

    force: [N] of motor or brakes, which takes its part of the grip first.
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    speed = max(observation[offsets[SPEED]], SLOWEST)
    front_axle, rear_axle = vehicle.front_axle, vehicle.rear_axle
    wheelbase = front_axle + rear_axle
    slide = slide_of(vehicle, grip_of(cockpit))
    step = max(observation[offsets[STEP]], 0.01)
    # A body on wheels that never slip turns with them: there is no lag, and nothing to damp.
    slipping = slip_share(cockpit.memory)
    turn_s = slipping * turning_time(vehicle, speed)
    delay = DELAY_S * (0.5 + 0.5 * slipping) + DELAY_SHARE * turn_s
    soft = 0.0 if is_stiff(vehicle) else slipping
    frequency = STIFF_FREQUENCY + soft * (FREQUENCY - STIFF_FREQUENCY)
    lead = speed * (STIFF_LEAD_S * (1.0 - soft) + turn_s) / step
    bend = at_distance(observation, offsets[CURVATURE], lead)
    bend /= max(1.0 - shift * bend, 0.3)

    front_slip, rear_slip = slips_in(cockpit, speed, bend, force)

    # Errors once this decision acts. In a bend the body points inside by the rear axle's slip.
    turning = excess_yaw_rate(cockpit, speed, delay)
    heading = observation[offsets[HEADING]]
    drift = math.sin(heading + math.atan2(observation[offsets[LATERAL_SPEED]], speed))
    offset = observation[offsets[OFFSET]] - shift + speed * delay * drift
    heading += delay * turning + rear_axle * bend - rear_slip
    look = 2.0 * DAMPING * speed / frequency
    gain = frequency * frequency * wheelbase / max(speed * speed, 4.0)
    closing = math.sqrt(2.0 * JOINING * grip_of(cockpit) * abs(offset))  # [m/s] across the line
    steepest = STEEPEST
    if cockpit.memory[ATTEMPTS] > 0.0 and is_alone(cockpit, JAM_LENGTHS):
        steepest = min(STEEPEST + STEEPER * cockpit.memory[ATTEMPTS], STEEPEST_OF_ALL)
    most = look * min(steepest, closing / speed)
    offset = min(max(offset, -most), most)
    angle = math.atan(wheelbase * bend) + front_slip - rear_slip
    angle -= gain * (offset + look * math.sin(heading))
    angle -= slipping * yaw_damping(vehicle, speed) * turning
    if speed > vehicle.dynamic_above:
        # Turned further than it slips at most, a front wheel only brakes. Stiff tyres hardly slip,
        # but the kart follows them at once.
        way = math.atan2(
            observation[offsets[LATERAL_SPEED]] + front_axle * observation[offsets[YAW_RATE]], speed
        )
        most = max(SLIP_SHARE * slide, vehicle.steering_rate * DELAY_S)
        angle = min(max(angle, way - most), way + most)
    angle = take_up_play(cockpit.memory, angle, observation[offsets[STEERING]])
    return min(max(angle / vehicle.steering_limit, -1.0), 1.0)


@kernel
def excess_yaw_rate(cockpit: Cockpit, speed: float, delay: float) -> float:
    """Return the yaw rate [rad/s] that a kart has more than the line's bend asks a delay [s] on."""
    observation, offsets = cockpit.observation, cockpit.offsets
    place = speed * delay / max(observation[offsets[STEP]], 0.01)
    bend = at_distance(observation, offsets[CURVATURE], place)
    return observation[offsets[YAW_RATE]] - speed * bend


@kernel
def yaw_damping(vehicle: Record, speed: float) -> float:
    """Return the steering [rad] against each [rad/s] of yaw rate too much.

    What damps the yaw rate by itself falls with the speed: at least YAW_RATE_DAMPING is added.
    """
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    front = vehicle.cornering * vehicle.mass * GRAVITY * vehicle.rear_axle / wheelbase  # [N/rad]
    least = YAW_RATE_DAMPING * vehicle.yaw_inertia / (front * vehicle.front_axle)
    return max(YAW_DAMPING * wheelbase / speed, least)


@kernel
def is_stiff(vehicle: Record) -> bool:
    """Return whether the wheels turn through all the slip of their tyres within one decision."""
    return bool(3.0 * vehicle.grip / vehicle.cornering < vehicle.steering_rate * DELAY_S)


@kernel
def turning_time(vehicle: Record, speed: float) -> float:
    """Return the time constant [s] of the yaw rate behind the steering, on tyres that hold."""
    stiffness = vehicle.cornering * vehicle.mass * GRAVITY  # [N/rad]
    return speed * vehicle.yaw_inertia / (stiffness * vehicle.front_axle * vehicle.rear_axle)
