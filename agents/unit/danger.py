"""How dangerous each object is along our own arcs, in four stages.

For every object that moves on as it does, and for the arc that the kart drives and the one that its
driver steers to: when do the two meet, and how hard must the kart brake from now on to stop, or to
be as slow as the object, before that? *Inform* needs no action, *warn* asks for one, *ease* takes
the motor off and brakes a little, *full* is full brakes. A warning is due 0.95 s before full brakes
(UN R152 asks for 0.8 s), and for people 2.6 s before they would be met; the motor goes off at
1.7 s. No stage delays a later one: each is judged by itself, and the reflex stands above all.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.drift import STRAIGHT_ON, Drift
from race_agents.unit.limits import CERTAIN, Limits
from race_agents.unit.safety import (
    STOP_FOR_OBSTACLE,
    STRAIGHT,
    Echoes,
    Verdict,
    in_the_way,
    way_along,
)
from race_agents.unit.track import BORN, Track
from race_server.core import codes
from race_server.core.alert import Advice, Cause, Danger, DangerStage
from race_server.core.messages import RayHit

Floats = NDArray[np.float64]


NO_DANGER = Danger()
WARN_S, EASE_S = 2.6, 1.7
# A warning comes this long [s] before full brakes at the latest (UN R152: 0.8 s).
AHEAD_S = 0.95
# Shares of the usual braking from which on the motor is off behind another kart that drives, and
# from which on its driver is warned.
EASE_SHARE, WARN_SHARE = 0.75, 0.5
# The motor goes off, and a little braking shows the driver that it is meant.
EASING = Verdict(brake=0.3, motor=0.0, cause=Cause.OBSTACLE)
# The future is looked at in these steps, this far [s].
STEP_S, FORESEEN_S = 0.1, 5.0
TIMES = np.arange(0.0, FORESEEN_S, STEP_S)
# At most this much [m] is added to the berth for what is not known of a track.
MOST_UNSURE = 0.35
# Who walks towards the way may be faster or slower than it seems: of a meeting this far [m] beside
# what is foreseen the driver is warned, and no more is done.
MOST_WALKED = 2.0
# A person is known after this many scans, and until then may walk [m/s], but no farther than [m].
KNOWN, WALK, MOST_STEP = 6, 1.4, 0.9
# Closing more slowly than this [m/s] is no danger.
CREEP = 0.5
# That much room [m] is left to a kart ahead when the kart is as slow as it.
KEPT = 0.6
# A kart whose nearest point lies less than this [m] ahead of the bumper is being passed.
PASSED = 0.8
# In this time [s] brakes hold a kart back by less than that.
FLANK_S = 0.75
# A kart ahead that slows down by more than this [m/s²] is taken to go on with it.
SLOWS = 2.0
# People count from this scan on, at first only while they are seen; karts once it is known how
# they move.
SEEN = 2
# A kart is met by several beams: one that more scans than this did not show has turned off, and is
# no longer where it would be by its last speed.
LOST = 2
# Where there is room on one side within this time [s] steering is told.
ROOM = 0.3


def worst_ahead(
    tracks: Sequence[Track],
    loose: Echoes,
    speed: float,
    now: float,
    wanted: float,
    limits: Limits,
    *,
    drift: Drift = STRAIGHT_ON,
) -> Danger:
    """Return the worst that is ahead: of the objects, or of the echoes that the reflex brakes for.

    loose: echoes that are of no kart whose way is known; the rest as of `assess`.
    """
    # No way is tighter than tyres hold: a kart that turns faster spins, and goes straight on.
    most = limits.grip / (CERTAIN * max(speed * speed, 1e-6))
    now, wanted = (max(-most, min(each, most)) for each in (now, wanted))
    limits, loose = drift.limits(limits), drift.echoes(loose)
    steers = not drift.slides
    danger = assess(drift.tracks(tracks), speed, now, wanted, limits, steers=steers)
    if danger.stage is not DangerStage.FULL:
        met = in_the_way(loose, speed, now, wanted, limits, steers=steers)
        if met.any():
            danger = nearest_of(loose.kept(met), limits, Advice.BRAKE)
    return replace(danger, bearing=danger.bearing + drift.course) if drift.course else danger


def nearest_of(echoes: Echoes, limits: Limits, advice: Advice) -> Danger:
    """Return the danger that the nearest of some echoes is, for which the kart brakes fully."""
    x = echoes.x - limits.nose
    far = np.hypot(x, echoes.y)
    nearest = int(np.argmin(far))
    distance, closing = float(far[nearest]), float(echoes.closing[nearest])
    comes = closing > CREEP
    return Danger(
        DangerStage.FULL,
        RayHit(int(echoes.kinds[nearest])),
        math.atan2(float(echoes.y[nearest]), float(x[nearest])),
        distance,
        distance / closing if comes else math.inf,
        _needed(closing, distance, 0.0) if comes else 0.0,
        advice,
    )


def assess(
    tracks: Sequence[Track],
    speed: float,
    now: float,
    wanted: float,
    limits: Limits,
    *,
    steers: bool = True,
) -> Danger:
    """Return the worst danger of all objects along the two arcs.

    now, wanted: curvatures [1/m] that the kart drives, and that its driver steers to; steers:
    whether it goes where its front wheels point.
    """
    worst = NO_DANGER
    for track in tracks:
        is_kart = track.kind == codes.KART_HIT
        is_young = track.scans < BORN
        if track.scans < SEEN or (is_young and (is_kart or track.missed)):
            continue
        danger = danger_of(track, speed, now, limits)
        # Who steers past a kart passes it; a person on either way is in danger.
        has_two_ways = danger is not NO_DANGER if is_kart else steers
        if has_two_ways:
            other = danger_of(track, speed, wanted, limits)
            danger = (min if is_kart else max)(danger, other, key=severity_of)
        if is_kart and track.missed > LOST:
            danger = replace(danger, stage=min(danger.stage, DangerStage.EASE))
        worst = max(worst, danger, key=severity_of)
    return worst


def severity_of(danger: Danger) -> tuple[int, float]:
    """Return by what dangers are ordered: how far each has come, and the braking needed."""
    return int(danger.stage), danger.needed


def danger_of(track: Track, speed: float, curvature: float, limits: Limits) -> Danger:
    """Return how dangerous one object is along one arc at this speed.

    A kart that drives follows the course as its own driver does, or goes straight on: it is in
    danger where both would be met.
    """
    if speed < CREEP:
        return NO_DANGER
    foreseen = _straight_on(track, curvature)
    straight = _meeting(track, foreseen, speed, limits)
    if straight is NO_DANGER and track.kind != codes.KART_HIT and foreseen.comes_nearer:
        return _meeting(track, foreseen, speed, limits, MOST_WALKED)
    if straight is NO_DANGER or not _drives(track) or abs(curvature) < STRAIGHT:
        return straight
    turning = _meeting(track, _along_with(track, curvature), speed, limits)
    return min(straight, turning, key=severity_of)


def _drives(track: Track) -> bool:
    return track.kind == codes.KART_HIT and not track.stands


class Foreseen(NamedTuple):
    """Where an object will be at `TIMES`, in the frame of an arc, and how fast it goes along it."""

    along: Floats  # (T,) [m]
    aside: Floats  # (T,) [m] to the left
    pace: float  # [m/s] now

    @property
    def comes_nearer(self) -> bool:
        """Whether it comes nearer to the arc, and not just so."""
        now, soon = abs(float(self.aside[0])), abs(float(self.aside[1]))
        return now - soon > CREEP * STEP_S


def _straight_on(track: Track, curvature: float) -> Foreseen:
    """Return where an object is that goes straight on over ground."""
    x, y, (vx, vy) = float(track.state[0]), float(track.state[1]), track.velocity
    seconds = _seconds_of_way(track)
    along, aside = _beside_arc(x + vx * seconds, y + vy * seconds, curvature)
    way = curvature * float(along[0])
    return Foreseen(along, aside, vx * math.cos(way) + vy * math.sin(way))


def _along_with(track: Track, curvature: float) -> Foreseen:
    """Return where an object is that turns as the arc does."""
    x, y, (vx, vy) = float(track.state[0]), float(track.state[1]), track.velocity
    along, aside = _beside_arc(np.array([x]), np.array([y]), curvature)
    way = curvature * float(along[0])
    pace, leaves = vx * math.cos(way) + vy * math.sin(way), vy * math.cos(way) - vx * math.sin(way)
    seconds = _seconds_of_way(track)
    return Foreseen(along[0] + pace * seconds, aside[0] + leaves * seconds, pace)


def _seconds_of_way(track: Track) -> Floats:
    """Return how long an object takes at its speed of now for its way until each of `TIMES` [s].

    That is less for one which told that it brakes: it goes on to do so until it stands.
    """
    speed = math.hypot(*track.velocity)
    if track.braking <= 0.0 or speed < CREEP:
        return TIMES
    rate = track.braking / speed
    brakes = np.minimum(TIMES, 1.0 / rate)
    return np.asarray(brakes - 0.5 * rate * brakes**2)


def _meeting(
    track: Track, foreseen: Foreseen, speed: float, limits: Limits, most_unsure: float = MOST_UNSURE
) -> Danger:
    """Return how dangerous an object is that moves as foreseen.

    most_unsure: if it is met only this far [m] beside that, its driver is warned at most.
    """
    x, y = float(track.state[0]), float(track.state[1])
    along, aside, _ = foreseen
    near = np.abs(aside) < limits.half_width + _margin(track, limits, most_unsure)
    gap = along - limits.nose - speed * TIMES  # from the bumper, if the kart drives on
    length = limits.nose + 0.5  # behind the bumper until nothing can be touched
    meets = near & (gap <= 0.0) & (gap > -length)
    # What is beside the body already can only be touched from the side: brakes do not help.
    beside = limits.nose + (PASSED if track.kind == codes.KART_HIT else 0.0)
    if not meets.any() or float(along[0]) < beside:
        return NO_DANGER
    first = int(np.argmax(meets))
    time_s = float(TIMES[first])
    pace, room = _approach(track, foreseen, speed, float(along[first]), limits)
    needed = _needed(pace, room, limits.reaction_s)
    full = limits.promised if _drives(track) else limits.braking
    soon = _needed(pace, room, limits.reaction_s + AHEAD_S) >= full
    stage = _stage(track, time_s, needed, soon=soon, limits=limits)
    if most_unsure > MOST_UNSURE:
        stage = min(stage, DangerStage.WARN)
    # It comes: brakes take off the smaller part. Or it soon drives into the flank.
    flank = gap[first] < -PASSED and time_s < FLANK_S
    if track.kind == codes.KART_HIT and (track.leaves < -speed or flank):
        stage = min(stage, DangerStage.EASE)
    bearing = math.atan2(y, x - limits.nose)
    return Danger(
        stage,
        RayHit(track.kind),
        bearing,
        max(math.hypot(x, y) - limits.nose, 0.0),
        time_s,
        needed,
        _advice(stage, float(aside[first]), limits),
    )


def _margin(track: Track, limits: Limits, most_unsure: float) -> Floats | float:
    """Return how far beside the way an object still counts, at each of `TIMES` [m].

    People get a berth. A person that has just come into view nearby may walk towards the way for
    as long as nothing is known of it. Karts race side by side: one that drives gets none.
    """
    if _drives(track):
        return -limits.spare
    unsure = np.minimum(track.unsure * TIMES, most_unsure)
    if track.kind == codes.KART_HIT:
        return unsure
    if track.scans < KNOWN and track.began < limits.near:
        unsure = np.minimum(WALK * TIMES, MOST_STEP)
    return limits.berth + unsure


def _approach(
    track: Track, foreseen: Foreseen, speed: float, meeting: float, limits: Limits
) -> tuple[float, float]:
    """Return the speed that braking has to take off [m/s], and the room that there is for it [m].

    meeting: how far along the arc the object is met [m].
    """
    if not _drives(track):
        # It stands, comes, or crosses: the kart stops before the place where they would meet.
        return speed, meeting - limits.nose - limits.stand_off
    leaves = max(foreseen.pace, 0.0)
    gap = float(foreseen.along[0]) - limits.nose - KEPT
    if track.slowing > SLOWS:  # it will stand somewhere ahead
        return speed, gap + leaves * leaves / (2.0 * track.slowing)
    return max(speed - leaves, 0.0), gap


def _needed(pace: float, room: float, after_s: float) -> float:
    """Return the braking [m/s²] that takes a speed off within a room, begun after some time."""
    if pace < CREEP:
        return 0.0
    return pace * pace / (2.0 * max(room - pace * after_s, 0.05))


def _stage(
    track: Track, time_s: float, needed: float, *, soon: bool, limits: Limits
) -> DangerStage:
    """Return how far a danger has come. soon: full brakes are due within `AHEAD_S`."""
    if _drives(track):
        # Racing is close: only braking counts, not time, and what is usual of it.
        if needed >= limits.promised:
            return DangerStage.FULL
        if needed >= EASE_SHARE * limits.promised:
            return DangerStage.EASE
        # Who told that it brakes does so for its bend as a rule, for which this driver brakes, too.
        is_due = track.braking <= 0.0 and (soon or needed >= WARN_SHARE * limits.promised)
        return DangerStage.WARN if is_due else DangerStage.INFORM
    if needed >= limits.braking:
        return DangerStage.FULL
    if time_s < EASE_S and needed >= 0.5 * limits.braking:
        return DangerStage.EASE
    return DangerStage.WARN if soon or time_s < WARN_S else DangerStage.INFORM


def _advice(stage: DangerStage, aside: float, limits: Limits) -> Advice:
    """Return what helps: braking, or early on steering to the side where there is more room."""
    if stage < DangerStage.WARN:
        return Advice.NONE
    if stage >= DangerStage.EASE or abs(aside) < ROOM * limits.half_width:
        return Advice.BRAKE
    return Advice.STEER_RIGHT if aside > 0.0 else Advice.STEER_LEFT


def _beside_arc(x: Floats, y: Floats, curvature: float) -> tuple[Floats, Floats]:
    """Return how far along an arc points lie, and how far to the left of it [m]."""
    if abs(curvature) < STRAIGHT:
        return x, y
    along, inside = way_along(x, y, curvature)
    return along, math.copysign(1.0, curvature) * inside


def watch_danger(danger: Danger) -> Verdict:
    """Return what a danger allows: nothing but a word, no motor, or full brakes."""
    if danger.stage is DangerStage.FULL:
        return STOP_FOR_OBSTACLE
    return EASING if danger.stage is DangerStage.EASE else Verdict()
