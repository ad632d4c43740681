"""The arrays that a batch of training worlds adds to the world itself.

Axis letters: W worlds, K karts, L learning karts (the first L of the K), S scenarios, T reward
terms, A numbers of an action, D delay. Three records have fields of the discipline behind their
own: `settings`, `before` and `episodes` (with `ended`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from race_server.core.kernel_driver import memory_size
from race_server.core.state import Bytes, Float32s, Floats, Ints, Records
from race_server.envs.actions import MEMORY, WIDTHS, discrete_table
from race_server.envs.reality_gap import FACTORS

# What happens once a learning kart's episode is over.
STAY, RESET_WORLD, REENTER = range(3)

SETTINGS = {
    "decision_ticks": np.int64,
    "action": np.int64,
    "after": np.int64,  # STAY, RESET_WORLD or REENTER
    "most_steps": np.int64,  # decisions of an episode; 0: no limit
}
# One learning kart's episode so far.
EPISODE = {
    "total": np.float64,  # sum of the rewards
    "steps": np.int64,  # decisions
    "number": np.int64,  # counts the kart's episodes since the seed was set
}
# One world's round: from one reset to the next. `world`: its number in the whole batch, also where
# a thread has only some of the worlds.
ROUND = dict.fromkeys(("seed", "number", "steps", "scenario", "entries", "world"), np.int64)


@dataclass(frozen=True)
class Figures:
    """Fields that a discipline adds to the records of a learning kart, with their types."""

    before: Mapping[str, type]  # counters, as they were before a decision
    episode: Mapping[str, type]  # of the episode so far


# A NamedTuple of the discipline: what each scenario's world looks like at its start.
Templates = Any


class Buffers(NamedTuple):
    """All that a decision of a batch reads and writes besides the world."""

    settings: Records  # (1,) SETTINGS and the discipline's
    offsets: Ints  # (parts + 1,) of the learners' observation, see `observation.offsets_of`
    opponent_offsets: Ints  # (K, parts + 1) of each opponent's, all -1 for a kart without a driver
    weights: Floats  # (T,) of the reward terms
    odds: Floats  # (S,) of the scenarios, summed up; the last is 1
    gap: Floats  # (G, 2) ranges of the reality gap, for rounds that begin
    round_gap: Floats  # (W, G, 2) those of each world's round
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
    before: Records  # (W, L) the discipline's
    episodes: Records  # (W, L) EPISODE and the discipline's
    ended: Records  # (W, L) the same: the episode that ended last
    rounds: Records  # (W,) ROUND
    row: Float32s  # (W, S) one opponent's observation
    views: Floats  # (W, K, S) all opponents' observations
    memory: Floats  # (W, K, M) what opponents remember


# Fields without a leading world axis.
_SHARED = {"settings", "offsets", "opponent_offsets", "weights", "odds", "gap", "table"}
BY_WORLD = tuple(name for name in Buffers._fields if name not in _SHARED)


@dataclass(frozen=True)
class Sizes:
    """How long the axes of the buffers are."""

    worlds: int
    karts: int
    learners: int
    scenarios: int
    observation: int  # numbers of a learning kart's
    rays: int  # of the lidar


class Opposition(NamedTuple):
    """What the opponents of a batch see, as sizes and part numbers."""

    widest: int  # numbers of the longest observation
    offsets: Ints  # (K, parts + 1) of each kart's, all -1 for a kart without a driver


def make_buffers(
    sizes: Sizes,
    figures: Figures,
    settings: Mapping[str, float],
    offsets: Ints,
    opposition: Opposition,
    weights: Floats,
    gap: Floats,
) -> Buffers:
    """Return the buffers of a batch, all zero but what is fixed for it.

    settings: the fields of SETTINGS and those of the discipline, in that order; parts: numbers of
    the learners' observation; weights: (T,); gap: (G, 2), see `RealityGap.ranges`.
    """
    per_world, size = (sizes.worlds, sizes.karts), sizes.observation
    shape = (sizes.worlds, sizes.learners)
    episode = record(EPISODE | dict(figures.episode))
    # A ring needs room for the newest and for the oldest that a draw can ask for.
    rings = [int(row[1]) + 1 if row[1] > 0 else 0 for row in gap[:2]]
    rounds = np.zeros(sizes.worlds, record(ROUND))
    rounds["world"] = np.arange(sizes.worlds)
    return Buffers(
        settings=_settings(settings),
        offsets=offsets,
        opponent_offsets=opposition.offsets,
        weights=weights,
        odds=np.cumsum(np.full(sizes.scenarios, 1.0 / sizes.scenarios)),
        gap=gap,
        round_gap=np.tile(gap, (sizes.worlds, 1, 1)),
        table=discrete_table(),
        actions=np.zeros((*shape, WIDTHS[int(settings["action"])]), np.float32),
        controls=np.zeros((*per_world, 4)),
        commanded=np.zeros((*shape, MEMORY)),
        delayed=np.zeros((*shape, rings[0], 4)),
        late=np.zeros((*shape, rings[1], size), np.float32),
        draws=np.zeros((*shape, len(FACTORS))),
        observations=np.zeros((*shape, size), np.float32),
        terminal=np.zeros((*shape, size), np.float32),
        rewards=np.zeros(shape, np.float32),
        terms=np.zeros((*shape, len(weights))),
        terminated=np.zeros(shape, np.uint8),
        truncated=np.zeros(shape, np.uint8),
        idle=np.zeros(shape, np.uint8),
        before=np.zeros(shape, record(figures.before)),
        episodes=np.zeros(shape, episode),
        ended=np.zeros(shape, episode),
        rounds=rounds,
        row=np.zeros((sizes.worlds, opposition.widest), np.float32),
        views=np.zeros((*per_world, opposition.widest)),
        memory=np.zeros((*per_world, memory_size(sizes.rays))),
    )


def record(fields: Mapping[str, type]) -> np.dtype[Any]:
    """Return the type of a record: its fields are attributes for kernels."""
    return np.dtype((np.record, list(fields.items())))


def _settings(values: Mapping[str, float]) -> Records:
    fields = {name: SETTINGS.get(name, np.float64) for name in values}
    settings = np.zeros(1, record(fields))
    for name, value in values.items():
        settings[name] = value
    return settings.view(np.recarray)


def part_of_buffers(buffers: Buffers, first: int, last: int) -> Buffers:
    """Return the buffers of worlds `first` to `last` (not included) as a view."""
    cuts: dict[str, Any] = {name: getattr(buffers, name)[first:last] for name in BY_WORLD}
    return buffers._replace(**cuts)
