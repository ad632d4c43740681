"""Cases of the benchmark TPCAP as car parks: one start, one goal, polygons in between.

Trajectory planning competition for automated parking, 2022 (tpcap.github.io). A case is one list of
numbers: start x, y, heading; goal x, y, heading; the number of obstacles n; n numbers of corners;
then x, y of all corners. Poses are those of the rear axle, in metres and radians.
"""

import json
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from race_server.core.vehicle_presets import CAR
from race_server.errors import LotError
from race_server.kept_file import write_together
from race_server.scenario.lot.faults import PLAY
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.load import BEYOND, LEAST_SQUARE, MOST_CORNERS, MOST_ROWS, lot_of
from race_server.scenario.lot.load import LARGEST as LARGEST_AREA
from race_server.scenario.lot.site import course_of_lot
from race_server.scenario.text_files import read_text
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.lot import Lot
from race_server.scenario.track.polyline import area_of, crossings, segments_of

MOST_POLYGONS = MOST_ROWS["polygons"]
# Poses, counts, and corners of the largest case; a number takes at most 32 characters here.
MOST_NUMBERS = 7 + MOST_POLYGONS * (1 + 2 * MOST_CORNERS)
MOST_BYTES = 32 * MOST_NUMBERS
# Places are counted from the multiple of this that is nearest to the start [m]: some cases lie ten
# million kilometres from their origin.
TILE = 1000.0
FARTHEST = 2.0 * TILE  # [m] of any place, counted so
LARGEST = 1e11  # of any number
# A number whose comma may set off decimals.
DECIMAL_COMMA = re.compile(r"[-+]?\d+(,\d+)?(e[-+]?\d+)?", re.IGNORECASE)
# The area reaches this far beyond start and goal [m], as in the benchmark's own pictures.
MARGIN = 8.0
# Room around the vehicle in its slot [m], the most that obstacles leave, or else the least that a
# slot has to have: it may reach a little into an obstacle.
ROOMS = (0.15, 0.1, 0.05, 0.5 * PLAY)


@dataclass(frozen=True, eq=False)
class Case:
    """One case: poses of the middle of the body, and obstacles."""

    start: tuple[float, float, float]  # x, y [m], heading [rad]
    goal: tuple[float, float, float]
    polygons: tuple[Floats, ...]  # corners (N, 2) [m] of each, clockwise

    @property
    def area(self) -> tuple[float, float, float, float]:
        """x0, x1, y0, y1 [m] of the area, rounded outwards to 0.1 m."""
        places = np.array([self.start[:2], self.goal[:2]])
        low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
        low, high = np.floor(10.0 * low) / 10.0, np.ceil(10.0 * high) / 10.0
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def import_case(source: Path, target: Path, *, title: str) -> Course:
    """Write a case as the file of a car park, and return that.

    Obstacles outside of the area are left out, and what reaches far beyond it is cut off: nothing
    sees or meets what is behind its border.

    Raises:
        LotError: the source is no case, start or goal lies in an obstacle, or the target does not
            end in ``.toml``, is the source or cannot be written; what was there stays as it is
            then.
    """
    if target.suffix != ".toml":
        raise LotError(f"{target}: the file of a lot ends in .toml")
    if _are_one(source, target):
        raise LotError(
            f"{target}: the case itself, which would be written over; write the lot under another "
            "name"
        )
    case = _in_sight(source, read_case(source))
    text = _file_of(case, _room_for(source, case), source.name, title)
    course = lot_of(target.stem, str(source), text)
    try:
        write_together({target: text.encode()})
    except OSError as error:
        raise LotError(f"{target}: cannot be written: {error.strerror}") from error
    return course


def _are_one(path: Path, other: Path) -> bool:
    """Return whether two paths lead to one file; one that cannot be seen is no other."""
    try:
        return path.samefile(other)
    except OSError:
        return False


def read_case(path: Path) -> Case:
    """Return the case of a file.

    Raises:
        LotError: it cannot be read, is too long, or holds something else.
    """
    text = read_text(path, MOST_BYTES, LotError)
    try:
        return _case_of(path, _numbers_in(path, text))
    except LotError as error:
        words = text.replace(";", " ").split()
        if all(DECIMAL_COMMA.fullmatch(word) for word in words) and any("," in w for w in words):
            raise LotError(f"{error}; write decimals with a point") from error
        raise


