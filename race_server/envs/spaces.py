"""Spaces: what a learning kart may see and do, in the terms of Gymnasium."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from race_server.core.observation import Layout
from race_server.core.state import Bytes
from race_server.envs.actions import (
    BRAKED,
    CONTINUOUS,
    CONTROL,
    CRAWLED,
    INCREMENTS,
    MOTOR,
    PACED,
    PEDAL,
    RESIDUAL,
    RISING,
    action_kind,
    discrete_table,
)
from race_server.errors import ScenarioError

# The discrete action that presses nothing and steers nowhere: a row of `discrete_table`.
ROLL = 7


def observation_space(layout: Layout) -> spaces.Box:
    """Return the space of an observation: its parts in SI units, one behind the other."""
    return spaces.Box(layout.lows(), layout.highs(), dtype=np.float32)


def action_space(action: str) -> spaces.Space[Any]:
    """Return the space of a kind of action, see `envs/actions.py`.

    continuous: drive [-1, 1] (brake below zero), steering [-1, 1] (left positive), item above
    0.5. report_b: increments of speed [0, 1] and steering [-1, 1]. increments: the same, of speed
    [-1, 1] too. discrete: 3 pedals by 5 angles.
    control: what a driver sends, steering [-1, 1], throttle [-1, 1], brake [0, 1], buttons 0 to 3.
    residual: advice to a scripted driver, each [-1, 1]: aside (left positive), faster, item, and,
    above zero alone, faster where no bend forbids it, closer to the kart ahead, fetch a box.
    park: one pedal [-1, 1] (ahead, or back; it brakes first) and steering [-1, 1]. report_a_1:
    motor [-1, 1] and steering [-1, 1]; report_a: a brake [0, 1] besides.
    dock: speed [-1, 1], a share of the most ahead or back, never quite none, and steering [-1, 1].
    crawl: the same, but the root of that share, and none near zero: the vehicle stands.
    """
    kind = action_kind(action)
    if kind == RESIDUAL:
        return spaces.Box(-np.ones(6, np.float32), np.ones(6, np.float32))
    if kind == CONTINUOUS:
        return spaces.Box(np.array([-1, -1, 0], np.float32), np.ones(3, np.float32))
    if kind in (RISING, INCREMENTS):
        lows = np.array([0 if kind == RISING else -1, -1], np.float32)
        return spaces.Box(lows, np.ones(2, np.float32))
    if kind in (PEDAL, MOTOR, PACED, CRAWLED):
        return spaces.Box(-np.ones(2, np.float32), np.ones(2, np.float32))
    if kind == BRAKED:
        return spaces.Box(np.array([-1, -1, 0], np.float32), np.ones(3, np.float32))
    if kind == CONTROL:
        highs = np.array([1, 1, 1, 3], np.float32)
        return spaces.Box(np.array([-1, -1, 0, 0], np.float32), highs)
    return spaces.Discrete(len(discrete_table()))


def masks_for(space: spaces.Space[Any], idle: Bytes) -> NDArray[np.bool_]:
    """Return which discrete actions count, shape (n, 15).

    idle: (n,), 1 for karts that wait for others, which only roll.

    Raises:
        ScenarioError: actions are continuous.
    """
    if not isinstance(space, spaces.Discrete):
        raise ScenarioError("continuous actions have no masks: choose action='discrete'")
    masks = np.ones((len(idle), int(space.n)), np.bool_)
    masks[idle > 0] = np.arange(int(space.n)) == ROLL
    return masks
