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

import numpy as np

from race_agents.unit.drift import Arcs
from race_agents.unit.foreseen import CREEP
from race_agents.unit.limits import CERTAIN, Limits
from race_agents.unit.meeting import NO_MEETING, Ahead, Meeting, needed_for, order_of
from race_agents.unit.safety import STOP_FOR_OBSTACLE, Echoes, Verdict, in_the_way
from race_agents.unit.track import BORN, Track
from race_server.core import codes
from race_server.core.alert import Advice, Cause, Danger, DangerStage
from race_server.core.messages import RayHit

NO_DANGER = Danger()
# The motor goes off, and a little braking shows the driver that it is meant.
EASING = Verdict(brake=0.3, motor=0.0, cause=Cause.OBSTACLE)
# People count from this scan on, at first only while they are seen; karts once it is known how
# they move.
SEEN = 2
# A kart is met by several beams: one that more scans than this did not show has turned off, and is
# no longer where it would be by its last speed.
LOST = 2
# Where there is room on one side within this time [s] steering is told.
ROOM = 0.3


def worst_ahead(tracks: Sequence[Track], loose: Echoes, arcs: Arcs, limits: Limits) -> Danger:
    """Return the worst that is ahead: of the objects, or of the echoes that the reflex brakes for.

    loose: echoes that are of no kart whose way is known.
    """
    # No way is tighter than tyres hold: a kart that turns faster spins, and goes straight on.
    speed, drift = arcs.speed, arcs.drift
    most = limits.grip / (CERTAIN * max(speed * speed, 1e-6))
    now, wanted = (max(-most, min(each, most)) for each in (arcs.now, arcs.wanted))
    limits, loose = drift.limits(limits), drift.echoes(loose)
    steers = not drift.slides
    there = drift.tracks(tracks)
    danger = assess(there, speed, now, wanted, limits, steers=steers, braking=arcs.braking)
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
        needed_for(closing, distance, 0.0) if comes else 0.0,
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
    braking: float = 0.0,
) -> Danger:
    """Return the worst danger of all objects along the two arcs.

    now, wanted: curvatures [1/m] that the kart drives, and that its driver steers to; steers:
    whether it goes where its front wheels point; braking: [m/s²] that its driver does already.
    """
    counted = [track for track in tracks if _counts(track)]
    if speed < CREEP or not counted:
        return NO_DANGER
    ahead = Ahead(counted, speed, (now, wanted), limits, braking)
    worst, of = NO_MEETING, counted[0]
    for place, track in enumerate(counted):
        is_kart = track.kind == codes.KART_HIT
        meeting = ahead.meeting(place, 0)
        # Who steers past a kart passes it; a person on either way is in danger.
        has_two_ways = meeting is not NO_MEETING if is_kart else steers
        if has_two_ways:
            meeting = (min if is_kart else max)(meeting, ahead.meeting(place, 1), key=order_of)
        if is_kart and track.missed > LOST:
            meeting = meeting._replace(stage=min(meeting.stage, DangerStage.EASE))
        if order_of(meeting) > order_of(worst):
            worst, of = meeting, track
    return _danger(worst, of, limits)


def _counts(track: Track) -> bool:
    is_young = track.scans < BORN
    return track.scans >= SEEN and not (
        is_young and (track.kind == codes.KART_HIT or track.missed > 0)
    )


def severity_of(danger: Danger) -> tuple[int, float]:
    """Return by what dangers are ordered: how far each has come, and the braking needed."""
    return int(danger.stage), danger.needed


def danger_of(track: Track, speed: float, curvature: float, limits: Limits) -> Danger:
    """Return how dangerous one object is along one arc at this speed."""
    return _danger(Ahead((track,), speed, (curvature,), limits).meeting(0, 0), track, limits)


def _danger(meeting: Meeting, track: Track, limits: Limits) -> Danger:
    """Return the danger of an object that is met."""
    if meeting is NO_MEETING:
        return NO_DANGER
    x, y = float(track.state[0]), float(track.state[1])
    return Danger(
        meeting.stage,
        RayHit(track.kind),
        math.atan2(y, x - limits.nose),
        max(math.hypot(x, y) - limits.nose, 0.0),
        meeting.time_s,
        meeting.needed,
        _advice(meeting.stage, meeting.aside, limits),
    )


def _advice(stage: DangerStage, aside: float, limits: Limits) -> Advice:
    """Return what helps: braking, or early on steering to the side where there is more room."""
    if stage < DangerStage.WARN:
        return Advice.NONE
    if stage >= DangerStage.EASE or abs(aside) < ROOM * limits.half_width:
        return Advice.BRAKE
    return Advice.STEER_RIGHT if aside > 0.0 else Advice.STEER_LEFT


def watch_danger(danger: Danger) -> Verdict:
    """Return what a danger allows: nothing but a word, no motor, or full brakes."""
    if danger.stage is DangerStage.FULL:
        return STOP_FOR_OBSTACLE
    return EASING if danger.stage is DangerStage.EASE else Verdict()
