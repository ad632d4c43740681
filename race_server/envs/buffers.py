"""The arrays that a batch of training worlds adds to the world itself.

Axis letters: W worlds, K karts, L learning karts (the first L of the K), S scenarios, T reward
terms, A numbers of an action, D delay.
"""

from typing import Any, NamedTuple

import numpy as np

from race_server.core.state import Bytes, Float32s, Floats, Ints, Records

# What happens once a learning kart's episode is over.
STAY, RESET_WORLD, REENTER = range(3)

SETTINGS = np.dtype(
    (
        np.record,
        [
            ("crash_range", np.float64),  # [m] a range below it is a crash; 0: walls alone decide
            ("decision_ticks", np.int64),
            ("action", np.int64),
            ("after", np.int64),  # STAY, RESET_WORLD or REENTER
            ("most_steps", np.int64),  # decisions of an episode; 0: no limit
            ("random_start", np.float64),  # share of the rounds
            ("random_grid", np.int64),
        ],
    )
)

# One learning kart's episode so far.
EPISODE = np.dtype(
    (
        np.record,
        [
            ("total", np.float64),  # sum of the rewards
            *(
                (name, np.int64)
                for name in (
                    "steps",
                    "laps",
                    "best_lap_us",
                    "last_lap_us",
                    "contacts",
                    "wall_contacts",
                    "crashes",
                    "status",
                    "rank",
                    "number",
                )
            ),
        ],
    )
)

# One world's round: from one reset to the next.
ROUND = np.dtype(
    (np.record, [(name, np.int64) for name in ("seed", "number", "steps", "scenario", "entries")])
)

# What a kart's counters were before a decision.
BEFORE = np.dtype(
    (
        np.record,
        [
            ("distance", np.float64),
            ("lead", np.float64),
            *(
                (name, np.int64)
                for name in ("contacts", "wall_contacts", "rank", "items_used", "laps")
            ),
        ],
    )
)


class Templates(NamedTuple):
    """What each scenario's world looks like at its start."""

    races: Records  # (S,) RACE
    rules: Records  # (S,) RULES
    bodies: Records  # (S, K) BODY
    racers: Records  # (S, K) RACER
    players: Records  # (S, K) PLAYER
    vehicles: Records  # (S, K) VEHICLE
    boxes: Records  # (S, I) BOX
    starts: Floats  # (S, B, 6) x0, x1, y0, y1 [m], heading, spread [rad]
    start_counts: Ints  # (S,)


class Buffers(NamedTuple):
    """All that a decision of a batch reads and writes besides the world."""

    settings: Records  # (1,) SETTINGS
    parts: Ints  # (n,) parts of the learners' observation
    opponent_parts: Ints  # (K, n) parts of each opponent's, filled up with -1
    weights: Floats  # (T,) of the reward terms
    odds: Floats  # (S,) of the scenarios, summed up; the last is 1
    gap: Floats  # (G, 2) ranges of the reality gap
    table: Floats  # (N, 3) discrete actions
    actions: Float32s  # (W, L, A)
    controls: Floats  # (W, K, 4)
    commanded: Floats  # (W, L, MEMORY) what an action remembers
    delayed: Floats  # (W, L, D, 4) controls on their way
    late: Float32s  # (W, L, D, size) observations on their way
    draws: Floats  # (W, L, G)
    observations: Float32s  # (W, L, size)
    terminal: Float32s  # (W, L, size) the last observation of an episode that ended now
    rewards: Float32s  # (W, L)
    terms: Floats  # (W, L, T) before they are weighed
    terminated: Bytes  # (W, L) 1 where the episode ended in this decision
    truncated: Bytes  # (W, L) 1 where it was cut off
    idle: Bytes  # (W, L) 1 where the episode is over and the kart waits for a reset
    before: Records  # (W, L) BEFORE
    episodes: Records  # (W, L) EPISODE
    ended: Records  # (W, L) EPISODE: that which ended last
    rounds: Records  # (W,) ROUND
    row: Float32s  # (W, S) one opponent's observation
    views: Floats  # (W, K, S) all opponents' observations
    memory: Floats  # (W, K, M) what opponents remember


# Fields with a leading world axis.
_BY_WORLD = tuple(
    name
    for name in Buffers._fields
    if name not in {"settings", "parts", "opponent_parts", "weights", "odds", "gap", "table"}
)


def part_of_buffers(rig: Buffers, first: int, last: int) -> Buffers:
    """Return the rig of worlds `first` to `last` (not included) as a view."""
    cuts: dict[str, Any] = {name: getattr(rig, name)[first:last] for name in _BY_WORLD}
    return rig._replace(**cuts)
