"""Cues on the way: one short word before the place to act, or silence.

A late cue is worse than none, and one in traffic or under a flag takes attention from what matters.
Everything follows from the course, the moment and what the driver did before: the same input gives
the same cue, on a page as on a kart.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from race_server.coaching.circumstances import TRAFFIC_S
from race_server.coaching.faults import Fault, FaultKind
from race_server.coaching.lap import Lap

# How long a cue is spoken [s].
SPOKEN_S = 0.8
# It ends between the first and the second [s] before the place to act; it aims at the third.
SOONEST_S, LATEST_S, AIM_S = 1.5, 1.0, 1.4
# Times on the best lap count where the speed differs from its speed there by less than this share.
ALIKE = 0.15

_WORDS = {
    FaultKind.EARLY_BRAKES: "brake later",
    FaultKind.COASTING: "stay on it",
    FaultKind.LATE_TURN_IN: "turn in earlier",
    FaultKind.SLOW_BEND: "carry speed",
    FaultKind.WIDE_APEX: "closer to the apex",
    FaultKind.LATE_THROTTLE: "throttle sooner",
    FaultKind.LIFT: "keep it open",
    FaultKind.SHORT_EXIT: "let it run out",
}
# Where the limit does not brake.
_WORDS_UNBRAKED = _WORDS | {FaultKind.EARLY_BRAKES: "lift later"}


@dataclass(frozen=True)
class Cue:
    """One thing to do at one place."""

    corner: str
    kind: FaultKind
    place: float  # [m] progress at which to act
    words: str


@dataclass(frozen=True)
class Moment:
    """What decides whether to speak now."""

    progress: float  # [m]
    speed: float  # [m/s]
    ahead_s: float  # to the kart ahead [s]; inf without one
    behind_s: float  # from the kart behind [s]; inf without one
    is_cautioned: bool  # a flag, or a warning of the kart itself
    is_driving: bool  # in the race, the right way round, with no effect of an item
    since_cue_s: float  # since the last cue began [s]; inf before the first


def cues_for(faults: Sequence[Fault]) -> tuple[Cue, ...]:
    """Return a cue for each fault that can be acted on: one for each corner, what costs most."""
    cues: dict[str, Cue] = {}
    for fault in sorted(faults, key=lambda one: -one.cost_us):
        if fault.kind in _WORDS and fault.corner.name not in cues:
            words = (_WORDS if fault.corner.is_braked else _WORDS_UNBRAKED)[fault.kind]
            cues[fault.corner.name] = Cue(fault.corner.name, fault.kind, _place_of(fault), words)
    return tuple(cues.values())


def _place_of(fault: Fault) -> float:
    corner = fault.corner
    if fault.kind in {FaultKind.EARLY_BRAKES, FaultKind.COASTING}:
        # Where he acts, which is too early; by the limit's place it would be too late to wait.
        return corner.brake - fault.size
    if fault.kind in {FaultKind.LATE_THROTTLE, FaultKind.LIFT, FaultKind.SHORT_EXIT}:
        return corner.apex
    return min(corner.brake, corner.entry)


def due(cues: Sequence[Cue], moment: Moment, best: Lap, said: Collection[str]) -> Cue | None:
    """Return the cue to speak now, or None for silence.

    best: the driver's lap from which times ahead are read; said: corners with a cue in this lap
    already. While a cue is spoken there is no other, and the cue of a corner whose time has passed
    is not made up for.
    """
    if moment.since_cue_s < SPOKEN_S or not is_free(moment):
        return None
    for cue in cues:
        if cue.corner in said:
            continue
        left = time_to(best, moment, cue.place) - SPOKEN_S
        if LATEST_S <= left <= AIM_S:
            return cue
    return None


def is_free(moment: Moment) -> bool:
    """Return whether the driver has attention to spare."""
    near = min(moment.ahead_s, moment.behind_s) < TRAFFIC_S
    return moment.is_driving and not moment.is_cautioned and not near


def time_to(best: Lap, moment: Moment, place: float) -> float:
    """Return the time [s] until a place, as on the best lap or at the speed that there is now."""
    length = float(best.progress[-1])
    here, there = moment.progress % length, place % length
    way = (there - here) % length
    own = best.at(best.speed, here)
    if abs(moment.speed - own) > ALIKE * own:
        return way / max(moment.speed, 0.1)
    later = best.at(best.time, there) - best.at(best.time, here)
    return later if later >= 0.0 else later + float(best.time[-1])
