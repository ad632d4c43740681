"""Actions: what a policy's numbers mean for pedals, wheel and button."""

import math
from typing import NamedTuple

import numpy as np

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import Float32s, Floats, Record
from race_server.core.vehicles import GRAVITY
from race_server.errors import ScenarioError

CONTINUOUS, RISING, DISCRETE, CONTROL, RESIDUAL, INCREMENTS, PEDAL, MOTOR, BRAKED = range(9)
PACED, CRAWLED = 9, 10
ACTIONS = {
    "continuous": CONTINUOUS,
    "report_b": RISING,
    "increments": INCREMENTS,
    "discrete": DISCRETE,
    "control": CONTROL,
    "residual": RESIDUAL,
    "park": PEDAL,
    "report_a_1": MOTOR,
    "report_a": BRAKED,
    "dock": PACED,
    "crawl": CRAWLED,
}
# Numbers of an action, by kind.
WIDTHS = {
    CONTINUOUS: 3,
    RISING: 2,
    DISCRETE: 1,
    CONTROL: 4,
    RESIDUAL: 6,
    INCREMENTS: 2,
    PEDAL: 2,
    MOTOR: 2,
    BRAKED: 3,
    PACED: 2,
    CRAWLED: 2,
}

# Report of the 1/10 race: an action of 1 adds 0.5 m/s, or 9° at the wheels, to what is set; the
# speed that is set is at least 0.1 m/s, so that a policy cannot stall. It prints 0 to 1 for the
# speed, which then only rises; but its cars slow down, so that `increments` go down to -1.
SPEED_STEP = 0.5
STEERING_STEP = math.radians(9.0)
SLOWEST = 0.1

# Below this speed [m/s] a kart that brakes goes into reverse.
REVERSE_BELOW = 0.1

# A vehicle that is told a speed drives at least so fast [m/s]: between ahead and back it would stay
# where both are as good. Gain of the error of its speed [1/s].
LEAST_SPEED, SPEED_GAIN = 0.1, 4.0

# Places in the memory that an action has from one decision to the next.
SET_SPEED, SET_STEERING, LAG_DRIVE, LAG_STEERING, PLAYED, MEMORY = range(6)


