"""What a driver sees: named parts, combined into presets.

An observation is one float32 vector in SI units. The same kernel (`core/stages/observe.py`)
fills it for training and for the live server. "Ahead" is along the centre line; the kart frame
has x ahead and y to the left.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.core.observation_parts import AHEAD as AHEAD
from race_server.core.observation_parts import BRAKE_SHARE as BRAKE_SHARE
from race_server.core.observation_parts import NEARBY as NEARBY
from race_server.core.observation_parts import PART_NUMBERS as PART_NUMBERS
from race_server.core.observation_parts import PARTS as PARTS
from race_server.core.observation_parts import THINGS as THINGS
from race_server.core.observation_parts import USES as USES
from race_server.core.observation_parts import Part as Part
from race_server.core.observation_parts import numbers_of as numbers_of
from race_server.errors import ScenarioError

_GAME = (
    *("item", "speed_cap", "thrust_scale", "grip_scale", "lights", "flag", "lap", "rank"),
    *("wrong_way", "rescue_offered", "finished"),
)
_GAPS = ("gap_ahead", "gap_behind")
_TRACK = (
    *("progress", "lateral_offset", "heading_error", "curvature_ahead"),
    *("path_ahead_x", "path_ahead_y", "left_ahead", "right_ahead", "look_ahead"),
)
_LINE = (
    *("line_offset", "line_heading", "line_step", "line_ahead_x", "line_ahead_y"),
    *("line_curvature_ahead", "line_speed_ahead", "line_left_ahead", "line_right_ahead"),
)
_HELD = ("line_speed_held",)
_WORLD = (
    *("karts_x", "karts_y", "karts_speed_x", "karts_speed_y"),
    *("boxes_x", "boxes_y", "hazards_x", "hazards_y"),
)
_RIVALS = ("karts_along", "karts_across")
_GOAL = (
    *("goal_x", "goal_y", "goal_cos", "goal_sin", "goal_distance", "goal_proximity"),
    *("goal_bearing", "parked_for"),
)
_POSE = ("position_x", "position_y", "heading")
_LOT = (
    *(*_POSE, "heading_cos", "heading_sin"),
    *("slot_x", "slot_y", "slot_heading", "to_slot_x", "to_slot_y", "velocity_x", "velocity_y"),
)
_MOTION = ("speed", "lateral_speed", "yaw_rate", "steering")

_MOVERS = (
    *("movers_x", "movers_y", "movers_speed_x", "movers_speed_y"),
    *("movers_age", "movers_radius"),
)
_TRAILER = ("hitch", "hitch_behind", "goal_turn", "trailer_error")

_DOCK = ("trailer_along", "trailer_across", "gear")

_REPORT_A = ("position_x", "position_y", "slot_x", "slot_y", "heading", "velocity_x", "velocity_y")
_REPORT_A_UNIT = ("position_unit", "slot_unit", "heading", "velocity_unit", "to_slot_unit")

PRESETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        # What the sensors of a real car give; no map, no positions.
        "lidar": ("lidar", "lidar_before", *_MOTION, *_GAME),
        "radar": ("radar", "radar_kind", *_MOTION, *_GAME),
        # For drivers that may know the course.
        "track": (*_MOTION, *_TRACK, *_WORLD, *_GAME, *_GAPS),
        # For drivers that may know the fastest line as well; see `scenario/raceline/attach.py`.
        "line": (*_MOTION, *_TRACK, *_LINE, *_WORLD, *_GAME, *_GAPS, *_HELD),
        # For drivers that know the line by a map, and others by their radar alone.
        "radar_line": ("radar", "radar_kind", *_MOTION, *_TRACK, *_LINE, *_GAME, *_GAPS, *_HELD),
        # The line, and where other karts are beside it: for policies that race.
        "rivals": (
            *_MOTION,
            *_TRACK,
            *_LINE,
            *_WORLD,
            *_RIVALS,
            *_GAME,
            "item_use",
            *_GAPS,
            *_HELD,
        ),
        # For drivers that park: where the slot is, and what the radar sees.
        "lot": ("radar", "radar_kind", "radar_before", *_MOTION, *_GOAL, *_LOT, *_GAME),
        # For drivers that have a map of the lot: their pose on it, and the lidar to see the rest.
        "lot_lidar": ("lidar", *_MOTION, *_POSE, "hitch", "parked_for", *_GAME),
        # For drivers that park with trailers, from feelers or from a map.
        "lot_trailer": ("feelers", *_MOTION, *_GOAL, *_TRAILER, *_LOT, *_GAME, *_DOCK),
        "full": tuple(part.name for part in PARTS),
    }
)

# Observations without what a live race tells every driver (lights, flags, the end); a policy
# trained on one of them picks its numbers out of a larger preset.
LEARNING_PRESETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        # Report of the 1/10 race, 2023: the scan now and before, speed and steering.
        "report_b": ("lidar", "lidar_before", "speed", "steering"),
        # Report on automatic parking of a kart, 2022: its first configuration, its second, and with
        # the radar the final one.
        "report_a_1": _REPORT_A,
        "report_a_2": (*_REPORT_A, "to_slot_x", "to_slot_y"),
        "report_a": (*_REPORT_A, "to_slot_x", "to_slot_y", "radar", "radar_kind"),
        # The same with vectors of length 1, as its figure 50 prints them.
        "report_a_2_unit": _REPORT_A_UNIT,
        "report_a_unit": (*_REPORT_A_UNIT, "radar", "radar_kind"),
        # Nothing here depends on where the lot lies.
        "park": ("radar", "radar_kind", "radar_before", *_MOTION, *_GOAL),
        "park_trailer": ("feelers", *_MOTION, *_GOAL, *_TRAILER),
        # The state of a vehicle with one trailer in the frame of its slot, and what is near by; the
        # slot's own place tells what else stands in the lot.
        "dock": (
            *("feelers", "speed", "steering", "hitch", "trailer_error"),
            *("trailer_along", "trailer_across", "slot_x", "gear"),
        ),
        # Report on an articulated vehicle that learns to park: 22 numbers.
        "report_c": (
            *("speed", "heading", "hitch", "steering", "feelers", "goal_proximity"),
            *("goal_bearing", "goal_turn", "trailer_error"),
        ),
        # As `park`, with the lidar, and what is remembered of people and vehicles.
        "yard": ("radar", "radar_kind", "lidar", *_MOTION, *_GOAL, *_MOVERS),
    }
)


@dataclass(frozen=True)
class Layout:
    """Where each part of a preset lies in the vector."""

    preset: str
    slices: Mapping[str, slice]
    size: int
    numbers: tuple[int, ...]  # part numbers in order

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how `pickle` makes it again, which takes no read-only mapping."""
        return _layout, (self.preset, dict(self.slices), self.size, self.numbers)

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


