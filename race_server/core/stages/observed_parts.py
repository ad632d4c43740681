"""What the functions share that fill observations: part numbers, groups, the kart's frame.

Parts that need the same numbers form a group: one function fills all parts of a group. A part that
the layout lacks has the offset -1, and what it would show is dropped.
"""

from typing import NamedTuple

from race_server.core.kernels.jit import kernel
from race_server.core.observation import numbers_of
from race_server.core.state import Float32s, Ints, Records

# The groups, and the number of each part in them.
SCANS = numbers_of("lidar lidar_before radar radar_kind radar_before")
LIDAR, LIDAR_BEFORE, RADAR, RADAR_KIND, RADAR_BEFORE = SCANS

MOTION = numbers_of("speed lateral_speed yaw_rate steering")
SPEED, LATERAL_SPEED, YAW_RATE, STEERING = MOTION

GAME = numbers_of("item item_use speed_cap thrust_scale grip_scale")
ITEM, ITEM_USE, SPEED_CAP, THRUST_SCALE, GRIP_SCALE = GAME

RACE = numbers_of("lights flag lap rank gap_ahead gap_behind wrong_way rescue_offered finished")
LIGHTS, FLAG, LAP, RANK, GAP_AHEAD, GAP_BEHIND, WRONG_WAY, RESCUE_OFFERED, FINISHED = RACE

PLACE = numbers_of("progress lateral_offset heading_error look_ahead")
PROGRESS, LATERAL_OFFSET, HEADING_ERROR, LOOK_AHEAD = PLACE

COURSE = numbers_of("curvature_ahead path_ahead_x path_ahead_y left_ahead right_ahead")
CURVATURE, PATH_X, PATH_Y, LEFT, RIGHT = COURSE

LINE = numbers_of(
    "line_offset line_heading line_step line_ahead_x line_ahead_y "
    "line_curvature_ahead line_speed_ahead line_left_ahead line_right_ahead line_speed_held"
)
LINE_OFFSET, LINE_HEADING, LINE_STEP = LINE[:3]
LINE_X, LINE_Y, LINE_CURVATURE, LINE_SPEED, LINE_LEFT, LINE_RIGHT = LINE_AHEAD = LINE[3:9]
LINE_HELD = LINE[9]

KARTS = numbers_of("karts_x karts_y karts_speed_x karts_speed_y karts_along karts_across")
KARTS_X, KARTS_Y, KARTS_SPEED_X, KARTS_SPEED_Y, KARTS_ALONG, KARTS_ACROSS = KARTS
KARTS_ON_LINE = (KARTS_ALONG, KARTS_ACROSS)

BOXES = BOXES_X, BOXES_Y = numbers_of("boxes_x boxes_y")
HAZARDS_AHEAD = HAZARDS_X, HAZARDS_Y = numbers_of("hazards_x hazards_y")

GOAL = numbers_of(
    "goal_x goal_y goal_cos goal_sin goal_distance goal_proximity goal_bearing parked_for "
    "slot_x slot_y slot_heading to_slot_x to_slot_y slot_unit to_slot_unit "
    "goal_turn trailer_error trailer_along trailer_across gear"
)
GOAL_X, GOAL_Y, GOAL_COS, GOAL_SIN, GOAL_DISTANCE, GOAL_PROXIMITY, GOAL_BEARING = GOAL[:7]
PARKED_FOR, SLOT_X, SLOT_Y, SLOT_HEADING, TO_SLOT_X, TO_SLOT_Y = GOAL[7:13]
SLOT_UNIT, TO_SLOT_UNIT = GOAL_UNITS = GOAL[13:15]
GOAL_TURN, TRAILER_ERROR, TRAILER_ALONG, TRAILER_ACROSS, GEAR = GOAL[15:]

HITCHES = HITCH, HITCH_BEHIND = numbers_of("hitch hitch_behind")
FEELING = numbers_of("feelers")
FEELERS = FEELING[0]

LOT = numbers_of(
    "position_x position_y heading heading_cos heading_sin velocity_x velocity_y "
    "position_unit velocity_unit"
)
POSITION_X, POSITION_Y, HEADING, HEADING_COS, HEADING_SIN, VELOCITY_X, VELOCITY_Y = LOT[:7]
POSITION_UNIT, VELOCITY_UNIT = LOT[7:]

MOVING = numbers_of("movers_x movers_y movers_speed_x movers_speed_y movers_age movers_radius")
MOVERS_X, MOVERS_Y, MOVERS_SPEED_X, MOVERS_SPEED_Y, MOVERS_AGE, MOVERS_RADIUS = MOVING

GROUPS = (
    *(SCANS, MOTION, GAME, RACE, PLACE, COURSE, LINE, KARTS, BOXES, HAZARDS_AHEAD),
    *(GOAL, LOT, HITCHES, FEELING, MOVING),
)


class KartFrame(NamedTuple):
    """Place [m] and direction of the kart that observes, in the world frame."""

    x: float
    y: float
    cos: float
    sin: float


@kernel
def shows(offsets: Ints, group: tuple[int, ...]) -> bool:
    """Return whether the layout has any part of a group."""
    for number in group:
        if offsets[number] >= 0:
            return True
    return False


@kernel
def put(out: Float32s, offset: int, index: int, value: float) -> None:
    """Write element `index` of the part at `offset`, unless the layout lacks it."""
    if offset >= 0:
        out[offset + index] = value


@kernel
def put_all(out: Float32s, offset: int, values: Records) -> None:
    """Write all of the part at `offset`, shape (size of the part,), unless the layout lacks it."""
    if offset >= 0:
        for index in range(len(values)):
            out[offset + index] = values[index]


@kernel
def to_frame(frame: KartFrame, x: float, y: float) -> tuple[float, float]:
    """Return a point of the world [m] in the frame of the kart: ahead, to the left."""
    dx, dy = x - frame.x, y - frame.y
    return dx * frame.cos + dy * frame.sin, dy * frame.cos - dx * frame.sin
