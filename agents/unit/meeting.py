"""How an object is met along an arc, and how hard the kart must brake before that.

What full brakes, easing and warning are due for is told in `race_agents.unit.danger`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.foreseen import CREEP, PASSED, STEP_S, TIMES, Foreseen, Movers
from race_agents.unit.limits import RACED, Limits
from race_agents.unit.safety import STRAIGHT
from race_agents.unit.track import Track
from race_server.core import codes
from race_server.core.alert import DangerStage

Floats = NDArray[np.float64]

WARN_S, EASE_S = 2.6, 1.7
# A warning comes this long [s] before full brakes at the latest (UN R152: 0.8 s).
AHEAD_S = 0.95
# Shares of the usual braking from which on the motor is off behind another kart that drives, and
# from which on its driver is warned.
EASE_SHARE, WARN_SHARE = 0.75, 0.5
# At most this much [m] is added to the berth for what is not known of a track.
MOST_UNSURE = 0.35
# Who walks towards the way may be faster or slower than it seems: of a meeting this far [m] beside
# what is foreseen the driver is warned, and no more is done.
MOST_WALKED = 2.0
# A person is known after this many scans, and until then may walk [m/s], but no farther than [m].
KNOWN, WALK, MOST_STEP = 6, 1.4, 0.9
# That much room [m] is left to a kart ahead when the kart is as slow as it.
KEPT = 0.6
# In this time [s] brakes hold a kart back by less than that. A kart beside that comes over more
# slowly than this [m/s] keeps its lane, as far as a radar can tell.
FLANK_S, SIDLES = 0.75, 1.0
# How a kart moves whose speed has this deviation [m/s] is not known; after half a second it is.
VAGUE = 1.5
# A kart drives along that goes at this share of the own speed at least along the way; it crosses
# slantwise where it comes over at this share of that.
ALONG, SLANTS = 0.5, 0.5
# A driver that does this share of the usual braking has seen what is ahead: nothing of what the
# brakes can do is kept back.
BRAKES = 0.5
# A kart ahead that slows down by more than this [m/s²] is taken to go on with it.
SLOWS = 2.0


class Meeting(NamedTuple):
    """An object is met along an arc."""

    stage: DangerStage = DangerStage.NONE
    needed: float = 0.0  # [m/s²]
    time_s: float = math.inf
    aside: float = 0.0  # [m] to the left of the arc


NO_MEETING = Meeting()
order_of = itemgetter(0, 1)


@dataclass(frozen=True, eq=False)
class Ahead:
    """All objects along some arcs."""

    tracks: Sequence[Track]
    speed: float
    curvatures: Sequence[float]
    limits: Limits
    braking: float = 0.0  # [m/s²] that the driver does already

    def meeting(self, place: int, arc: int) -> Meeting:
        """Return how one object is met along one arc.

        A kart that drives follows the course as its own driver does, or goes straight on: it is in
        danger where both would be met.
        """
        if self.speed < CREEP:
            return NO_MEETING
        at = arc, place
        straight = self._meeting(self._straight, at, self._straight_met.item(at))
        if straight is NO_MEETING:
            first, most = self._walked_met.item(at), DangerStage.WARN
            return self._meeting(self._straight, at, first, most)
        if not self._drives[place] or abs(self.curvatures[arc]) < STRAIGHT:
            return straight
        turning = self._meeting(self._turning, at, self._turning_met.item(at))
        return min(straight, turning, key=order_of)

    @cached_property
    def _drives(self) -> list[bool]:
        """Which objects are karts that drive."""
        return [track.kind == codes.KART_HIT and not track.stands for track in self.tracks]

    @cached_property
    def _movers(self) -> Movers:
        return Movers.of(self.tracks, self.curvatures, self.limits)

    @cached_property
    def _straight(self) -> Foreseen:
        return self._movers.straight_on(self.speed, self.limits)

    @cached_property
    def _straight_met(self) -> NDArray[np.int64]:
        return self._straight.first_within(self._usual)

    @cached_property
    def _walked_met(self) -> NDArray[np.int64]:
        """Of who comes nearer on foot: when they are met if they are faster or slower."""
        is_kart = np.array([track.kind == codes.KART_HIT for track in self.tracks])
        walks = self._straight.comes_nearer() & ~is_kart
        if not walks.any():
            return np.full(walks.shape, -1)
        return np.where(walks, self._straight.first_within(self._beside(MOST_WALKED)), -1)

    @cached_property
    def _turning(self) -> Foreseen:
        return self._movers.along_with(self.speed, self.limits)

    @cached_property
    def _turning_met(self) -> NDArray[np.int64]:
        return self._turning.first_within(self._usual)

    @cached_property
    def _usual(self) -> Floats:
        return self._beside(MOST_UNSURE)

    def _beside(self, most_unsure: float) -> Floats:
        """Return how far from an arc each object is met at each of `TIMES` [m], shape (n, T)."""
        base, rate, most = np.array(
            [
                _margin(track, self.limits, most_unsure, drives=drives)
                for track, drives in zip(self.tracks, self._drives, strict=True)
            ]
        ).T[:, :, None]
        return np.asarray(self.limits.half_width + base + np.minimum(rate * TIMES, most))

    def _meeting(
        self,
        foreseen: Foreseen,
        at: tuple[int, int],
        first: int,
        at_most: DangerStage = DangerStage.FULL,
    ) -> Meeting:
        """Return how an object is met at a step, -1 for never; `at_most` is its worst stage."""
        if first < 0:
            return NO_MEETING
        limits, track, drives = self.limits, self.tracks[at[1]], self._drives[at[1]]
        time_s = float(TIMES[first])
        there, aside = foreseen.along.item(*at, first), foreseen.aside.item(*at, first)
        if drives:
            here, pace = foreseen.along.item(*at, 0), foreseen.pace.item(at)
            pace, room = _behind(track, pace, here, self.speed, limits)
        else:  # it stands, comes, or crosses: the kart stops before the place where they would meet
            pace, room = self.speed, there - limits.nose - limits.stand_off
        # Racers brake late, behind others that do so, too: the way until brakes bite is driven
        # while braking already.
        needed = needed_for(pace, room, limits.reaction_s, self.braking if drives else 0.0)
        full = limits.promised if drives else limits.braking
        soon = needed_for(pace, room, limits.reaction_s + AHEAD_S) >= full
        if drives:
            brakes = self.braking >= BRAKES * limits.promised
            most = limits.promised / RACED if brakes else limits.promised
            stage = _stage_behind(track, needed, most, soon=soon, limits=limits)
        else:
            stage = _stage(time_s, needed, soon=soon, limits=limits)
        if stage > at_most:
            stage = at_most
        # It comes: brakes take off the smaller part.
        if stage > DangerStage.EASE and track.kind == codes.KART_HIT:
            keeps_off = self._keeps_off(track, foreseen, at, first)
            stage = DangerStage.EASE if keeps_off or track.leaves < -self.speed else stage
        return Meeting(stage, needed, time_s, aside)

    def _keeps_off(self, track: Track, foreseen: Foreseen, at: tuple[int, int], first: int) -> bool:
        """Return whether no full brakes are due for a kart that is beside the way now.

        It drives into the flank so soon that they do not help, or keeps its lane; or it has just
        come into view, and may as well cut in ahead. One that is not parked has to be met as well
        if it moves across as it seems to, plain or not; one that drives along, too, if it comes
        over more slowly by the deviation of its speed, and one that crosses slantwise if it is
        faster by that.
        """
        aside, pace = foreseen.aside[at], foreseen.pace.item(at)
        now, then, next_ = (abs(aside.item(step)) for step in (0, first, 1))
        if now <= self.limits.half_width:
            return False
        time_s, is_flank = float(TIMES[first]), foreseen.gap.item(*at, first) < -PASSED
        if is_flank and (time_s < FLANK_S or now - then < SIDLES * time_s):
            return True
        asides = []
        if not track.may_be_parked:
            turned = self.curvatures[at[0]] * foreseen.along.item(*at, 0)
            asides.append(aside + track.unclear(turned) * TIMES)
        if pace >= ALONG * self.speed:
            off = math.copysign(track.unsure, aside.item(0)) * TIMES
            asides.append(aside + off)
            if now - next_ > SLANTS * pace * STEP_S:
                asides.append(aside - off)
        elif track.unsure > VAGUE:
            return True
        passes, beside = foreseen.passes[at], self._usual[at[1]]
        return not all((passes & (np.abs(each) < beside)).any() for each in asides)


def _margin(
    track: Track, limits: Limits, most_unsure: float, *, drives: bool
) -> tuple[float, float, float]:
    """Return how far beside the way an object counts [m]: now, each second more, that at most.

    People get a berth. A person that has just come into view nearby may walk towards the way for
    as long as nothing is known of it. Karts race side by side: one that drives gets none.
    """
    if drives:
        return -limits.spare, 0.0, 0.0
    if track.kind == codes.KART_HIT:
        return 0.0, track.unsure, MOST_UNSURE
    if track.scans < KNOWN and track.began < limits.near:
        return limits.berth, WALK, MOST_STEP
    return limits.berth, track.unsure, most_unsure


def _behind(
    track: Track, pace: float, here: float, speed: float, limits: Limits
) -> tuple[float, float]:
    """Return the speed that braking has to take off behind a kart [m/s], and the room for it [m].

    pace: of that kart along the arc [m/s]; here: where it is along it [m].
    """
    leaves = max(pace, 0.0)
    gap = here - limits.nose - KEPT
    if track.slowing > SLOWS:  # it will stand somewhere ahead
        return speed, gap + leaves * leaves / (2.0 * track.slowing)
    return max(speed - leaves, 0.0), gap


def needed_for(pace: float, room: float, after_s: float, braking: float = 0.0) -> float:
    """Return the braking [m/s²] that takes a speed off within a room, begun after some time.

    braking: [m/s²] that is done until then.
    """
    if pace < CREEP:
        return 0.0
    then = pace - braking * after_s
    if then < CREEP:  # what is done already takes it off
        return pace * pace / (2.0 * max(room, 0.05))
    return then * then / (2.0 * max(room - 0.5 * (pace + then) * after_s, 0.05))


def _stage(time_s: float, needed: float, *, soon: bool, limits: Limits) -> DangerStage:
    """Return how far a danger has come. soon: full brakes are due within `AHEAD_S`."""
    if needed >= limits.braking:
        return DangerStage.FULL
    if time_s < EASE_S and needed >= 0.5 * limits.braking:
        return DangerStage.EASE
    return DangerStage.WARN if soon or time_s < WARN_S else DangerStage.INFORM


def _stage_behind(
    track: Track, needed: float, most: float, *, soon: bool, limits: Limits
) -> DangerStage:
    """Return how far the danger has come that a kart is which drives.

    Racing is close: only braking counts, not time, and what is usual of it. most: braking [m/s²]
    from which on it has to be full.
    """
    if needed >= most:
        return DangerStage.FULL
    if needed >= EASE_SHARE * limits.promised:
        return DangerStage.EASE
    # Who told that it brakes does so for its bend as a rule, for which this driver brakes, too.
    is_due = track.braking <= 0.0 and (soon or needed >= WARN_SHARE * limits.promised)
    return DangerStage.WARN if is_due else DangerStage.INFORM
