"""Driving faults: what a driver did in a corner that cost time, named from how it was driven."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from race_server.coaching.corners import Corner
from race_server.coaching.features import Features, features_of
from race_server.coaching.lap import Lap
from race_server.coaching.losses import LapLoss


class FaultKind(StrEnum):
    """What a driver does that costs time."""

    EARLY_BRAKES = "braked early"
    COASTING = "coasted"
    LATE_TURN_IN = "turned in late"
    SLOW_BEND = "slow in the bend"
    WIDE_APEX = "missed the apex"
    LATE_THROTTLE = "late on the throttle"
    LIFT = "lifted on the way out"
    SHORT_EXIT = "road unused at the exit"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Fault:
    """One fault of a lap."""

    corner: Corner
    kind: FaultKind
    size: float  # in `unit`; of UNKNOWN what it costs
    unit: str
    cost_us: int  # what the corner costs because of it

    @property
    def words(self) -> str:
        """What was done, with its size."""
        if self.kind is FaultKind.UNKNOWN:
            return "unknown"
        return f"{self.kind}: {self.size:.1f} {self.unit}"


@dataclass(frozen=True)
class _Sign:
    """What speaks for a fault."""

    kind: FaultKind
    unit: str
    least: float  # smaller differences are those of any two laps
    size: Callable[[Features], float]


# A corner that costs less [µs] has no fault worth a word, and one that costs less than the second
# has none that must have a name.
LEAST_US, UNEXPLAINED_US = 20_000, 80_000
# Around an apex any two laps differ by less [m/s]; beyond that a slow bend makes the throttle late
# too, by this much [m] for each m/s.
_PACE, _LATE_PER_SLOW = 0.2, 2.5
# A throttle is late that is less open by this share at least: a weak motor gains speed late too.
_SHUT = 0.1
# Least stretch [m] of a lift.
_LIFTED = 2.4
# What begins before this share of the way from the slowest place to the exit is a late throttle,
# and what begins behind it a lift.
_LIFT_FROM = 0.37
# A kart coasts with its throttle closed by this share at least.
_ROLLED = 0.3


# Where less of the speed than this share is lost, places on the way down and up say little.
_SHALLOW = 0.12
# Sizes are for karts; what drives more slowly than this [m/s] has signs that are as much smaller.
KART_PACE = 9.0


def _early_brakes(seen: Features) -> float:
    return seen.early if seen.drop > _SHALLOW else 0.0


def _coasting(seen: Features) -> float:
    return seen.eased if seen.rolled > _ROLLED and seen.drop > _SHALLOW else 0.0


def _late_turn(seen: Features) -> float:
    return seen.entry_wide - max(seen.apex_wide, 0.0)


def _late_throttle(seen: Features) -> float:
    late = seen.late - _LATE_PER_SLOW * max(seen.slow - _PACE * _scale(seen), 0.0)
    is_late = seen.shut > _SHUT and seen.drop > _SHALLOW
    return late if is_late and _lift(seen) < _LIFTED * _scale(seen) else 0.0


def _lift(seen: Features) -> float:
    return seen.lifted if seen.lifted_from > _LIFT_FROM else 0.0


# A kart off the line is slow because of that: these come first.
_LINE = (
    _Sign(FaultKind.WIDE_APEX, "m", 0.4, lambda seen: seen.apex_wide),
    _Sign(FaultKind.LATE_TURN_IN, "m wide", 0.45, _late_turn),
    _Sign(FaultKind.SHORT_EXIT, "m", 0.5, lambda seen: seen.exit_tight),
)
_SPEED = (
    _Sign(FaultKind.EARLY_BRAKES, "m", 2.4, _early_brakes),
    _Sign(FaultKind.COASTING, "m", 2.7, _coasting),
    _Sign(FaultKind.SLOW_BEND, "m/s", 0.34, lambda seen: seen.slow),
    _Sign(FaultKind.LATE_THROTTLE, "m", 1.3, _late_throttle),
    _Sign(FaultKind.LIFT, "m", _LIFTED, _lift),
)


def fault_in(corner: Corner, seen: Features, cost_us: int) -> Fault | None:
    """Return the fault of a corner that costs some time; None where none is worth a word.

    The fault is the one whose size exceeds most clearly what any two laps differ by. Where nothing
    does, but time is lost, it is called unknown.
    """
    if cost_us < LEAST_US:
        return None
    for signs in (_LINE, _SPEED):
        clear, sign = max(((sign.size(seen) / sign.least, sign) for sign in signs), key=_clearness)
        if clear >= _scale(seen):
            return Fault(corner, sign.kind, sign.size(seen), sign.unit, cost_us)
    if cost_us < UNEXPLAINED_US:
        return None
    return Fault(corner, FaultKind.UNKNOWN, cost_us / 1e3, "ms", cost_us)


def _scale(seen: Features) -> float:
    return min(seen.pace / KART_PACE, 1.0)


def _clearness(pair: tuple[float, _Sign]) -> float:
    return pair[0]


def faults_of(lap: Lap, other: Lap, loss: LapLoss) -> Sequence[Fault]:
    """Return the faults of a lap against another one, those that cost most first."""
    found = [
        fault_in(one.corner, features_of(lap, other, one.corner), one.total_us)
        for one in loss.corners
    ]
    return sorted((fault for fault in found if fault), key=lambda fault: -fault.cost_us)