def _layout(preset: str, slices: dict[str, slice], size: int, numbers: tuple[int, ...]) -> Layout:
    return Layout(preset, MappingProxyType(slices), size, numbers)


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
    return _layout(title, slices, start, numbers)


def offsets_of(layout: Layout) -> NDArray[np.int64]:
    """Return where each part begins in a vector, shape (parts + 1,), by part number.

    Parts that the layout lacks have -1. The last number is the count of lidar rays, 0 without.
    """
    offsets = np.full(len(PARTS) + 1, -1, np.int64)
    for name, place in layout.slices.items():
        offsets[PART_NUMBERS[name]] = place.start
    lidar = layout.slices.get("lidar", slice(0, 0))
    offsets[-1] = lidar.stop - lidar.start
    return offsets


def wants_line(observation: str | tuple[str, ...]) -> bool:
    """Return whether a preset, or parts by name, include the reference line."""
    return not {*_LINE, *_RIVALS, *_HELD}.isdisjoint(_parts_of(observation))


def _parts_of(preset: str | tuple[str, ...]) -> tuple[str, ...]:
    known = {**PRESETS, **LEARNING_PRESETS}
    if isinstance(preset, str):
        if preset not in known:
            raise ScenarioError(
                f"observation {preset!r} is unknown; choose one of {', '.join(known)}"
            )
        return known[preset]
    twice = next((name for name in preset if preset.count(name) > 1), None)
    if twice in PART_NUMBERS:
        raise ScenarioError(f"observation part {twice!r} is given twice: give each once")
    if not preset or not PART_NUMBERS.keys() >= set(preset):
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
