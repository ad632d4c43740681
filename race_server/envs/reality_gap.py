"""The gap between simulation and reality, as draws that differ from episode to episode.

This is the only declaration of its factors: names, units, nominal values, limits. Settings of
training, settings of time trials and `docs/observations.md` follow from it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, get_args, get_type_hints

import numpy as np

from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import GAP_STREAM, uniform
from race_server.core.state import Floats, Record
from race_server.envs.actions import LAG_DRIVE, LAG_STEERING, PLAYED
from race_server.errors import ScenarioError

MOST_DELAY = 8  # decisions
LEAST_SHARE, MOST_SHARE = 0.05, 20.0  # of what a vehicle's figure is without a gap
MOST_LAG = 60.0  # [s]
MOST_PLAY = 2.0  # from one stop to the other

Range = tuple[float, float]  # low and high; a point means fixed


@dataclass(frozen=True)
class Factor:
    """One thing that differs between the simulated kart and a real one."""

    unit: str
    meaning: str
    least: float = 0.0
    most: float = 1.0
    is_whole: bool = False


def _delay(meaning: str) -> Factor:
    return Factor("decisions", f"{meaning}, a whole number", most=MOST_DELAY, is_whole=True)


def _share(meaning: str) -> Factor:
    return Factor("-", meaning, least=LEAST_SHARE, most=MOST_SHARE)


@dataclass(frozen=True)
class RealityGap:
    """Ranges from which each learning kart draws for every episode.

    Noise and drop-outs belong to the lidar: see `race_server.scenario.sensors`.
    """

    action_delay: Annotated[Range, _delay("from an action to its effect")] = (0.0, 0.0)
    observation_delay: Annotated[Range, _delay("age of what is seen")] = (0.0, 0.0)
    actuator_lag: Annotated[
        Range, Factor("s", "time constant of pedals and wheel", most=MOST_LAG)
    ] = (0.0, 0.0)
    steering_play: Annotated[
        Range, Factor("-", "how far the steering, -1 to 1, moves without effect", most=MOST_PLAY)
    ] = (0.0, 0.0)
    speed_coefficient: Annotated[
        Range, _share("factor of top speed, motor force and power: the battery")
    ] = (1.0, 1.0)
    mass: Annotated[Range, _share("factor of the vehicle's mass and inertia")] = (1.0, 1.0)
    grip: Annotated[Range, _share("factor of the vehicle's grip")] = (1.0, 1.0)
    stiffness: Annotated[
        Range, _share("factor of the tyres' cornering stiffness: above 5 they hardly slip")
    ] = (1.0, 1.0)
    hitch: Annotated[
        Range, _share("factor of the distance from the vehicle's rear axle to its hitch")
    ] = (1.0, 1.0)

    def changed(self) -> dict[str, Range]:
        """Return the factors that are not nominal, by name."""
        nominal = RealityGap()
        return {
            name: getattr(self, name)
            for name in FACTORS
            if getattr(self, name) != getattr(nominal, name)
        }

    def ranges(self) -> Floats:
        """Return low and high of every factor, shape (G, 2), those of delays as whole numbers.

        Raises:
            ScenarioError: a range is none, upside down, out of bounds, or one of a delay holds no
                whole number.
        """
        rows = np.array([_low_and_high(name, getattr(self, name)) for name in FACTORS])
        for row, (name, factor) in zip(rows, FACTORS.items(), strict=True):
            low, high = row
            if not factor.least <= low <= high <= factor.most:
                raise ScenarioError(
                    f"reality gap {name} from {low:g} to {high:g}: choose low to high "
                    f"between {factor.least:g} and {factor.most:g}"
                )
            if factor.is_whole:
                row[:] = np.ceil(low), np.floor(high)
            if row[0] > row[1]:
                raise ScenarioError(
                    f"reality gap {name} from {low:g} to {high:g}: no whole number lies between "
                    "them; choose whole numbers"
                )
        return rows


def _low_and_high(name: str, given: object) -> Floats:
    """Return the range of a factor, shape (2,).

    Raises:
        ScenarioError: it is not two numbers.
    """
    try:
        pair = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        pair = np.zeros(0)
    if pair.shape != (2,):
        raise ScenarioError(
            f"reality gap {name} = {given!r}: give two numbers, low and high, the same twice where "
            "it is fixed"
        )
    return pair


# The order is that of the numbers below, and whole numbers come first.
FACTORS: Mapping[str, Factor] = MappingProxyType(
    {
        name: get_args(hint)[1]
        for name, hint in get_type_hints(RealityGap, include_extras=True).items()
    }
)
ACTION_DELAY, OBSERVATION_DELAY, LAG, PLAY, SPEED, MASS, GRIP, STIFFNESS, HITCH = range(9)


@kernel
def draw_gap(
    seed: int, episode: int, kart: int, ranges: Floats, draws: Floats, vehicle: Record
) -> None:
    """Draw one kart's gap into `draws`, and change its vehicle, which is the nominal one.

    seed: of the world; ranges: (G, 2), see `RealityGap.ranges`; draws: (G,).
    """
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
    vehicle.cornering *= draws[STIFFNESS]
    vehicle.trailers[0].hitch *= draws[HITCH]


@kernel
def apply_lag_and_backlash(draws: Floats, memory: Floats, step_s: float, control: Floats) -> None:
    """Damp and loosen what was commanded, by the lag and the play that were drawn.

    draws: (G,); memory: (MEMORY,), see `envs/actions.py`; step_s: time between decisions [s];
    control: (4,) steering, throttle, brake, buttons.
    """
    if draws[LAG] > 0.0:
        share = 1.0 - math.exp(-step_s / draws[LAG])
        drive = control[1] - control[2]
        memory[LAG_DRIVE] += share * (drive - memory[LAG_DRIVE])
        memory[LAG_STEERING] += share * (control[0] - memory[LAG_STEERING])
        control[0] = memory[LAG_STEERING]
        if control[2] > 0.0 or control[1] >= 0.0:
            control[1] = max(memory[LAG_DRIVE], 0.0)
            control[2] = max(-memory[LAG_DRIVE], 0.0)
        else:
            control[1] = memory[LAG_DRIVE]  # a pedal backwards, which may still push ahead
    if draws[PLAY] > 0.0:
        # The wheels follow only once the play on this side is used up.
        half = 0.5 * draws[PLAY]
        memory[PLAYED] = min(max(memory[PLAYED], control[0] - half), control[0] + half)
        control[0] = memory[PLAYED]
