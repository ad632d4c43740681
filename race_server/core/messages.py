"""Plain data that crosses borders: what a driver sends and what it receives.

The numbers of all enumerations are those of `schemas/codes.fbs`; a test compares them.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import IntEnum, IntFlag
from typing import Any

from race_server.core.stint import Stint


class Phase(IntEnum):
    """The life of a session."""

    LOBBY = 0
    COUNTDOWN = 1
    RUNNING = 2
    FINISHED = 3


class EventPhase(IntEnum):
    """Where an event of several attempts and races stands."""

    CALLED = 0  # the server waits for the drivers of the next attempt or race
    ON_TRACK = 1
    REVIEWED = 2  # stewards may still change the results of a stage
    OVER = 3


class Flag(IntEnum):
    """The flag shown to karts."""

    GREEN = 0
    YELLOW = 1
    RED = 2


class Status(IntEnum):
    """The state of one kart in the race."""

    ABSENT = 0
    RACING = 1
    FINISHED = 2
    RETIRED = 3


class Button(IntFlag):
    """What a driver presses."""

    NONE = 0
    USE_ITEM = 1
    ACCEPT_RESCUE = 2


class KartFlag(IntFlag):
    """What else is known of a kart in a snapshot."""

    WRONG_WAY = 1
    OFF_TRACK = 2
    RESCUE_OFFERED = 4
    IMMUNE = 8  # a shield is up, or hits do nothing
    REAL = 16  # moved by its own poses
    DOUBTFUL = 32  # as in Trust
    SUSPENDED = 64  # as in Trust, or out for good: no sensor sees it
    YELLOW = 128  # a yellow flag is shown to it, for a kart near it that is in doubt


class RayHit(IntEnum):
    """What a ray of a sensor hits."""

    NOTHING = 0
    BORDER = 1
    OBSTACLE = 2
    HAZARD = 3
    KART = 4
    PERSON = 5


class EventKind(IntEnum):
    """What happened in the world, and how `value`, `other`, `detail` of the event are read."""

    GREEN = 1  # the lights went out
    LAP = 2  # value: lap time [µs]; other: number of the lap; detail: see Cleanness
    SECTOR = 3  # value: sector time [µs]; other: number of the sector, from 1
    FINISH = 4  # value: race time [µs]
    RETIRED = 5  # other: Retirement
    PICK_UP = 6  # other: item
    USE = 7  # other: item
    HIT = 8  # value: item; other: kart that caused it, -1 for none
    BLOCKED_HIT = 9  # by a shield or immunity; value: item; other: kart that caused it
    EFFECT_END = 10  # other: item
    CONTACT_KART = 11  # value: impulse [N s] · 1000; other: the other kart
    CONTACT_WALL = 12  # value: impulse [N s] · 1000
    FALSE_START = 13
    SHORT_CUT = 14  # other: gate that was missed
    WRONG_WAY = 15  # value: 1 begins, 0 ends
    OFF_TRACK = 16  # value: 1 leaves, 0 returns
    STUCK = 17  # a rescue is offered
    RESCUED = 18
    PENALTY = 19  # value: [µs]; other: EventKind that it is for
    FLAG = 20  # other: Flag; kart: the one it is shown around, -1 for the course
    PHASE = 21  # other: Phase
    RACE_OVER = 22
    WARNING = 23  # drove into a kart from behind; value: warnings so far; other: that kart
    POSE = 24  # of a real kart; value: PoseFault; other: Trust from now on
    PARKED = 25  # value: heading against the slot's [mrad]; other: number of the slot, or -1
    HIT_PERSON = 26  # value: speed [mm/s]; other: number of the person


class Cleanness(IntEnum):
    """Whether a lap was driven without wall contact, short cut, rescue or leaving the course."""

    UNKNOWN = 0  # of a recording from before LAP events carried it
    CLEAN = 1
    UNCLEAN = 2


class Merit(IntEnum):
    """How a time of a sector or mini-sector compares, as live timing colours it."""

    NONE = 0  # not driven yet
    SLOWER = 1  # than its own best: yellow
    OWN_BEST = 2  # green
    BEST = 3  # of all: purple


_MERITS = "sector_merits", "mini_merits"  # in `Timing`


class Retirement(IntEnum):
    """Why a kart is out."""

    CRASH = 1
    WITHDREW = 2
    WRONG_WAY = 3
    STOPPED = 4
    TIME_OUT = 5
    RAMMING = 6
    LOST = 7  # a real kart whose poses stayed bad for too long
    LEFT_LOT = 8  # too far from the slot
    HIT_PERSON = 9
    JACK_KNIFE = 10  # the angle at a hitch was too large
    OWN_BODY = 11  # a trailer touched what draws it
    REMOVED = 12  # by the stewards; value of the event: Fault


class Fault(IntEnum):
    """Why stewards remove a kart from its race."""

    OTHER = 0
    WRONG_WAY = 1
    STANDING = 2
    RAMMING = 3
    DANGEROUS = 4
    DEFECT = 5


class Ending(IntEnum):
    """How the way of a vehicle to its slot ended."""

    OPEN = 0  # it has not
    PARKED = 1
    LATE = 2  # the time was up
    LEFT = 3  # too far from the slot
    WALL = 4  # it ran into a wall,
    BLOCK = 5  # an obstacle,
    VEHICLE = 6  # another vehicle,
    PERSON = 7  # a person
    WITHDREW = 8  # its driver has gone
    JACK_KNIFE = 9  # the angle at a hitch was too large
    OWN_BODY = 10  # a trailer touched what draws it


class Trust(IntEnum):
    """How the server takes the pose of a kart."""

    SIMULATED = 0  # computed by the server
    TRUSTED = 1  # sent by a real kart, and plausible
    DOUBTFUL = 2  # implausible or missing: no contact with others, yellow flag around it
    SUSPENDED = 3  # doubtful for too long: out of the race until its poses are good again
    OUT = 4  # for good


class PoseFault(IntEnum):
    """Why a pose is refused."""

    NONE = 0
    SILENT = 1  # no pose arrives
    STALE = 2  # too old
    SPEED = 3  # faster than the kart can be
    JUMP = 4  # too far from the pose before
    OFF_WORLD = 5  # beyond the borders of the course
    POOR = 6  # the kart itself does not trust it
    DEAF = 7  # the kart does not acknowledge its orders


@dataclass(frozen=True, slots=True)
class Control:
    """What a driver commands until its next decision.

    steering: [-1, 1] share of the steering limit, left positive. throttle: [-1, 1], negative
    drives in reverse. brake: [0, 1].
    """

    steering: float = 0.0
    throttle: float = 0.0
    brake: float = 0.0
    buttons: Button = Button.NONE


class Source(IntEnum):
    """Where the position of a real kart came from."""

    UNKNOWN = 0
    SATELLITES = 1
    CORRECTED_SATELLITES = 2
    BEACONS = 3
    DEAD_RECKONING = 4


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a real kart says it is. SI units; see `schemas/drive.fbs`."""

    stamp_us: int  # of the kart's own clock
    x: float
    y: float
    heading: float
    speed: float
    lateral_speed: float = 0.0
    yaw_rate: float = 0.0
    steering: float = 0.0
    deviation: float = 0.0
    quality: float = 1.0
    source: Source = Source.UNKNOWN
    echo_us: int = 0  # of the server's clock, 0 for none


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened in the world."""

    sequence: int
    tick: int
    kind: EventKind
    kart: int  # -1 where it concerns the whole race
    other: int
    value: int
    detail: int = 0


@dataclass(frozen=True, slots=True)
class Parking:
    """How a vehicle fares on its way to its slot."""

    ending: Ending
    slot: int  # number, -1 where the lot has none
    way: float  # [m] driven, forward and back
    reversed: float  # [m] of it in reverse
    moves: int  # changes of direction
    walked_into: int  # people who ran into it while it stood


@dataclass(frozen=True)
class PlannedWay:
    """How a task of parking is planned, without anything that moves."""

    time_s: float  # along the path at its speeds, and until the vehicle counts as parked
    path_m: float
    direction_changes: int


@dataclass(frozen=True)
class Timing:
    """What live timing shows of a kart beside its laps."""

    interval_us: int  # to the kart one place ahead; 0 where it is not known
    laps_down: int  # whole laps behind the leader
    gained: int  # places since the grid
    theoretical_us: int  # sum of its best sectors; 0 until it has driven each
    sectors_us: tuple[int, ...]  # of this lap; of the last one until the first is through
    sector_merits: tuple[Merit, ...]
    mini_merits: tuple[Merit, ...]  # of twenty equal parts of a lap, in the same way
    stints: tuple[Stint, ...] = ()  # oldest first

    def as_json(self) -> dict[str, Any]:
        """Return plain data; merits by their names."""
        named = {name: [merit.name.lower() for merit in getattr(self, name)] for name in _MERITS}
        lists = {"sectors_us": list(self.sectors_us), "stints": list(map(asdict, self.stints))}
        return {**asdict(self), **lists, **named}

    @staticmethod
    def of_json(words: Mapping[str, Any]) -> "Timing":
        """Return what `as_json` took apart."""
        named = {name: tuple(Merit[merit.upper()] for merit in words[name]) for name in _MERITS}
        stints = tuple(Stint(**one) for one in words.get("stints", ()))  # none in older results
        lists = {"sectors_us": tuple(words["sectors_us"]), "stints": stints}
        return Timing(**{**words, **lists, **named})


@dataclass(frozen=True)
class Standing:
    """One row of the live standings or the results."""

    seat: int
    driver: str
    rank: int
    laps: int
    status: Status
    last_lap_us: int
    best_lap_us: int
    race_time_us: int  # penalties included
    gap_us: int  # to the leader, at the last mini-gate or of race times; 0 where it is not known
    penalties: int
    penalty_us: int
    items_used: int
    lap_times_us: tuple[int, ...] = field(default=())
    parking: Parking | None = None  # only in a car park
    # Of the same task, where a driver outside of the server has parked.
    planned: PlannedWay | None = None
    timing: Timing | None = None  # only on a course

    def as_json(self) -> dict[str, Any]:
        """Return the row as plain data; what has a name by its name."""
        words = asdict(self)
        words |= {"status": self.status.name.lower(), "lap_times_us": list(self.lap_times_us)}
        if self.parking is not None:
            words["parking"]["ending"] = self.parking.ending.name.lower()
        if self.timing is not None:
            words["timing"] = self.timing.as_json()
        missing = {name for name in ("parking", "planned", "timing") if words[name] is None}
        return {name: value for name, value in words.items() if name not in missing}

    @staticmethod
    def of_json(words: Mapping[str, Any]) -> "Standing":
        """Return the row that `as_json` took apart."""
        parking, planned, timing = (words.get(name) for name in ("parking", "planned", "timing"))
        return Standing(
            **{
                **words,
                "status": Status[words["status"].upper()],
                "lap_times_us": tuple(words["lap_times_us"]),
                "parking": parking
                and Parking(**{**parking, "ending": Ending[parking["ending"].upper()]}),
                "planned": planned and PlannedWay(**planned),
                "timing": timing and Timing.of_json(timing),
            }
        )