def _case_of(path: Path, numbers: list[float]) -> Case:
    if len(numbers) < 7:
        raise LotError(
            f"{path}: {len(numbers)} numbers; a case begins with 7: start x, y, heading, goal x, "
            "y, heading, number of obstacles"
        )
    count = _count(path, numbers[6], "number of obstacles", 0, MOST_POLYGONS)
    if len(numbers) < 7 + count:
        raise LotError(f"{path}: {count} obstacles, but the numbers of their corners are missing")
    corners = [
        _count(path, number, f"corners of obstacle {place}", 3, MOST_CORNERS)
        for place, number in enumerate(numbers[7 : 7 + count], start=1)
    ]
    points = np.array(numbers[7 + count :])
    if len(points) != 2 * sum(corners):
        raise LotError(
            f"{path}: {len(points)} numbers for {sum(corners)} corners; give x and y of each, and "
            "nothing behind them"
        )
    for name, heading in (("start", numbers[2]), ("goal", numbers[5])):
        if abs(heading) > 2.0 * math.pi:
            raise LotError(
                f"{path}: heading of the {name} = {heading:g}: give radians, up to 2 pi = 6.28"
            )
    start, goal = np.array(numbers[:2]), np.array(numbers[3:5])
    origin = TILE * np.round(start / TILE)
    places = points.reshape(-1, 2) - origin
    farthest = float(np.abs([*places, goal - origin]).max())
    if farthest > FARTHEST:
        raise LotError(f"{path}: {farthest:.3g} m from the start: give up to {FARTHEST:g} m")
    apart = float(np.abs(goal - start).max())
    if apart + 2.0 * MARGIN + 1.0 > LARGEST_AREA:
        raise LotError(
            f"{path}: start and goal lie {apart:.0f} m apart: an area has sides of up to "
            f"{LARGEST_AREA:g} m, with {MARGIN:g} m around both"
        )
    loops = np.split(places, np.cumsum(corners)[:-1]) if count else []
    return Case(
        _middle_of(start - origin, numbers[2]),
        _middle_of(goal - origin, numbers[5]),
        tuple(loop[::-1] if area_of(loop) > 0.0 else loop for loop in map(_open, loops)),
    )


def _numbers_in(path: Path, text: str) -> list[float]:
    numbers: list[float] = []
    for line, row in enumerate(text.splitlines(), start=1):
        for word in row.replace(",", " ").replace(";", " ").split():
            try:
                number = float(word)
            except ValueError as error:
                raise LotError(f"{path}, line {line}: {word[:40]!r} is no number") from error
            if math.isnan(number):
                raise LotError(f"{path}, line {line}: {word[:40]!r} is no number")
            if abs(number) > LARGEST:
                raise LotError(f"{path}, line {line}: {word[:40]}: give up to {LARGEST:g}")
            numbers.append(number)
        if len(numbers) > MOST_NUMBERS:
            raise LotError(f"{path}: more than {MOST_NUMBERS} numbers")
    return numbers


def _count(path: Path, number: float, what: str, least: int, most: int) -> int:
    if number != round(number) or not least <= number <= most:
        raise LotError(f"{path}: {what} = {number:g}: give a whole number, {least} to {most}")
    return int(number)


def _middle_of(axle: Floats, heading: float) -> tuple[float, float, float]:
    """Return the pose of the middle of the body for that of the rear axle, at (x, y) [m]."""
    ahead = CAR.rear_axle + CAR.box_offset
    x, y = axle[0] + ahead * math.cos(heading), axle[1] + ahead * math.sin(heading)
    return float(x), float(y), math.remainder(heading, 2.0 * math.pi)


def _open(loop: Floats) -> Floats:
    """Return a loop without its last corner if that repeats the first."""
    is_closed = len(loop) > 3 and bool(np.hypot(*(loop[0] - loop[-1])) < 1e-9)
    return loop[:-1] if is_closed else loop


