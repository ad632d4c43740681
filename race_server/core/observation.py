"""What a driver sees: named parts, put together to presets.

An observation is one float32 vector in SI units. The same kernel (`core/stages/observe.py`)
fills it for training and for the live server. "Ahead" is along the centre line; the kart frame
has x ahead and y to the left.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from race_server.errors import ScenarioError

AHEAD = 16  # samples of the course ahead
NEARBY = 4  # karts that are told of
THINGS = 4  # item boxes and hazards that are told of
USES = 4  # of items
RADAR_RAYS = 9


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


def _scalar(
    name: str, unit: str, low: float, high: float, meaning: str, frame: str = "kart"
) -> Part:
    return Part(name, 1, unit, low, high, frame, meaning)


# The order is the part's number in the compiled code: add at the end, see `core/stages/observe`.
PARTS = (
    Part(
        "lidar",
        0,
        "m",
        0,
        100,
        "kart",
        "range of each ray, right to left, 0 where nothing came back",
    ),
    Part("lidar_before", 0, "m", 0, 100, "kart", "the scan before the newest"),
    Part("radar", RADAR_RAYS, "m", 0, 80, "kart", "range of each ray, right to left"),
    Part(
        "radar_kind",
        RADAR_RAYS,
        "Hit",
        0,
        4,
        "kart",
        "what each ray hit: 0 nothing, 1 border, 2 obstacle, 3 hazard, 4 kart",
    ),
    _scalar("speed", "m/s", -5, 40, "forward speed"),
    _scalar("lateral_speed", "m/s", -20, 20, "speed to the left"),
    _scalar("yaw_rate", "rad/s", -20, 20, "turning rate, left positive"),
    _scalar("steering", "rad", -1, 1, "angle of the road wheels, left positive"),
    _scalar(
        "progress", "m", 0, 1e5, "distance along the centre line from the timing line", "course"
    ),
    _scalar(
        "lateral_offset", "m", -100, 100, "distance from the centre line, left positive", "course"
    ),
    _scalar("heading_error", "rad", -np.pi, np.pi, "heading against the centre line", "course"),
    Part(
        "curvature_ahead",
        AHEAD,
        "1/m",
        -10,
        10,
        "course",
        "curvature of the centre line at the look-ahead distances",
    ),
    Part(
        "path_ahead_x",
        AHEAD,
        "m",
        -1e3,
        1e3,
        "kart",
        "points of the centre line at the look-ahead distances",
    ),
    Part(
        "path_ahead_y",
        AHEAD,
        "m",
        -1e3,
        1e3,
        "kart",
        "points of the centre line at the look-ahead distances",
    ),
    Part(
        "left_ahead",
        AHEAD,
        "m",
        0,
        100,
        "course",
        "asphalt left of the centre line at the look-ahead distances",
    ),
    Part(
        "right_ahead",
        AHEAD,
        "m",
        0,
        100,
        "course",
        "asphalt right of the centre line at the look-ahead distances",
    ),
    _scalar(
        "look_ahead",
        "m",
        0,
        100,
        "distance between two look-ahead samples; the first lies one step ahead",
    ),
    Part(
        "karts_x",
        NEARBY,
        "m",
        -1e3,
        1e3,
        "kart",
        "nearest karts, nearest first; 1000 where there is none",
    ),
    Part("karts_y", NEARBY, "m", -1e3, 1e3, "kart", "nearest karts"),
    Part(
        "karts_speed_x",
        NEARBY,
        "m/s",
        -80,
        80,
        "kart",
        "their velocity against the ground, in this kart's frame",
    ),
    Part(
        "karts_speed_y",
        NEARBY,
        "m/s",
        -80,
        80,
        "kart",
        "their velocity against the ground, in this kart's frame",
    ),
    Part(
        "boxes_x",
        THINGS,
        "m",
        -1e3,
        1e3,
        "kart",
        "item boxes ready to be taken, nearest ahead first; 1000 where there is none",
    ),
    Part("boxes_y", THINGS, "m", -1e3, 1e3, "kart", "item boxes ready to be taken"),
    Part(
        "hazards_x",
        THINGS,
        "m",
        -1e3,
        1e3,
        "kart",
        "placed hazards, nearest ahead first; 1000 where there is none",
    ),
    Part("hazards_y", THINGS, "m", -1e3, 1e3, "kart", "placed hazards"),
    _scalar("item", "item", 0, 255, "number of the item held, 0 for none", "race"),
    _scalar("speed_cap", "m/s", 0, 40, "speed allowed by flags and effects", "race"),
    _scalar("thrust_scale", "-", 0, 4, "share of the motor's force that effects leave", "race"),
    _scalar("grip_scale", "-", 0, 1, "share of the grip that effects and surface leave", "race"),
    _scalar("lights", "s", 0, 60, "time until the start, 0 once the race runs", "race"),
    _scalar("flag", "Flag", 0, 2, "0 green, 1 yellow, 2 red", "race"),
    _scalar("lap", "laps", 0, 1e4, "laps completed", "race"),
    _scalar("rank", "-", 1, 64, "place in the race", "race"),
    _scalar(
        "gap_ahead", "m", 0, 1e5, "distance to the kart one place ahead, 0 for the leader", "race"
    ),
    _scalar(
        "gap_behind", "m", 0, 1e5, "distance to the kart one place behind, 0 for the last", "race"
    ),
    _scalar("wrong_way", "-", 0, 1, "1 while driving the wrong way", "race"),
    _scalar("rescue_offered", "-", 0, 1, "1 while the kart counts as stuck", "race"),
    _scalar("finished", "-", 0, 1, "1 once the race is over for this kart", "race"),
    _scalar(
        "line_offset",
        "m",
        -100,
        100,
        "distance from the reference line, left positive; all parts of a line are 0 where the "
        "race has none",
        "line",
    ),
    _scalar("line_heading", "rad", -np.pi, np.pi, "heading against the reference line", "line"),
    _scalar(
        "line_step",
        "m",
        0,
        100,
        "distance between two samples of the reference line; the first lies abreast of the kart",
        "line",
    ),
    Part("line_ahead_x", AHEAD, "m", -1e3, 1e3, "kart", "points of the reference line"),
    Part("line_ahead_y", AHEAD, "m", -1e3, 1e3, "kart", "points of the reference line"),
    Part("line_curvature_ahead", AHEAD, "1/m", -10, 10, "line", "its curvature at those points"),
    Part("line_speed_ahead", AHEAD, "m/s", 0, 100, "line", "its speed at those points"),
    Part(
        "line_left_ahead",
        AHEAD,
        "m",
        0,
        100,
        "line",
        "asphalt to its left at those points, as far as a fixed obstacle that the line passes",
    ),
    Part("line_right_ahead", AHEAD, "m", 0, 100, "line", "the same to its right"),
    Part(
        "karts_along",
        NEARBY,
        "m",
        -1e3,
        1e3,
        "line",
        "way to the nearest karts along the reference line, the shorter way round; 1000 where "
        "there is none",
    ),
    Part("karts_across", NEARBY, "m", -1e3, 1e3, "line", "their offsets from it, left positive"),
    Part(
        "item_use",
        USES,
        "-",
        0,
        1,
        "race",
        "1 for what the item held does: acts on the kart itself, is left behind, guards, acts on "
        "the kart ahead",
    ),
)

PART_NUMBERS = {part.name: number for number, part in enumerate(PARTS)}

_GAME = (
    "item",
    "speed_cap",
    "thrust_scale",
    "grip_scale",
    "lights",
    "flag",
    "lap",
    "rank",
    "wrong_way",
    "rescue_offered",
    "finished",
)
_TRACK = (
    "progress",
    "lateral_offset",
    "heading_error",
    "curvature_ahead",
    "path_ahead_x",
    "path_ahead_y",
    "left_ahead",
    "right_ahead",
    "look_ahead",
)
_LINE = (
    "line_offset",
    "line_heading",
    "line_step",
    "line_ahead_x",
    "line_ahead_y",
    "line_curvature_ahead",
    "line_speed_ahead",
    "line_left_ahead",
    "line_right_ahead",
)
_WORLD = (
    "karts_x",
    "karts_y",
    "karts_speed_x",
    "karts_speed_y",
    "boxes_x",
    "boxes_y",
    "hazards_x",
    "hazards_y",
)
_RIVALS = ("karts_along", "karts_across")
_MOTION = ("speed", "lateral_speed", "yaw_rate", "steering")

PRESETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        # What the sensors of a real car give; no map, no positions.
        "lidar": ("lidar", "lidar_before", *_MOTION, *_GAME),
        "radar": ("radar", "radar_kind", *_MOTION, *_GAME),
        # For drivers that may know the course.
        "track": (*_MOTION, *_TRACK, *_WORLD, *_GAME, "gap_ahead", "gap_behind"),
        # For drivers that may know the fastest line as well; see `scenario/raceline/attach.py`.
        "line": (*_MOTION, *_TRACK, *_LINE, *_WORLD, *_GAME, "gap_ahead", "gap_behind"),
        # The line, and where others are beside it: for policies that race.
        "rivals": (
            *(*_MOTION, *_TRACK, *_LINE, *_WORLD, *_RIVALS, *_GAME, "item_use"),
            *("gap_ahead", "gap_behind"),
        ),
        "full": tuple(part.name for part in PARTS),
    }
)


# Observations that leave out what a live race tells every driver (lights, flags, the end); a
# policy trained on one of them gets its numbers out of a larger preset.
LEARNING_PRESETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        # Report of the 1/10 race, 2024: the scan now and before, speed and steering.
        "report_b": ("lidar", "lidar_before", "speed", "steering"),
    }
)


@dataclass(frozen=True)
class Layout:
    """Where each part of a preset lies in the vector."""

    preset: str
    slices: Mapping[str, slice]
    size: int
    numbers: tuple[int, ...]  # part numbers in order

    def lows(self) -> NDArray[np.float32]:
        """Return the smallest value of every element, shape (size,)."""
        return self._bounds("low")

    def highs(self) -> NDArray[np.float32]:
        """Return the largest value of every element, shape (size,)."""
        return self._bounds("high")

    def _bounds(self, which: str) -> NDArray[np.float32]:
        bounds = np.zeros(self.size, np.float32)
        for name, place in self.slices.items():
            bounds[place] = getattr(PARTS[PART_NUMBERS[name]], which)
        return bounds


@cache
def layout_of(preset: str | tuple[str, ...], lidar_rays: int) -> Layout:
    """Return the layout of a preset, or of parts by name, for a lidar of `lidar_rays` rays.

    Raises:
        ScenarioError: no preset or part has that name.
    """
    names = _parts_of(preset)
    slices: dict[str, slice] = {}
    start = 0
    for name in names:
        size = PARTS[PART_NUMBERS[name]].size or lidar_rays
        slices[name] = slice(start, start + size)
        start += size
    numbers = tuple(PART_NUMBERS[name] for name in names)
    title = preset if isinstance(preset, str) else "+".join(preset)
    return Layout(title, MappingProxyType(slices), start, numbers)


def wants_line(observation: str | tuple[str, ...]) -> bool:
    """Return whether a preset, or parts by name, tell of the reference line."""
    return not {*_LINE, *_RIVALS}.isdisjoint(_parts_of(observation))


def _parts_of(preset: str | tuple[str, ...]) -> tuple[str, ...]:
    known = {**PRESETS, **LEARNING_PRESETS}
    if isinstance(preset, str):
        if preset not in known:
            raise ScenarioError(
                f"observation {preset!r} is unknown; choose one of {', '.join(known)}"
            )
        return known[preset]
    unknown = [name for name in preset if name not in PART_NUMBERS]
    if unknown or not preset or len(set(preset)) < len(preset):
        raise ScenarioError(
            f"observation parts {preset}: choose some of {', '.join(PART_NUMBERS)}, each once"
        )
    return preset


@dataclass(frozen=True, slots=True)
class Observation:
    """What one seat sees at one tick."""

    tick: int
    layout: Layout
    values: NDArray[np.float32]  # (size,)

    def __getitem__(self, name: str) -> NDArray[np.float32]:
        """Return the part called `name`, shape (size of the part,)."""
        return self.values[self.layout.slices[name]]

    def scalar(self, name: str) -> float:
        """Return the part called `name` of size one."""
        return float(self.values[self.layout.slices[name].start])
