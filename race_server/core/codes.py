"""Plain integers for the kernels, equal to the enumerations of `messages`, and small bit sets."""

from race_server.core.messages import (
    Button,
    Cleanness,
    Ending,
    EventKind,
    Flag,
    RayHit,
    Retirement,
    Status,
    Trust,
)

ABSENT, RACING, FINISHED, RETIRED = (int(status) for status in Status)
GREEN, YELLOW, RED = (int(flag) for flag in Flag)

# How the pose of a kart is taken: no contact from DOUBTFUL on, seen by no sensor from SUSPENDED on.
SIMULATED, TRUSTED, DOUBTFUL, SUSPENDED, OUT = (int(trust) for trust in Trust)
# Moved by another simulator in a training world: all but its motion is that of a simulated one.
ELSEWHERE = SIMULATED - 1

# Contact policies of a scenario.
BUMP, RETIRE, GHOST = 0, 1, 2
CONTACT_POLICIES = {"bump": BUMP, "retire": RETIRE, "ghost": GHOST}

# What a ray hits.
NOTHING, BORDER, OBSTACLE, HAZARD_HIT, KART_HIT, PERSON = (int(hit) for hit in RayHit)

# Sensors that a kart carries.
LIDAR, RADAR = 1, 2

# What using an item does.
ON_SELF, PLACED, GUARD, ON_KART_AHEAD = 1, 2, 3, 4

# Surfaces.
ASPHALT, KERB, GRASS = 0, 1, 2

CLEAN = int(Cleanness.CLEAN)
UNCLEAN = int(Cleanness.UNCLEAN)

USE_ITEM = int(Button.USE_ITEM)
ACCEPT_RESCUE = int(Button.ACCEPT_RESCUE)

CRASH = int(Retirement.CRASH)
WITHDREW = int(Retirement.WITHDREW)
WENT_WRONG_WAY = int(Retirement.WRONG_WAY)
STOPPED = int(Retirement.STOPPED)
TIME_OUT = int(Retirement.TIME_OUT)
RAMMING = int(Retirement.RAMMING)
LOST = int(Retirement.LOST)
LEFT_LOT = int(Retirement.LEFT_LOT)
HIT_PERSON = int(Retirement.HIT_PERSON)
JACK_KNIFE = int(Retirement.JACK_KNIFE)
OWN_BODY = int(Retirement.OWN_BODY)
REMOVED = int(Retirement.REMOVED)

_ENDINGS = tuple(int(ending) for ending in Ending)
OPEN, IS_PARKED, IS_LATE, HAS_LEFT, MET_WALL, MET_BLOCK, MET_VEHICLE, MET_PERSON = _ENDINGS[:8]
HAS_GONE, HAS_JACK_KNIFED, MET_ITSELF = _ENDINGS[8:]

EVENT_GREEN = int(EventKind.GREEN)
EVENT_LAP = int(EventKind.LAP)
EVENT_SECTOR = int(EventKind.SECTOR)
EVENT_FINISH = int(EventKind.FINISH)
EVENT_RETIRED = int(EventKind.RETIRED)
EVENT_PICK_UP = int(EventKind.PICK_UP)
EVENT_USE = int(EventKind.USE)
EVENT_HIT = int(EventKind.HIT)
EVENT_BLOCKED_HIT = int(EventKind.BLOCKED_HIT)
EVENT_EFFECT_END = int(EventKind.EFFECT_END)
EVENT_CONTACT_KART = int(EventKind.CONTACT_KART)
EVENT_CONTACT_WALL = int(EventKind.CONTACT_WALL)
EVENT_FALSE_START = int(EventKind.FALSE_START)
EVENT_SHORT_CUT = int(EventKind.SHORT_CUT)
EVENT_WRONG_WAY = int(EventKind.WRONG_WAY)
EVENT_OFF_TRACK = int(EventKind.OFF_TRACK)
EVENT_STUCK = int(EventKind.STUCK)
EVENT_RESCUED = int(EventKind.RESCUED)
EVENT_PENALTY = int(EventKind.PENALTY)
EVENT_FLAG = int(EventKind.FLAG)
EVENT_RACE_OVER = int(EventKind.RACE_OVER)
EVENT_WARNING = int(EventKind.WARNING)
EVENT_POSE = int(EventKind.POSE)
EVENT_PARKED = int(EventKind.PARKED)
EVENT_HIT_PERSON = int(EventKind.HIT_PERSON)
