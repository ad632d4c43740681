"""What a vehicle with a trailer does between two looks around: moves under its own controllers.

A search over steering angles would have to find how to hold up what falls over. Over moves that
bring the hitch to an angle and hold it there, reversing is stable in the search itself. The last
move brings the trailer onto the axis of its slot, and along it to its place.
"""

import math
from typing import NamedTuple

from race_agents.planning.reversing import angle_towards, curvature_towards
from race_server.core.free_space.obstacles import Obstacles, gets_there
from race_server.core.free_space.rig import Rig, Towed, moved, pose_ahead, scale_of, way_behind
from race_server.core.kernels.geometry import Pose, clip, seen_from
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats

# What stands for an angle at the hitch on the axis of the slot.
ON_AXIS = math.inf
# Way between two decisions of the controllers [m], and how often the bodies are looked at.
SPACING, LOOKS = 0.1, 2
# A way into the slot is tried where its axis is no farther aside, as a share of the way to the
# slot, and the trailer no farther turned [rad]; it is longer than that by this factor at
# most.
ASIDE, ASKEW, LONGER = 0.6, 1.2, 1.5
LAST_STEP = 1e-4


class InLine(NamedTuple):
    """How a vehicle and its trailer have to stand at the end of a way into a slot, at most off.

    Along the slot the last step ends where they are to stand.
    """

    across: float  # [m] of the trailer's axle
    turn: float  # [rad] of the trailer
    straight: float  # [rad] at the hitch
    ahead_across: float  # [m] of the middle of the vehicle
    ahead_turn: float  # [rad] of the vehicle


# As a trailer is docked: where the vehicle stands does not matter.
DOCKED = InLine(0.05, math.radians(1.0), math.radians(3.0), math.inf, math.inf)


@kernel
def _is_clear(obstacles: Obstacles, rig: Rig, before: Towed, after: Towed) -> bool:
    """Return whether both bodies are free after a short way, and on it."""
    start, end = Pose(before.x, before.y, before.heading), Pose(after.x, after.y, after.heading)
    # A hitch that is bent too far already may straighten.
    if abs(after.angle) > max(rig.limit, abs(before.angle)):
        return False
    if not gets_there(obstacles, rig.drawn, start, end):
        return False
    return gets_there(obstacles, rig.drawing, pose_ahead(rig, before), pose_ahead(rig, after))


@kernel
def _curvature(rig: Rig, towed: Towed, wanted: float, way: float, step: float) -> float:
    """Return the curvature [1/m] of the next step [m] towards an angle at the hitch [rad]."""
    curvature = clip(curvature_towards(rig, towed.angle, wanted, 0.0, way), -rig.bend, rig.bend)
    if towed.curvature == math.inf:
        return curvature
    change = rig.bending * step
    return clip(curvature, towed.curvature - change, towed.curvature + change)


@large_kernel
def drive(
    obstacles: Obstacles,
    rig: Rig,
    start: Towed,
    goal: Pose,
    wanted: float,
    way: float,
    rows: Floats,
) -> tuple[Towed, float]:
    """Return where the trailer stands after a way [m], and how much of it was driven.

    start: its curvature is infinite where the wheels may turn at a stand; goal: of the trailer's
    axle; wanted: angle at the hitch [rad] to go to, or ON_AXIS of the goal, to its end; way: of the
    rear axle [m], negative in reverse; rows: (R, 3), filled for each step with its curvature [1/m],
    its way [m] and the angle at the hitch after it [rad]; R steps are driven at most. The way ends
    where something is in the way, and where the angle at the hitch gets too large.
    """
    full = SPACING * scale_of(rig.bar)
    towed = last = start
    free, count = 0.0, 0
    driven, most = 0.0, abs(way)
    while driven < most - 1e-9 and count < len(rows):
        step, angle = min(full, most - driven), wanted
        is_last = most - driven <= full + 1e-9
        if wanted == ON_AXIS:
            seen = seen_from(goal, Pose(towed.x, towed.y, towed.heading))
            angle = angle_towards(rig, seen.y, seen.heading, 0.0, way)
            left = -seen.x if way > 0.0 else seen.x
            left /= max(way_behind(rig, towed.angle, 0.0), 0.3)
            is_last = is_last or left <= step
            step = min(step, left)
            if left < LAST_STEP:
                break
        curvature = _curvature(rig, towed, angle, way, step)
        towed = moved(rig, towed, curvature, math.copysign(step, way))
        rows[count, 0], rows[count, 1] = curvature, math.copysign(step, way)
        rows[count, 2] = towed.angle
        driven, count = driven + step, count + 1
        if count % LOOKS == 0 or is_last:
            if not _is_clear(obstacles, rig, last, towed):
                return last, math.copysign(free, way)
            last, free = towed, driven
    return last, math.copysign(free, way)


@kernel
def direction_in(goal: Pose, place: Pose) -> float:
    """Return the direction of travel from a place of the trailer's axle to its goal."""
    return 1.0 if seen_from(goal, place).x < 0.0 else -1.0


@kernel
def _is_in(rig: Rig, goal: Pose, towed: Towed, asked: InLine) -> bool:
    """Return whether a trailer and what draws it stand as they are to stand."""
    seen = seen_from(goal, Pose(towed.x, towed.y, towed.heading))
    aligned = abs(seen.heading) <= asked.turn and abs(towed.angle) <= asked.straight
    if not (aligned and abs(seen.y) <= asked.across and abs(seen.x) <= asked.across):
        return False
    ahead = seen_from(goal, pose_ahead(rig, towed))
    across = ahead.y + rig.drawing.middle * math.sin(ahead.heading)
    return abs(across) <= asked.ahead_across and abs(ahead.heading) <= asked.ahead_turn


@large_kernel
def way_in(
    obstacles: Obstacles,
    rig: Rig,
    start: Towed,
    goal: Pose,
    asked: InLine,
    way: float,
    rows: Floats,
) -> float:
    """Return the way [m] on which a vehicle brings its trailer into the slot; infinite if none.

    way: the direction of travel. The other arguments as for `drive`.
    """
    seen = seen_from(goal, Pose(start.x, start.y, start.heading))
    left = -seen.x if way > 0.0 else seen.x
    if left <= 0.0 or abs(seen.heading) > ASKEW or abs(seen.y) > ASIDE * left + asked.across:
        return math.inf
    end, driven = drive(
        obstacles, rig, start, goal, ON_AXIS, math.copysign(LONGER * left, way), rows
    )
    return driven if _is_in(rig, goal, end, asked) else math.inf