def _in_sight(path: Path, case: Case) -> Case:
    """Return a case without what lies outside of its area, or reaches far beyond it.

    Raises:
        LotError: an obstacle that is left has no area, or its sides cross.
    """
    near = []
    for number, polygon in enumerate(case.polygons, start=1):
        if _is_in(polygon, case.area):
            if len(crossings(segments_of(polygon), first_only=True)):
                raise LotError(
                    f"{path}: the sides of obstacle {number} cross; give its corners in order"
                )
            if abs(area_of(polygon)) < LEAST_SQUARE:
                raise LotError(
                    f"{path}: the corners of obstacle {number} lie on one line; give it an area"
                )
            cut = _cut(polygon, case.area)
            if len(cut) > MOST_CORNERS:
                raise LotError(
                    f"{path}: obstacle {number} reaches far out of the area and has {len(cut)} "
                    f"corners where it is cut off; at most {MOST_CORNERS} make one: split it"
                )
            if len(cut) > 2 and abs(area_of(cut)) >= LEAST_SQUARE and _is_in(cut, case.area):
                near.append(cut)
    return replace(case, polygons=tuple(near))


def _is_in(polygon: Floats, area: tuple[float, float, float, float]) -> bool:
    """Return whether the box around a polygon (N, 2) reaches into an area [m]."""
    x0, x1, y0, y1 = area
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    return bool((low < (x1, y1)).all() and (high > (x0, y0)).all())


def _cut(polygon: Floats, area: tuple[float, float, float, float]) -> Floats:
    """Return the part of a polygon (N, 2) that lies less than BEYOND out of an area [m].

    One side of that rectangle after the other cuts off what is behind it (Sutherland and Hodgman,
    Reentrant polygon clipping, 1974).
    """
    for axis, edge, sign in zip((0, 0, 1, 1), area, (-1.0, 1.0, -1.0, 1.0), strict=True):
        behind = sign * (polygon[:, axis] - edge) - 0.9 * BEYOND
        if (behind <= 0.0).all():
            continue
        kept: list[Floats] = []
        for here, there, a, b in zip(
            polygon, np.roll(polygon, -1, axis=0), behind, np.roll(behind, -1), strict=True
        ):
            if a <= 0.0:
                kept.append(here)
            if (a <= 0.0) != (b <= 0.0):
                kept.append(here + a / (a - b) * (there - here))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def _room_for(path: Path, case: Case) -> tuple[float, float]:
    """Return length and width of the slot [m]: the body, and room that no obstacle takes.

    Raises:
        LotError: the body touches an obstacle at its start or its goal.
    """
    course = course_of_lot("case", "case", case.area, (), _NO_LOT, "", case.polygons)
    bodies = {"start": Footprint(*case.start, CAR.length, CAR.width)}
    bodies["goal"] = Footprint(*case.goal, CAR.length, CAR.width)
    for name, body in bodies.items():
        if wall := wall_under(course, body):
            raise LotError(f"{path}: at the {name} the car of the benchmark touches {wall}")
    for room in ROOMS:
        if not wall_under(course, bodies["goal"].grown(room)):
            break
    return CAR.length + 2.0 * room, CAR.width + 2.0 * room


_NO_LOT = Lot(np.zeros((0, 5)))


def _file_of(case: Case, slot: tuple[float, float], source: str, title: str) -> str:
    clean = "".join(letter for letter in " ".join(title.split()) if letter.isprintable())
    name = "".join(letter for letter in source if letter.isprintable())
    words = [
        f"# Imported from {name}, a case of the benchmark TPCAP (tpcap.github.io).",
        # A string of JSON is one of TOML.
        f"title = {json.dumps(clean[:64] or 'Imported', ensure_ascii=False)}",
        f"area = [{', '.join(f'{side:g}' for side in case.area)}]",
        f"slot = [{slot[0]:.3f}, {slot[1]:.3f}]",
        f'vehicle = "{CAR.name}"',
        "limit_s = 180",
        'level = "parked"',
        "polygons = [",
        *(f"    [{', '.join(map(_point, polygon))}]," for polygon in case.polygons),
        "]",
    ]
    for role, (x, y, heading) in (("start", case.start), ("goal", case.goal)):
        words += [
            "",
            "[[zones]]",
            f'role = "{role}"',
            f"x = [{x:.6f}, {x:.6f}]",
            f"y = [{y:.6f}, {y:.6f}]",
            f"heading = {math.degrees(heading):.6f}",
        ]
    return "\n".join([*words, ""])


def _point(corner: Floats) -> str:
    return f"[{corner[0]:.6f}, {corner[1]:.6f}]"
