"""What is known on the way to each slot of a lot, and which slots know the same."""

import math
from functools import partial

import numpy as np

from race_agents.planning.backing_in import backing_in
from race_agents.planning.greedy import Guide
from race_server.core.free_space.ground import NO_BOXES, Ground
from race_server.core.free_space.obstacles import PASSING, cover_radius
from race_server.core.free_space.rig import rig_of, rig_of_car, scale_of
from race_server.core.free_space.state_costs import kept_state_costs
from race_server.core.kernels.geometry import Pose, seen_from
from race_server.core.lots import Lots
from race_server.core.state import Floats, Record, Records, Walls
from race_server.core.vehicles import Vehicle
from race_server.envs.parking.heuristics.atlas import goal_in, standing_in

# Distance kept from obstacles [m], that of a vehicle with a trailer, and share of the greatest
# curvature.
MARGIN, TOWED_MARGIN, LOCK = 0.08, 0.25, 0.98
CUSP = 6.0  # [m] cost of a change of direction for the usual bar
# How fast the front wheels turn [rad/m]: by 0.5 rad/s at 0.5 m/s. The angle at a hitch changes by
# twice the curvature of the tightest bend, which holds up its own fall, too.
RATE, TOWED_RATE = 1.0, 2.0
# Side of the cells over all of a lot, in cells around the slot.
FAR = 4.0
# Difference [m], [rad] below which slots are alike, and lengths between those one behind another.
ALIKE, NEXT = 1e-3, 1.1


def guide_to(
    lots: Lots, walls: Walls, number: int, slot: int, vehicle: Vehicle, cell: float
) -> Guide:
    """Return what is known on the way to a slot.

    number: of the lot; slot: its number in the lot; cell: side of a cell [m] for the usual bar.
    """
    segments, others = _around(lots, walls, number, slot)
    corners = segments.reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    goal = goal_in(lots.slots[int(lots.lots[number]["slot_start"]) + slot], vehicle)
    if vehicle.trailers:
        rig = rig_of(vehicle, TOWED_MARGIN, LOCK)
    else:
        rig = rig_of_car(vehicle, MARGIN, LOCK)
    obstacles = Ground().obstacles(
        Pose(low[0], low[1], 0.0),
        Pose(high[0], high[1], 0.0),
        segments,
        others,
        reach=1.0,
        near=PASSING + max(cover_radius(rig.drawing), cover_radius(rig.drawn)),
    )
    find = partial(
        kept_state_costs,
        obstacles,
        rig,
        goal,
        rate=TOWED_RATE * rig.bend if vehicle.trailers else RATE,
        cusp=CUSP * scale_of(rig.bar),
    )
    ends = backing_in(obstacles, rig, goal) if vehicle.trailers else None
    costs = find(cell=cell, ends=ends)
    far = costs
    if lots.lots[number]["from_slots"]:
        far = find(cell=FAR * cell, reach=math.inf, finer=costs)
    return Guide(costs, far, obstacles, rig, goal)


def _around(lots: Lots, walls: Walls, number: int, slot: int) -> tuple[Floats, Floats]:
    """Return walls (P, 4) and boxes (B, 6) around a slot, as if all others were occupied.

    Where vehicles start in slots there are lanes in the place of boxes: the sides of all slots.
    """
    site, lot = walls.sites[number], lots.lots[number]
    first = int(site["wall_start"])
    segments = walls.segments[first : first + int(site["wall_count"])]
    if lot["from_slots"]:
        first = int(lot["slot_start"])
        slots = lots.slots[first : first + int(lot["slot_count"])]
        return np.concatenate([segments, _sides(slots)]), NO_BOXES
    return segments, standing_in(lots, lot, slot)


def _sides(slots: Records) -> Floats:
    """Return the long sides of slots as walls, (2 S, 4)."""
    ahead = np.stack([np.cos(slots["heading"]), np.sin(slots["heading"])], axis=1)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) * 0.5 * slots["width"][:, None]
    ahead *= 0.5 * slots["length"][:, None]
    middle = np.stack([slots["x"], slots["y"]], axis=1)
    both = [np.hstack([middle + side - ahead, middle + side + ahead]) for side in (aside, -aside)]
    return np.concatenate(both)


def alike_slots(lots: Lots, walls: Walls, number: int, vehicle: Vehicle) -> list[list[int]]:
    """Return the numbers of slots that one guide is for.

    For a vehicle without a trailer those of a row; with one, what is around reaches in from far, so
    they are those around which everything stands alike, such as at the other end of a lot.
    """
    if not vehicle.trailers:
        return _rows_of(lots, number)
    found = dict[bytes, list[int]]()
    for slot in range(int(lots.lots[number]["slot_count"])):
        found.setdefault(_surroundings(lots, walls, number, slot), []).append(slot)
    return list(found.values())


def _surroundings(lots: Lots, walls: Walls, number: int, slot: int) -> bytes:
    """Return what is around a slot, seen from it."""
    own = lots.slots[int(lots.lots[number]["slot_start"]) + slot]
    segments, boxes = _around(lots, walls, number, slot)
    cos, sin = np.cos(own["heading"]), np.sin(own["heading"])

    def seen(places: Floats) -> Floats:
        away = places - (own["x"], own["y"])
        turned = [away @ (cos, sin), away @ (-sin, cos)]
        return np.stack(turned, axis=-1)

    ends = seen(segments.reshape(-1, 2, 2))
    # A wall has no direction, and a box looks the same from behind.
    lines = np.concatenate([ends.mean(axis=1), np.abs(ends[:, 0] - ends[:, 1])], axis=1)
    along = boxes[:, 2] * cos + boxes[:, 3] * sin
    across = boxes[:, 3] * cos - boxes[:, 2] * sin
    sides = [along * along, along * across, boxes[:, 4], boxes[:, 5]]
    stands = np.concatenate([seen(boxes[:, :2]), np.stack(sides, axis=1)], axis=1)
    parts = [np.round(part / ALIKE).astype(np.int64) for part in (lines, stands)]
    size = np.round([own["length"] / ALIKE, own["width"] / ALIKE]).astype(np.int64)
    return size.tobytes() + b"".join(part[np.lexsort(part.T)].tobytes() for part in parts)


def _rows_of(lots: Lots, number: int) -> list[list[int]]:
    """Return the numbers of slots of one heading and size, side by side or one behind another."""
    first, rows = int(lots.lots[number]["slot_start"]), list[list[int]]()
    for slot in range(int(lots.lots[number]["slot_count"])):
        one = lots.slots[first + slot]
        for row in rows:
            if _are_neighbours(lots.slots[first + row[-1]], one):
                row.append(slot)
                break
        else:
            rows.append([slot])
    return rows


def _are_neighbours(one: Record, other: Record) -> bool:
    """Return whether slots of one heading and size lie side by side, or one behind another."""
    if any(abs(one[name] - other[name]) > ALIKE for name in ("heading", "length", "width")):
        return False
    seen = seen_from(Pose(one["x"], one["y"], one["heading"]), Pose(other["x"], other["y"], 0.0))
    is_behind = abs(seen.y) < ALIKE and abs(seen.x) < NEXT * one["length"]
    return bool(abs(seen.x) < ALIKE or is_behind)
