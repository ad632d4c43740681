"""A teacher that knows the costs to go: it labels what a car drives to that learns to park.

The costs are made once for each row of slots of each lot, and kept. So that the same answer belongs
to the same place, all slots but its own are taken for occupied where the lot may occupy them,
whichever are: what the round has drawn there does not matter.
"""

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.greedy import lead_all
from race_agents.training.lines import Say
from race_agents.training.lot_teacher import Labels, LotTeacher
from race_server.core.free_space.ground import Ground
from race_server.core.free_space.obstacles import PASSING, cover_radius
from race_server.core.free_space.rig import rig_of_car, scale_of
from race_server.core.free_space.state_costs import CELL, StateCosts, kept_state_costs
from race_server.core.kernels.geometry import Pose, seen_from
from race_server.core.lots import Lots
from race_server.core.state import Record, Walls
from race_server.core.vehicles import Vehicle
from race_server.envs.actions import CRAWLED, action_kind
from race_server.envs.batch import Batch
from race_server.envs.parking.heuristics.atlas import check_lot, goal_in, standing_in

# Distance kept from obstacles [m], share of the greatest curvature, and what a change of direction
# costs [m] for the usual bar.
MARGIN, LOCK, CUSP = 0.08, 0.98, 6.0
# How fast the front wheels turn [rad/m]: by 0.5 rad/s at 0.5 m/s.
RATE = 1.0
# Difference [m], [rad] below which slots are alike, and lengths between those one behind another.
ALIKE, NEXT = 1e-3, 1.1


def costs_to(
    lots: Lots, walls: Walls, number: int, slot: int, vehicle: Vehicle, cell: float
) -> StateCosts:
    """Return the costs to go to a slot.

    number: of the lot; slot: its number in the lot; cell: side of a cell [m] for the usual bar.
    """
    lot, site = lots.lots[number], walls.sites[number]
    first = int(site["wall_start"])
    segments = walls.segments[first : first + int(site["wall_count"])]
    ends = segments.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    rig = rig_of_car(vehicle, MARGIN, LOCK)
    goal = goal_in(lots.slots[int(lot["slot_start"]) + slot], vehicle)
    obstacles = Ground().obstacles(
        Pose(low[0], low[1], 0.0),
        Pose(high[0], high[1], 0.0),
        segments,
        standing_in(lots, lot, slot),
        reach=1.0,
        near=PASSING + cover_radius(rig.drawn),
    )
    cusp = CUSP * scale_of(rig.bar)
    return kept_state_costs(obstacles, rig, goal, rate=RATE, cusp=cusp, cell=cell)


def rows_of(lots: Lots, number: int) -> list[list[int]]:
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


class GreedyTeacher(LotTeacher):
    """Knows what the car of every world of a batch is to do."""

    def __init__(self, batch: Batch, say: Say = lambda _: None, *, cell: float = CELL) -> None:
        """Find the costs to go to the slots of all lots.

        cell: side of a cell [m] for the usual bar.

        Raises:
            ScenarioError: the cars do not learn alone, have other actions than a speed and
                steering, or a lot has no slots, or draws blocks.
        """
        super().__init__(batch, "dock", "crawl")
        self._kind = action_kind(batch.task.action)
        self._rig = rig_of_car(self._vehicle, MARGIN, LOCK)
        world = batch.world
        lots = world.parking.lots
        self._goals = np.array([goal_in(slot, self._vehicle) for slot in lots.slots])
        self._rows = np.zeros(len(lots.slots), np.int64)  # of each slot, its place in `_costs`
        self._costs: list[StateCosts] = []
        for number, lot in enumerate(lots.lots):
            check_lot(lot, batch.scenarios[number].course.name, "a teacher in a lot")
            for row in rows_of(lots, number):
                say(f"costs to go to slots: row {len(self._costs) + 1}")
                self._rows[int(lot["slot_start"]) + np.array(row)] = len(self._costs)
                middle = row[len(row) // 2]
                found = costs_to(lots, world.walls, number, middle, self._vehicle, cell)
                self._costs.append(found)
        self._controls = np.zeros((batch.worlds, 2))

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that lead to where the costs to go are less."""
        del seen, begun
        world, vehicle, controls = self._batch.world, self._vehicle, self._controls
        parkers = world.parking.parkers
        slots = world.parking.lots.lots["slot_start"][world.rules["course"]] + parkers["slot"][:, 0]
        rows = self._rows[slots]
        for row in np.unique(rows):
            lead_all(
                np.flatnonzero(rows == row),
                world.bodies,
                world.vehicles,
                parkers,
                self._goals[slots],
                self._costs[row],
                self._rig,
                controls,
            )
        speeds = controls[:, 0]
        most = np.where(speeds > 0.0, vehicle.top_speed, vehicle.reverse_speed)
        shares = speeds / most
        if self._kind == CRAWLED:
            shares = np.copysign(np.sqrt(np.abs(shares)), shares)
        return np.stack([shares, controls[:, 1]], axis=1).astype(np.float32)
