"""What to try: one sentence for a fault, and the few that are worth it in a session."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from race_server.coaching.corners import Corner
from race_server.coaching.faults import Fault, FaultKind

# More than this is not remembered on the track.
MOST_TIPS = 3
# A fault in fewer laps than this share is an accident, not a habit.
OFTEN = 0.5

_TRY = {
    FaultKind.EARLY_BRAKES: "brake {size:.0f} m later; the limit brakes {brake:.0f} m before the "
    "apex",
    FaultKind.COASTING: "stay on the throttle {size:.0f} m longer, then brake",
    FaultKind.LATE_TURN_IN: "turn in earlier: you are {size:.1f} m too far outside at the entry",
    FaultKind.SLOW_BEND: "carry {size:.1f} m/s more through the bend",
    FaultKind.WIDE_APEX: "pass the apex {size:.1f} m nearer to the inside",
    FaultKind.LATE_THROTTLE: "open the throttle {size:.0f} m sooner, from the apex on",
    FaultKind.LIFT: "keep the throttle open on the way out: it was closed for {size:.0f} m",
    FaultKind.SHORT_EXIT: "let the kart run out: {size:.1f} m of road are unused at the exit",
    FaultKind.UNKNOWN: "no fault of driving is seen; look at the kart",
}
# Where the limit does not brake.
_TRY_UNBRAKED = _TRY | {
    FaultKind.EARLY_BRAKES: "lift {size:.0f} m later; no brakes are needed here",
    FaultKind.COASTING: "stay on the throttle {size:.0f} m longer; no brakes are needed here",
}


@dataclass(frozen=True)
class Tip:
    """One fault that comes back, and what to try."""

    corner: Corner
    kind: FaultKind
    size: float  # the mean
    unit: str
    laps: int  # with this fault
    of: int  # laps that were compared
    cost_us: int  # a lap, the mean over all of them

    @property
    def words(self) -> str:
        """What to try."""
        corner = self.corner
        words = (_TRY if corner.is_braked else _TRY_UNBRAKED)[self.kind]
        return f"{corner.name}: " + words.format(size=self.size, brake=corner.reach)


def tips_for(laps: Sequence[Sequence[Fault]]) -> tuple[Tip, ...]:
    """Return what to try after a session, what costs most first: three tips at most.

    laps: the faults of each lap. A fault counts that comes back in half of the laps.
    """
    found: dict[tuple[str, FaultKind], list[Fault]] = {}
    for faults in laps:
        for fault in faults:
            found.setdefault((fault.corner.name, fault.kind), []).append(fault)
    tips = [
        Tip(
            same[0].corner,
            same[0].kind,
            fmean(fault.size for fault in same),
            same[0].unit,
            len(same),
            len(laps),
            round(sum(fault.cost_us for fault in same) / len(laps)),
        )
        for same in found.values()
        if len(same) >= OFTEN * len(laps)
    ]
    # What has no name comes last: it cannot be tried.
    return tuple(sorted(tips, key=_worth)[:MOST_TIPS])


def _worth(tip: Tip) -> tuple[bool, int]:
    return tip.kind is FaultKind.UNKNOWN, -tip.cost_us
