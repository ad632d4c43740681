"""Gates, laps and the clock: a lap counts only after every gate in order."""

from typing import NamedTuple

from race_server.core.kernels.jit import kernel

# One tick lasts 1/60 s; a time between two ticks is kept in whole microseconds.
TICK_NUMERATOR = 50_000  # [µs] three ticks: 1/60 s = 50 000/3 µs
TICK_DENOMINATOR = 3


class Gate(NamedTuple):
    """The gate that a kart must cross next, and its laps."""

    next_gate: int
    lap: int


@kernel
def count_gate(next_gate: int, lap: int, crossed: int, gates: int) -> Gate:
    """Return the next gate and the lap count after a gate was crossed forwards.

    next_gate: to cross next; lap: laps completed; crossed: number of the gate; gates: their count.
    Gate 0 is the timing line; crossing it completes a lap. A gate out of order changes nothing.
    """
    if crossed != next_gate:
        return Gate(next_gate, lap)
    following = crossed + 1 if crossed + 1 < gates else 0
    return Gate(following, lap + 1 if crossed == 0 else lap)


@kernel
def is_missed(next_gate: int, crossed: int, gates: int) -> bool:
    """Return whether crossing `crossed` forwards means that `next_gate` was left out.

    A gate that lies behind the next one is crossed again after driving backwards: no short cut.
    """
    ahead = (crossed - next_gate) % gates
    return 0 < ahead < gates - ahead


@kernel
def microseconds(tick: int, share: float) -> int:
    """Return the time [µs] of the moment `share` (0 to 1) of a tick after `tick`."""
    return (tick * TICK_NUMERATOR + round(share * TICK_NUMERATOR)) // TICK_DENOMINATOR


@kernel
def crossing_share(before: float, after: float) -> float:
    """Return when, as a share of the tick, a kart crossed a line.

    before, after: its distance past the line [m] at both ends of the tick.
    """
    if before >= 0.0:
        return 0.0
    return 1.0 if after <= 0.0 else before / (before - after)


@kernel
def race_distance(distance: float, laps: int, limit: float, length: float) -> float:
    """Return the distance [m] by which a kart is ranked.

    distance: since the start [m], which may run ahead through a short cut; laps: completed; limit:
    progress of the next gate in this lap [m], beyond which nothing counts; length: of a lap [m].
    """
    return min(distance, laps * length + limit)
