"""The rays of a kart's sensors without noise, for spectators.

A server does not publish what karts see: it is computed here from the snapshot, in plain numpy, so
that no compiler has to be loaded. A test compares it with the sensors of the race.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.messages import KartFlag
from race_server.core.state import RADAR_RAYS
from race_server.net.wire.lobby import CourseSheet
from race_server.net.wire.parking import BLOCK_NAMES, LotFrame, Rows
from race_server.net.wire.rays import RaysFrame
from race_server.net.wire.spectate import SnapshotFrame
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.polyline import corners_of_box, segments_of
from race_server.scenario.track.raycast import are_near, first_met

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Things:
    """Everything that rays may hit: P segments and D discs."""

    segments: Floats  # (P, 4) [m]
    kinds: NDArray[np.uint8]  # (P,) see `race_server.core.codes`
    discs: Floats  # (D, 3) x, y, radius [m]
    disc_kinds: NDArray[np.uint8]  # (D,)


class RayCaster:
    """Casts the rays of karts on one course."""

    def __init__(self, course: CourseSheet, lidar: Lidar | None = None, radar: Radar | None = None):
        """Keep what never moves. lidar, radar: those of the race, if they are known."""
        self._course, self._lidar, self._radar = course, lidar or Lidar(), radar or Radar()
        boxes = course.obstacles
        outlines = [segments_of(corners_of_box(*box)) for box in boxes]
        self._walls = np.concatenate([course.borders, *outlines])
        count = len(self._walls) - len(course.borders)
        self._kinds = np.repeat(
            np.array([codes.BORDER, codes.OBSTACLE], np.uint8), [len(course.borders), count]
        )

    def cast(
        self, frame: SnapshotFrame, seat: int, lot: LotFrame | None = None
    ) -> RaysFrame | None:
        """Return what the kart of a seat would see, None where it is not on the track.

        lot: what stands in a car park besides.
        """
        own = frame.karts[frame.karts["seat"] == seat]
        if not len(own):
            return None
        x, y, heading = (float(own[name][0]) for name in ("x", "y", "heading"))
        things, lidar, radar = self._things(frame, seat, lot), self._lidar, self._radar
        scan = np.linspace(-0.5 * lidar.field, 0.5 * lidar.field, lidar.rays)
        angles = np.linspace(-0.5 * radar.field, 0.5 * radar.field, RADAR_RAYS)
        ranges, _ = _cast(things, x, y, heading, lidar.ahead, scan, lidar.reach)
        distances, kinds = _cast(things, x, y, heading, radar.ahead, angles, radar.reach)
        return RaysFrame(
            *(frame.tick, seat, x, y, heading, lidar.ahead, lidar.field, lidar.reach),
            *(ranges.astype("f4"), radar.ahead, radar.reach, angles.astype("f4")),
            *(distances.astype("f4"), kinds),
        )

    def _things(self, frame: SnapshotFrame, seat: int, lot: LotFrame | None) -> Things:
        karts, course = frame.karts, self._course
        # In a car park a vehicle stays where it has parked or crashed; beside a track it is a block
        # once it has parked, and one that is home or out is not there.
        is_there = (karts["status"] == codes.RACING) | (len(course.line) == 0)
        is_seen = is_there & (karts["flags"] & KartFlag.SUSPENDED == 0)
        outlines = [np.zeros((0, 4))]
        for kart in karts[is_seen & (karts["seat"] != seat)]:
            turn = float(kart["heading"])
            x = float(kart["x"]) + course.kart_ahead * math.cos(turn)
            y = float(kart["y"]) + course.kart_ahead * math.sin(turn)
            corners = corners_of_box(x, y, turn, course.kart_length, course.kart_width)
            outlines.append(segments_of(corners))
        trailers = frame.trailers[frame.trailers["seat"] != seat].tolist()
        outlines += [segments_of(corners_of_box(*one[:5])) for one in trailers]
        bodies = np.concatenate(outlines)
        kinds = np.full(len(bodies), codes.KART_HIT, np.uint8)
        blocks, block_kinds = _blocks_of(lot)
        discs = [_discs_of(frame.hazards), _discs_of(frame.walkers)]
        return Things(
            np.concatenate([self._walls, bodies, blocks]),
            np.concatenate([self._kinds, kinds, block_kinds]),
            np.concatenate(discs),
            np.repeat(np.array([codes.HAZARD_HIT, codes.PERSON], np.uint8), [*map(len, discs)]),
        )


def _blocks_of(lot: LotFrame | None) -> tuple[Floats, NDArray[np.uint8]]:
    """Return the sides of what stands in a car park, (P, 4), and their kinds, (P,)."""
    rows = [] if lot is None else lot.blocks[BLOCK_NAMES].tolist()
    sides = [segments_of(corners_of_box(*row[:5])) for row in rows]
    kinds = np.array([row[5] for row in rows], np.uint8)
    return np.concatenate([np.zeros((0, 4)), *sides]), np.repeat(kinds, 4)


def _discs_of(rows: Rows) -> Floats:
    """Return x, y and radius [m] of rows, (D, 3)."""
    return np.stack([rows[name].astype(float) for name in ("x", "y", "radius")], axis=1)


def _cast(
    things: Things,
    x: float,
    y: float,
    heading: float,
    ahead: float,
    angles: Floats,
    reach: float,
) -> tuple[Floats, NDArray[np.uint8]]:
    """Return range [m] and kind of what each ray of a fan hits first.

    ahead: where the sensor is, of (x, y) along the heading [m]; angles: (R,) [rad] of its rays.
    """
    x, y = x + ahead * math.cos(heading), y + ahead * math.sin(heading)
    near = are_near(things.segments, x, y, reach)
    ranges, which = first_met(things.segments[near], x, y, heading + angles, reach)
    # The last entry is for rays that hit nothing: their index is -1.
    kinds = np.append(things.kinds[near], np.uint8(codes.NOTHING))[which]
    ways = np.stack([np.cos(heading + angles), np.sin(heading + angles)], axis=1)
    for disc, kind in zip(things.discs, things.disc_kinds, strict=True):
        found = _to_disc(disc, x, y, ways)
        hits = found < ranges
        ranges[hits], kinds[hits] = found[hits], kind
    return ranges, kinds


def _to_disc(disc: Floats, x: float, y: float, ways: Floats) -> Floats:
    """Return the distance [m] of each ray to a disc; infinity where none, or from inside."""
    dx, dy = disc[0] - x, disc[1] - y
    square, radius = dx * dx + dy * dy, disc[2]
    ahead = ways @ np.array([dx, dy])
    root = radius * radius - (square - ahead * ahead)
    met = (root >= 0.0) & (ahead > 0.0) & (square > radius * radius)
    return np.where(met, ahead - np.sqrt(np.maximum(root, 0.0)), np.inf)
