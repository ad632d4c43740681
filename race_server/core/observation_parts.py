"""The named parts that observations are made of: what each means, and its number."""

import math
import re
from dataclasses import dataclass

from race_server.core.state import RADAR_RAYS
from race_server.core.vehicles import FEELERS, TRAILERS

AHEAD = 16  # samples of the course ahead
NEARBY = 4  # karts reported
THINGS = 4  # item boxes and hazards reported
USES = 4  # kinds of item use
BRAKE_SHARE = 0.8  # of the reference line's braking, which `line_speed_held` plans with
MOVERS = 2  # people and vehicles reported that move in a car park


@dataclass(frozen=True)
class Part:
    """One named part of an observation."""

    name: str
    size: int  # 0: the number of lidar rays
    unit: str
    low: float
    high: float
    frame: str
    meaning: str


_SIZES = {
    "1": 1,
    "xy": 2,
    "rays": 0,
    "radar": RADAR_RAYS,
    "ahead": AHEAD,
    "karts": NEARBY,
    "things": THINGS,
    "uses": USES,
    "movers": MOVERS,
    "behind": TRAILERS - 1,
    "feelers": FEELERS,
}
_ANGLES = {"pi": math.pi, "-pi": -math.pi}

# The place of a row is the part's number in compiled code and its place in the preset "full", which
# policies and recordings rely on: add new parts at the end. A row: name, size, unit, least and
# greatest value, frame, meaning; an indented line continues the meaning.
_TABLE = """\
lidar                rays   m     0     100    kart   range of each ray, right to left, 0 where
                                                      nothing came back
lidar_before         rays   m     0     100    kart   the scan before the newest
radar                radar  m     0     80     kart   range of each ray, right to left
radar_kind           radar  Hit   0     5      kart   what each ray hit: 0 nothing, 1 border, 2
                                                      obstacle, 3 hazard, 4 kart, 5 person
speed                1      m/s   -5    40     kart   forward speed
lateral_speed        1      m/s   -20   20     kart   speed to the left
yaw_rate             1      rad/s -20   20     kart   turning rate, left positive
steering             1      rad   -1    1      kart   angle of the road wheels, left positive
progress             1      m     0     100000 course distance along the centre line from the timing
                                                      line
lateral_offset       1      m     -100  100    course distance from the centre line, left positive
heading_error        1      rad   -pi   pi     course heading against the centre line
curvature_ahead      ahead  1/m   -10   10     course curvature of the centre line at the look-ahead
                                                      distances
path_ahead_x         ahead  m     -1000 1000   kart   points of the centre line at the look-ahead
                                                      distances
path_ahead_y         ahead  m     -1000 1000   kart   points of the centre line at the look-ahead
                                                      distances
left_ahead           ahead  m     0     100    course asphalt left of the centre line at the
                                                      look-ahead distances
right_ahead          ahead  m     0     100    course asphalt right of the centre line at the
                                                      look-ahead distances
look_ahead           1      m     0     100    kart   distance between two look-ahead samples; the
                                                      first lies one step ahead
karts_x              karts  m     -1000 1000   kart   nearest karts, nearest first; 1000 where there
                                                      is none
karts_y              karts  m     -1000 1000   kart   nearest karts
karts_speed_x        karts  m/s   -80   80     kart   their velocity against the ground, in this
                                                      kart's frame
karts_speed_y        karts  m/s   -80   80     kart   their velocity against the ground, in this
                                                      kart's frame
boxes_x              things m     -1000 1000   kart   item boxes ready to be taken, nearest ahead
                                                      first; 1000 where there is none
boxes_y              things m     -1000 1000   kart   item boxes ready to be taken
hazards_x            things m     -1000 1000   kart   placed hazards, nearest ahead first; 1000
                                                      where there is none
hazards_y            things m     -1000 1000   kart   placed hazards
item                 1      item  0     255    race   number of the item held, 0 for none
speed_cap            1      m/s   0     40     race   speed allowed by flags and effects
thrust_scale         1      -     0     4      race   share of the motor's force that effects leave
grip_scale           1      -     0     1      race   share of the grip that effects and surface
                                                      leave
lights               1      s     0     60     race   time until the start, 0 once the race runs
flag                 1      Flag  0     2      race   0 green, 1 yellow, 2 red
lap                  1      laps  0     10000  race   laps completed
rank                 1      -     1     64     race   place in the race
gap_ahead            1      m     0     100000 race   distance to the kart one place ahead, 0 for
                                                      the leader
gap_behind           1      m     0     100000 race   distance to the kart one place behind, 0 for
                                                      the last
wrong_way            1      -     0     1      race   1 while driving the wrong way
rescue_offered       1      -     0     1      race   1 while the kart counts as stuck
finished             1      -     0     1      race   1 once the race is over for this kart
line_offset          1      m     -100  100    line   distance from the reference line, left
                                                      positive; all parts of a line are 0 where the
                                                      race has none
line_heading         1      rad   -pi   pi     line   heading against the reference line
line_step            1      m     0     100    line   distance between two samples of the reference
                                                      line; the first lies abreast of the kart
line_ahead_x         ahead  m     -1000 1000   kart   points of the reference line
line_ahead_y         ahead  m     -1000 1000   kart   points of the reference line
line_curvature_ahead ahead  1/m   -10   10     line   its curvature at those points
line_speed_ahead     ahead  m/s   0     100    line   its speed at those points
line_left_ahead      ahead  m     0     100    line   asphalt to its left at those points, as far as
                                                      a fixed obstacle that the line passes
line_right_ahead     ahead  m     0     100    line   the same to its right
karts_along          karts  m     -1000 1000   line   way to the nearest karts along the reference
                                                      line, the shorter way round; 1000 where there
                                                      is none
karts_across         karts  m     -1000 1000   line   their offsets from it, left positive
item_use             uses   -     0     1      race   1 for what the item held does: acts on the
                                                      kart itself, is left behind, guards, acts on
                                                      the kart ahead
radar_before         radar  m     0     80     kart   the radar scan before the newest
goal_x               1      m     -1000 1000   kart   middle of the slot to park in, from the middle
                                                      of the body; with trailers the place of the
                                                      body when all stands straight in the middle;
                                                      all parts of a goal are 0 where there is none
goal_y               1      m     -1000 1000   kart   the same, to the left
goal_cos             1      -     -1    1      kart   cosine of the slot's heading against the
                                                      kart's
goal_sin             1      -     -1    1      kart   its sine
goal_distance        1      m     0     1000   kart   distance to the middle of the slot
goal_proximity       1      -     0     1      kart   1 / (1 + that distance in metres)
goal_bearing         1      rad   -pi   pi     kart   direction of the slot, left positive
parked_for           1      s     0     100    race   time spent in the slot, within its tolerances
position_x           1      m     -1000 1000   lot    middle of the body
position_y           1      m     -1000 1000   lot    middle of the body
heading              1      rad   -pi   pi     lot    heading of the kart
heading_cos          1      -     -1    1      lot    its cosine
heading_sin          1      -     -1    1      lot    its sine
slot_x               1      m     -1000 1000   lot    middle of the slot, or the place as of goal_x
slot_y               1      m     -1000 1000   lot    middle of the slot
slot_heading         1      rad   -pi   pi     lot    heading of a kart parked in it
to_slot_x            1      m     -1000 1000   lot    from the middle of the body to that of the
                                                      slot
to_slot_y            1      m     -1000 1000   lot    the same
velocity_x           1      m/s   -40   40     lot    velocity of the kart
velocity_y           1      m/s   -40   40     lot    velocity of the kart
position_unit        xy     -     -1    1      lot    direction of the body's middle from the
                                                      origin: x and y of a vector of length 1
slot_unit            xy     -     -1    1      lot    the same of the slot's middle
to_slot_unit         xy     -     -1    1      lot    the same from the former to the latter
velocity_unit        xy     -     -1    1      lot    the same of the velocity, 0 where it stands
hitch                1      rad   -pi   pi     kart   angle at the hitch of the nearest trailer:
                                                      positive where the vehicle points left of it;
                                                      0 without a trailer
hitch_behind         behind rad   -pi   pi     kart   the same at the hitches of further trailers
goal_turn            1      rad   -pi   pi     kart   heading of the slot against the kart's
trailer_error        1      rad   -pi   pi     kart   heading of the slot against that of the last
                                                      trailer; without one that of the kart
feelers              feelers -    0     1      kart   ranges of the vehicle's feelers, as shares of
                                                      20 m; 1 where nothing is that near, or the
                                                      vehicle has no such feeler
movers_x             movers m     -1000 1000   kart   nearest people and vehicles of a car park that
                                                      a ray of lidar or radar met in the last 5 s,
                                                      where they are if they went on as then; 100
                                                      where there is none
movers_y             movers m     -1000 1000   kart   the same, to the left; 0 where there is none
movers_speed_x       movers m/s   -80   80     kart   their velocity against the ground from one
                                                      sighting to the next, in this kart's frame
movers_speed_y       movers m/s   -80   80     kart   the same, to the left
movers_age           movers s     0     5      kart   time since a ray met them; 5 where there is
                                                      none
movers_radius        movers m     0     10     kart   half their width; 0 where there is none
trailer_along        1      m     -1000 1000   slot   middle of the last trailer from where it is to
                                                      stand, in the direction of the slot's
                                                      heading; without one that of the body
trailer_across       1      m     -1000 1000   slot   the same, to the left of that direction
gear                 1      -     -1    1      kart   direction of the last motion: 1 ahead, -1
                                                      back, 0 before the first, and without a slot
line_speed_held      1      m/s   0     100    line   speed at the last of those points from which
                                                      4/5 of the line's braking slows down in time
                                                      for all that follows; 0 without a line
"""


def _parts_in(table: str) -> tuple[Part, ...]:
    parts = []
    for row in re.sub(r"\n +", " ", table).splitlines():
        name, size, unit, low, high, frame, meaning = row.split(maxsplit=6)
        parts.append(Part(name, _SIZES[size], unit, _bound(low), _bound(high), frame, meaning))
    return tuple(parts)


def _bound(text: str) -> float:
    return _ANGLES[text] if text in _ANGLES else float(text)


PARTS = _parts_in(_TABLE)
PART_NUMBERS = {part.name: number for number, part in enumerate(PARTS)}


def numbers_of(names: str) -> tuple[int, ...]:
    """Return the numbers of parts, whose names are separated by spaces."""
    return tuple(PART_NUMBERS[name] for name in names.split())
