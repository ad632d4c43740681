"""The state of whole races as numbers: what a critic may know that no kart sees."""

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces

from race_server.core.state import Float32s, World

# One kart's part, in this order. In a car park the last three are its slot.
BODY_FIELDS = ("x", "y", "speed", "lateral_speed", "yaw_rate", "steering", "status")
RACER_FIELDS = ("distance", "lateral_offset", "laps", "rank")
PLAYER_FIELDS = ("held",)
SLOT_FIELDS = ("x", "y", "heading")
FIELDS = ("cos", "sin", *BODY_FIELDS, *RACER_FIELDS, *PLAYER_FIELDS)


def names_of(world: World) -> tuple[str, ...]:
    """Return the names of the numbers of a state, shape (S,): `tick`, then those of each kart."""
    slot = tuple(f"slot_{name}" for name in SLOT_FIELDS) if world.parking.parkers.size else ()
    karts = range(world.bodies.shape[1])
    return ("tick", *(f"kart_{k}.{name}" for k in karts for name in (*FIELDS, *slot)))


def state_space(world: World) -> spaces.Box:
    """Return the space of a state, shape (S,)."""
    size = len(names_of(world))
    return spaces.Box(-np.inf, np.inf, (size,), np.float32)


def global_states(world: World) -> Float32s:
    """Return the state of each race, shape (W, S), in SI units: see `names_of`."""
    bodies, parkers = world.bodies, world.parking.parkers
    columns = [np.cos(bodies["heading"]), np.sin(bodies["heading"])]
    tables = [(bodies, BODY_FIELDS), (world.racers, RACER_FIELDS), (world.players, PLAYER_FIELDS)]
    if parkers.size:
        tables.append((parkers, SLOT_FIELDS))
    columns += [records[name] for records, names in tables for name in names]
    karts = np.stack(columns, axis=-1).reshape(len(bodies), -1)
    ticks = world.races["tick"][:, None]
    return np.concatenate([ticks, karts], axis=1).astype(np.float32)


def own_states(world: World, karts: Sequence[int]) -> Float32s:
    """Return the states of all races as each of some karts has them, shape (W · karts, S).

    The numbers of the kart itself come first, then those of the others in their order.
    """
    states, count = global_states(world), world.bodies.shape[1]
    ticks, parts = states[:, :1], states[:, 1:].reshape(len(states), count, -1)
    orders = [[own, *(k for k in range(count) if k != own)] for own in karts]
    # (W, karts, K, numbers of a kart)
    seen = parts[:, orders].reshape(len(states) * len(karts), -1)
    return np.concatenate([np.repeat(ticks, len(karts), axis=0), seen], axis=1)