def action_kind(name: str) -> int:
    """Return the number of a kind of action.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in ACTIONS:
        raise ScenarioError(f"action {name!r} is unknown; choose one of {', '.join(ACTIONS)}")
    return ACTIONS[name]


def discrete_table() -> Floats:
    """Return what each discrete action does, shape (15, 3): drive, steering, item.

    Three pedals (brake, roll, drive) by five angles; while a kart drives straight ahead it also
    uses its item.
    """
    rows = [
        (drive, steering, 1.0 if drive > 0.0 and steering == 0.0 else 0.0)
        for drive in (-1.0, 0.0, 1.0)
        for steering in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    return np.array(rows)


class Driven(NamedTuple):
    """What the meaning of an action depends on, of the kart that takes it."""

    speed: float  # [m/s]
    buttons_before: int  # bits of Button
    rescue_offered: int  # 0 or 1


@kernel
def read_action(
    kind: int,
    action: Float32s,
    table: Floats,
    kart: Driven,
    vehicle: Record,
    memory: Floats,
    control: Floats,
) -> None:
    """Fill `control`, (4,) steering, throttle, brake, buttons, from one kart's action, (A,).

    kind: see ACTIONS; table: (N, 3), see `discrete_table`; memory: (MEMORY,) of this kart. A
    residual action was advice to a scripted driver, whose answer is in `control` already.
    """
    if kind == RESIDUAL:
        return
    if kind in (RISING, INCREMENTS):
        _add_increments(action, 0.0 if kind == RISING else -1.0, kart, vehicle, memory, control)
        return
    if kind == CONTROL:
        for index in range(4):
            control[index] = float(action[index])
        return
    if kind in (PEDAL, MOTOR, BRAKED):
        _drive_in_lot(kind, action, kart, control)
        return
    if kind in (PACED, CRAWLED):
        _keep_pace(kind, action, kart, vehicle, control)
        return
    drive, steering, item = 0.0, 0.0, 0.0
    if kind == CONTINUOUS:
        drive, steering, item = float(action[0]), float(action[1]), float(action[2])
    else:
        row = min(max(int(action[0]), 0), len(table) - 1)
        drive, steering, item = table[row, 0], table[row, 1], table[row, 2]
    control[0] = steering
    _press(drive, kart, control)
    # The button acts when it goes down; to hold it is to press it again and again.
    held = kart.buttons_before & codes.USE_ITEM
    buttons = codes.USE_ITEM if item > 0.5 and held == 0 else 0
    # No number says so; a kart that is stuck wants to be put back on the line.
    if kart.rescue_offered:
        buttons |= codes.ACCEPT_RESCUE
    control[3] = buttons


@kernel
def _drive_in_lot(kind: int, action: Float32s, kart: Driven, control: Floats) -> None:
    """Fill `control`, (4,), from pedals and steering, (A,), without a button.

    With one pedal a vehicle brakes before it turns round; with a motor, it only pushes.
    """
    control[0] = float(action[1])
    control[1], control[2] = float(action[0]), 0.0
    control[3] = 0.0
    if kind == PEDAL:
        _press(float(action[0]), kart, control)
    elif kind == BRAKED:
        control[2] = max(float(action[2]), 0.0)


@kernel
def _keep_pace(kind: int, action: Float32s, kart: Driven, vehicle: Record, control: Floats) -> None:
    """Fill `control`, (4,), from a wanted speed, as a share of the most, and steering: (2,).

    A vehicle that crawls is told the root of that share, and stands where it is told less than the
    least speed.
    """
    share = min(max(float(action[0]), -1.0), 1.0)
    way = 1.0 if share >= 0.0 else -1.0
    most = vehicle.top_speed if way > 0.0 else vehicle.reverse_speed
    control[0], control[3] = float(action[1]), 0.0
    wanted = way * abs(share) * most
    if kind == CRAWLED:
        wanted *= abs(share)
        if abs(wanted) < LEAST_SPEED:
            control[1], control[2] = 0.0, 1.0
            return
    elif abs(wanted) < LEAST_SPEED:
        wanted = way * LEAST_SPEED
    rate = SPEED_GAIN * (wanted - kart.speed) + way * vehicle.rolling * GRAVITY
    force = vehicle.mass * rate
    brakes = force * kart.speed < 0.0 and abs(kart.speed) > REVERSE_BELOW
    control[1] = 0.0 if brakes else min(max(force / vehicle.motor_force, -1.0), 1.0)
    control[2] = min(abs(force) / vehicle.brake_force, 1.0) if brakes else 0.0


@kernel
def _press(drive: float, kart: Driven, control: Floats) -> None:
    """Fill throttle and brake from `drive`, -1 to 1: below zero brake, or reverse from a stand."""
    if drive < 0.0 and kart.speed > REVERSE_BELOW:
        control[1] = 0.0
        control[2] = -drive
    else:
        control[1] = drive
        control[2] = 0.0


@kernel
def _add_increments(
    action: Float32s, least: float, kart: Driven, vehicle: Record, memory: Floats, control: Floats
) -> None:
    """Fill `control`, (4,), from increments, (2,), of a set speed and a set angle of the wheels.

    least: lower limit of the increment of speed. What is set stays in `memory`: [m/s] and [rad].
    """
    speed = memory[SET_SPEED] + SPEED_STEP * min(max(float(action[0]), least), 1.0)
    memory[SET_SPEED] = min(max(speed, SLOWEST), vehicle.top_speed)
    limit = vehicle.steering_limit
    steering = memory[SET_STEERING] + STEERING_STEP * min(max(float(action[1]), -1.0), 1.0)
    memory[SET_STEERING] = min(max(steering, -limit), limit)
    control[0] = memory[SET_STEERING] / limit
    error = 2.0 * (memory[SET_SPEED] - kart.speed)
    control[1] = min(max(error, 0.0), 1.0)
    control[2] = min(max(-0.5 * error, 0.0), 1.0)
    control[3] = 0.0
