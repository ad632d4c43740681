"""The gap between simulation and reality, as draws that differ from episode to episode."""

import math
from dataclasses import dataclass, fields

import numpy as np

from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import GAP_STREAM, uniform
from race_server.core.state import Floats, Record
from race_server.envs.actions import LAG_DRIVE, LAG_STEERING, PLAYED
from race_server.errors import ScenarioError

MOST_DELAY = 8  # decisions


@dataclass(frozen=True)
class RealityGap:
    """Ranges from which each learning kart draws anew for every episode; a point means fixed.

    Noise and drop-outs belong to the lidar: see `race_server.scenario.sensors`.
    """

    action_delay: tuple[float, float] = (0.0, 0.0)  # decisions, rounded
    observation_delay: tuple[float, float] = (0.0, 0.0)  # decisions, rounded
    actuator_lag: tuple[float, float] = (0.0, 0.0)  # [s] time constant of pedals and wheel
    steering_play: tuple[float, float] = (0.0, 0.0)  # share of the steering range that is lost
    speed_coefficient: tuple[float, float] = (1.0, 1.0)  # of top speed and motor: the battery
    mass: tuple[float, float] = (1.0, 1.0)  # share of the vehicle's
    grip: tuple[float, float] = (1.0, 1.0)  # share of the vehicle's

    def ranges(self) -> Floats:
        """Return low and high of every draw, shape (draws, 2), those of delays as whole numbers.

        Raises:
            ScenarioError: a range is upside down or out of bounds.
        """
        rows = np.array([getattr(self, name) for name in DRAWS], np.float64)
        for name, (low, high) in zip(DRAWS, rows, strict=True):
            least = 0.05 if name in {"speed_coefficient", "mass", "grip"} else 0.0
            most = MOST_DELAY if name.endswith("delay") else math.inf
            if not least <= low <= high <= most:
                raise ScenarioError(
                    f"reality gap {name} from {low:g} to {high:g}: choose low to high "
                    f"between {least:g} and {most:g}"
                )
        delays = slice(ACTION_DELAY, OBSERVATION_DELAY + 1)
        rows[delays] = np.rint(rows[delays])
        return rows


# The order is that of the numbers below.
DRAWS = tuple(field.name for field in fields(RealityGap))
ACTION_DELAY, OBSERVATION_DELAY, LAG, PLAY, SPEED, MASS, GRIP = range(7)


@kernel
def draw_gap(
    seed: int, episode: int, kart: int, ranges: Floats, draws: Floats, vehicle: Record
) -> None:
    """Draw one kart's gap and change its vehicle, which is the nominal one, accordingly."""
    for index in range(len(ranges)):
        chance = uniform(seed, GAP_STREAM, episode, kart * 16 + index)
        low, high = ranges[index, 0], ranges[index, 1]
        if index <= OBSERVATION_DELAY:
            # Every whole number of the range is as likely.
            draws[index] = math.floor(low + chance * (high - low + 1.0))
        else:
            draws[index] = low + chance * (high - low)
    vehicle.top_speed *= draws[SPEED]
    vehicle.motor_force *= draws[SPEED]
    vehicle.motor_power *= draws[SPEED]
    vehicle.mass *= draws[MASS]
    vehicle.yaw_inertia *= draws[MASS]
    vehicle.grip *= draws[GRIP]


@kernel
def apply_lag_and_backlash(draws: Floats, memory: Floats, step_s: float, control: Floats) -> None:
    """Let lag and play have their part of what was commanded."""
    if draws[LAG] > 0.0:
        share = 1.0 - math.exp(-step_s / draws[LAG])
        drive = control[1] - control[2]
        memory[LAG_DRIVE] += share * (drive - memory[LAG_DRIVE])
        memory[LAG_STEERING] += share * (control[0] - memory[LAG_STEERING])
        control[0] = memory[LAG_STEERING]
        if control[2] > 0.0 or control[1] >= 0.0:
            control[1] = max(memory[LAG_DRIVE], 0.0)
            control[2] = max(-memory[LAG_DRIVE], 0.0)
    if draws[PLAY] > 0.0:
        # The wheels follow only once the play on this side is used up.
        half = 0.5 * draws[PLAY]
        memory[PLAYED] = min(max(memory[PLAYED], control[0] - half), control[0] + half)
        control[0] = memory[PLAYED]
